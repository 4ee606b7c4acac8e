//! Glue between the synthetic capture, which knows no GPU, and the mesh rasteriser, which knows no captures.

use std::path::Path;

use ghand_data::CaptureError;
use ghand_data::synthetic::{SyntheticOptions, generate};
use ghand_render::Gpu;
use ghand_render::mesh::{Light, MeshError, MeshInstance, MeshRenderer, MeshStyle, Shading, Surface};

/// Why a synthetic capture could not be made.
#[derive(Debug, thiserror::Error)]
pub enum SyntheticError {
    /// The capture could not be written or its options are unusable.
    #[error(transparent)]
    Capture(#[from] CaptureError),
    /// The rasteriser could not be made.
    #[error(transparent)]
    Mesh(#[from] MeshError),
}

/// Samples a pixel has along each axis.
const SUPERSAMPLE: u32 = 3;

/// Makes a synthetic capture in an empty or absent folder.
///
/// # Errors
/// [`SyntheticError`] if the folder is taken or cannot be written, or drawing fails.
pub fn make_capture(gpu: &Gpu, options: &SyntheticOptions, folder: &Path) -> Result<(), SyntheticError> {
    let renderer = MeshRenderer::new(gpu)?;
    generate(options, folder, &mut |scene, camera| {
        let lights = scene.lighting.lights.iter().map(|l| Light { direction: l.direction, color: l.color }).collect();
        let shading = Shading::Lit { ambient: scene.lighting.ambient, lights, wrap: scene.lighting.wrap };
        let mesh = MeshInstance {
            positions: scene.positions,
            normals: scene.normals,
            exposure: Some(scene.exposure),
            triangles: scene.triangles,
            surface: Surface::Texture { uvs: scene.uvs, texture: scene.texture },
        };
        let style = MeshStyle { supersample: SUPERSAMPLE, shading, wireframe: None };
        Ok(renderer.render(&mesh, camera, &style).map_err(|e| e.to_string())?.to_straight_rgba8())
    })?;
    Ok(())
}

//! The device's mesh rasteriser as the renderer of scenes.

use ghand_core::Camera;
use ghand_render::Gpu;
use ghand_render::mesh::{Light, MeshError, MeshInstance, MeshRenderer, MeshStyle, Shading, Surface};

use crate::SceneMesh;

/// Colours of a scene's pixels, row by row, or why there are none.
type Pixels = Result<Vec<[u8; 4]>, String>;

/// Draws scenes as [`RenderScene`](crate::RenderScene) does, with so many samples per pixel along each axis.
///
/// # Errors
/// [`MeshError`] if the device rejects the shaders.
pub(crate) fn renderer(gpu: &Gpu, supersample: u32) -> Result<impl FnMut(&SceneMesh, &Camera) -> Pixels, MeshError> {
    let renderer = MeshRenderer::new(gpu)?;
    Ok(move |scene: &SceneMesh, camera: &Camera| {
        let lights = scene.lighting.lights.iter().map(|l| Light { direction: l.direction, color: l.color }).collect();
        let shading = Shading::Lit { ambient: scene.lighting.ambient, lights, wrap: scene.lighting.wrap };
        let mesh = MeshInstance {
            positions: scene.positions,
            normals: scene.normals,
            light_visibility: Some(scene.light_visibility),
            triangles: scene.triangles,
            surface: Surface::Texture { uvs: scene.uvs, texture: scene.texture },
        };
        let style = MeshStyle { supersample, shading, wireframe: None };
        Ok(renderer.render(&mesh, camera, &style).map_err(|e| e.to_string())?.to_straight_rgba8())
    })
}

//! Draws the posed template with a texture.

use ghand_core::mesh::{RenderMesh, Texture};
use ghand_core::posing::pose_hand;
use ghand_core::{Camera, HandModel, InvalidHandModel, Pose};
use ghand_render::Gpu;
use ghand_render::mesh::{MeshError, MeshImage, MeshInstance, MeshRenderer, MeshStyle, Shading, Surface};
use glam::DVec3;

use super::TexelError;

/// A hand model's vertices and vertex normals in a pose.
fn pose_mesh(model: &HandModel, pose: &Pose) -> Result<(Vec<DVec3>, Vec<DVec3>), InvalidHandModel> {
    let positions = pose_hand(model, &[], pose)?.vertices;
    let normals = model.vertex_normals(&positions);
    Ok((positions, normals))
}

/// Draws a posed template with a texture.
pub struct MeshPainter<'a> {
    renderer: MeshRenderer,
    model: &'a HandModel,
    mesh: RenderMesh,
}

impl<'a> MeshPainter<'a> {
    /// Of a hand model, on a device.
    ///
    /// # Errors
    /// [`MeshError`] if the model's mesh cannot be drawn.
    pub fn new(gpu: &Gpu, model: &'a HandModel) -> Result<MeshPainter<'a>, MeshError> {
        Ok(MeshPainter { renderer: MeshRenderer::new(gpu)?, model, mesh: RenderMesh::from_model(model) })
    }

    /// Pixels of a posed template; `supersample` samples per side of a pixel.
    ///
    /// # Errors
    /// [`TexelError`] if the pose does not fit the model, or the device failed.
    pub fn paint(
        &self,
        pose: &Pose,
        camera: &Camera,
        texture: &Texture,
        supersample: u32,
    ) -> Result<MeshImage, TexelError> {
        let (positions, normals) = pose_mesh(self.model, pose)?;
        let instance = MeshInstance {
            positions: &self.mesh.gather(&positions),
            normals: &self.mesh.gather(&normals),
            light_visibility: None,
            triangles: &self.mesh.triangles,
            surface: Surface::Texture { uvs: &self.mesh.uvs, texture },
        };
        let style = MeshStyle { supersample, shading: Shading::Unlit, wireframe: None };
        Ok(self.renderer.render(&instance, camera, &style)?)
    }
}

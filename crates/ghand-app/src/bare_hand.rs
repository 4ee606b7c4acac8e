//! A hand model without an avatar, drawn as a hand, by the viewer and by `ghand pose`: its mesh with the colours of skin
//! and nails in soft light.

mod complexion;

use ghand_core::mesh::{RenderMesh, Texture};
use ghand_core::posing::pose_hand;
use ghand_core::{Camera, HandModel, InvalidHandModel, Pose};
use ghand_fit::texels::colors::TexelColors;
use ghand_hand_model::HandModelError;
use ghand_hand_model::surface::sample_surface;
use ghand_render::mesh::{Light, MeshInstance, Shading, Surface};
use glam::DVec3;

use complexion::Complexion;

/// Texels of the skin along each side: a texel of an adult's hand is half a millimetre wide.
const RESOLUTION: u32 = 512;

/// A hand model with its skin.
#[derive(Debug, Clone)]
pub struct BareHand {
    /// The hand model.
    pub model: HandModel,
    mesh: RenderMesh,
    skin: Texture,
}

/// The mesh in a pose, at the vertices that a renderer needs.
#[derive(Debug, Clone)]
pub struct PosedMesh {
    positions: Vec<DVec3>,
    normals: Vec<DVec3>,
}

impl BareHand {
    /// Paints the skin of a model. Joints are found by their names; without these there are no nails. A model without
    /// usable texture coordinates has one colour.
    pub fn new(model: HandModel) -> BareHand {
        let skin = skin(&model).unwrap_or_else(|_| Texture::plain(bytes(complexion::BACK)));
        BareHand { mesh: RenderMesh::from_model(&model), skin, model }
    }

    /// The mesh in a shape (as many numbers as the model has directions; none for the mean shape) and a pose.
    ///
    /// # Errors
    /// [`InvalidHandModel`] if either does not fit the model.
    pub fn posed(&self, shape: &[f64], pose: &Pose) -> Result<PosedMesh, InvalidHandModel> {
        let positions = pose_hand(&self.model, shape, pose)?.vertices;
        Ok(self.mesh_at(&positions))
    }

    /// The mesh with the model's vertices at these positions, metres, world.
    pub fn mesh_at(&self, positions: &[DVec3]) -> PosedMesh {
        let normals = self.model.vertex_normals(positions);
        PosedMesh { positions: self.mesh.gather(positions), normals: self.mesh.gather(&normals) }
    }

    /// What to draw.
    pub fn instance<'a>(&'a self, posed: &'a PosedMesh) -> MeshInstance<'a> {
        MeshInstance {
            positions: &posed.positions,
            normals: &posed.normals,
            light_visibility: None,
            triangles: &self.mesh.triangles,
            surface: Surface::Texture { uvs: &self.mesh.uvs, texture: &self.skin },
        }
    }
}

/// The light of a photographer's studio, fixed to the camera: a large one above the left shoulder, a weaker one from
/// the right, and one from behind that shows the outline.
pub fn studio_light(camera: &Camera) -> Shading {
    let light = |direction: [f64; 3], color: [f64; 3]| Light {
        direction: camera.rotation.transpose() * DVec3::from(direction),
        color: DVec3::from(color),
    };
    Shading::Lit {
        ambient: DVec3::new(0.36, 0.36, 0.38),
        lights: vec![
            light([-0.6, -0.8, -0.9], [0.62, 0.61, 0.59]),
            light([0.9, -0.1, -0.6], [0.17, 0.17, 0.18]),
            light([0.4, -0.6, 0.9], [0.12, 0.12, 0.13]),
        ],
        wrap: 0.25,
    }
}

/// The skin's colours on the atlas.
fn skin(model: &HandModel) -> Result<Texture, HandModelError> {
    let samples = sample_surface(model, RESOLUTION)?;
    let complexion = Complexion::of(model);
    let count = samples.len();
    let color = |point: usize| {
        let weights = samples.weights.iter().skip(point).step_by(count);
        complexion.color(samples.positions[point], samples.normals[point], weights).to_array()
    };
    let colors = (0..count).map(color).collect();
    Ok(TexelColors { colors, texels: samples.texels, resolution: RESOLUTION }.texture())
}

fn bytes(color: DVec3) -> [u8; 3] {
    color.to_array().map(|v| (255.0 * v).round() as u8)
}

#[cfg(test)]
mod tests;

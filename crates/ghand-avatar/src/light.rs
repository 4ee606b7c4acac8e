//! The light in which an avatar was captured, apart from its skin.
//!
//! Light is fixed in the world while the hand turns and bends in it. A pose gives each vertex of the hand's mesh a shade,
//! in which a Gaussian takes part by its place on the mesh; its colour is that of its skin times the shade
//! (`ghand_core::light`). What training learns as colour is then skin, and what a pose changes about the light follows
//! from the pose.

mod depth_maps;
pub mod environment;
pub mod gloss;
pub(crate) mod lit_hand;
mod trust;
pub mod visibility;

use ghand_core::light::{DIRECTION_COUNT, HARMONIC_COUNT, cosine_transfer, directions, harmonics, shade};
use ghand_core::posing::pose_hand;
use ghand_core::{HandModel, InvalidHandModel, Pose};
use ghand_hand_model::SurfaceSamples;
use glam::{DQuat, DVec3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

pub use gloss::Gloss;
pub use trust::Trust;

/// Vertices whose shades are summed at once.
const CHUNK: usize = 256;

/// How light reaches the skin.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum LightKind {
    /// From [`DIRECTION_COUNT`] directions, each hidden where the hand is in its way.
    Transfer,
    /// By [`HARMONIC_COUNT`] spherical harmonics of the normal, without shadows.
    Sh,
}

impl LightKind {
    /// Number of coefficients.
    pub fn len(self) -> usize {
        match self {
            LightKind::Transfer => DIRECTION_COUNT,
            LightKind::Sh => HARMONIC_COUNT,
        }
    }

    /// Never: each kind has coefficients.
    pub fn is_empty(self) -> bool {
        false
    }
}

/// A light, fixed in the world.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Light {
    /// How it reaches the skin.
    pub kind: LightKind,
    /// From the light's own axes, in which directions and harmonics are, to the world's.
    pub turn: DQuat,
    /// Radiance of each direction of `ghand_core::light::directions`, or the factor of each harmonic; linear RGB, with a
    /// mean over the directions of 1.
    pub coefficients: Vec<[f32; 3]>,
    /// How far it may be trusted, by normal; `None` if everywhere.
    #[serde(default)]
    pub trust: Option<Trust>,
}

/// An avatar's light, and where its Gaussians lie on the mesh that light falls on.
#[derive(Debug, Clone, PartialEq)]
pub struct AvatarLight {
    /// The light.
    pub light: Light,
    /// Triangle of the avatar's mesh for each Gaussian.
    pub faces: Vec<u32>,
    /// Barycentric coordinates on it, in the order of its corners.
    pub barycentric: Vec<[f32; 3]>,
    /// The gloss of the skin, if it has any. Needs a light from directions.
    pub gloss: Option<Gloss>,
}

/// What light does to Gaussians.
#[derive(Debug, Clone, PartialEq)]
pub struct LitGaussians {
    /// The factors on their display values, RGB.
    pub shades: Vec<[f32; 3]>,
    /// What they mirror, linear RGB.
    pub gloss: Vec<[f32; 3]>,
}

impl AvatarLight {
    /// A light on the Gaussians at the samples of a surface.
    pub fn new(light: Light, gloss: Option<Gloss>, samples: &SurfaceSamples) -> AvatarLight {
        let barycentric = samples.barycentric.iter().map(|b| b.map(|x| x as f32)).collect();
        AvatarLight { light, faces: samples.faces.clone(), barycentric, gloss }
    }

    /// What light does to each Gaussian of a hand in a pose, seen by an eye (metres, world axes).
    ///
    /// # Errors
    /// [`InvalidHandModel`] if the pose does not fit the hand.
    pub fn of_gaussians(&self, model: &HandModel, pose: &Pose, eye: DVec3) -> Result<LitGaussians, InvalidHandModel> {
        let parts = self.light.parts(model, pose)?;
        let gloss = self.gloss.as_ref().map(|gloss| {
            let mut vertices = gloss::of_vertices(&self.light, &parts, gloss.roughness, eye);
            gloss::scale(&mut vertices, &gloss.vertex_strengths(model));
            self.at_gaussians(model, &vertices)
        });
        let shades = self.at_gaussians(model, &self.light.shades(&parts));
        Ok(LitGaussians { gloss: gloss.unwrap_or_else(|| vec![[0.0; 3]; shades.len()]), shades })
    }

    /// The vertices of each Gaussian's triangle.
    pub fn corners(&self, model: &HandModel) -> Vec<[u32; 3]> {
        self.faces.iter().map(|face| model.faces.get(*face as usize).copied().unwrap_or_default()).collect()
    }

    /// Values of the vertices, interpolated at the Gaussians.
    pub fn at_gaussians(&self, model: &HandModel, vertices: &[[f32; 3]]) -> Vec<[f32; 3]> {
        let mix = |corners: [u32; 3], weights: &[f32; 3]| {
            let mut sum = [0.0; 3];
            for (corner, weight) in corners.iter().zip(weights) {
                for (s, value) in sum.iter_mut().zip(vertices[*corner as usize]) {
                    *s += weight * value;
                }
            }
            sum
        };
        self.corners(model).into_iter().zip(&self.barycentric).map(|(c, w)| mix(c, w)).collect()
    }
}

impl Light {
    /// Unit vectors towards the light of each of the directions, world axes.
    pub fn directions(&self) -> [DVec3; DIRECTION_COUNT] {
        directions().map(|d| self.turn * d)
    }

    /// The shade of each vertex of a hand in a pose, RGB.
    ///
    /// # Errors
    /// [`InvalidHandModel`] if the pose does not fit the hand.
    pub fn vertex_shades(&self, model: &HandModel, pose: &Pose) -> Result<Vec<[f32; 3]>, InvalidHandModel> {
        Ok(self.shades(&self.parts(model, pose)?))
    }

    /// What each of the light's coefficients, of those that are not 0, gives the vertices of a hand in a pose: of its mean
    /// where the light is not to be trusted.
    ///
    /// # Errors
    /// [`InvalidHandModel`] if the pose does not fit the hand.
    pub fn parts(&self, model: &HandModel, pose: &Pose) -> Result<IrradianceParts, InvalidHandModel> {
        let is_bright = |k: usize| self.coefficients[k] != [0.0; 3];
        let Some(trust) = &self.trust else {
            return IrradianceParts::new(self.kind, self.turn, model, pose, &is_bright);
        };
        // How open a vertex is, all directions say.
        let mut parts = IrradianceParts::new(self.kind, self.turn, model, pose, &|_| true)?;
        trust.blend(self.kind, self.turn, &mut parts.columns, &parts.normals);
        (0..parts.columns.len()).filter(|k| !is_bright(*k)).for_each(|k| parts.columns[k] = vec![]);
        Ok(parts)
    }

    /// The irradiance of a surface with a normal in the light's own axes, RGB, where nothing is in the way, as if the
    /// light were to be trusted everywhere.
    pub fn open_irradiance(&self, normal: DVec3) -> [f64; 3] {
        let parts: Vec<f64> = match self.kind {
            LightKind::Transfer => directions().iter().map(|d| cosine_transfer(normal, *d)).collect(),
            LightKind::Sh => harmonics(normal).to_vec(),
        };
        [0, 1, 2].map(|c| parts.iter().zip(&self.coefficients).map(|(part, l)| part * f64::from(l[c])).sum())
    }

    /// The shade of each vertex, RGB, from its parts of this light.
    pub fn shades(&self, parts: &IrradianceParts) -> Vec<[f32; 3]> {
        let mut shades = vec![[0.0; 3]; parts.vertices.len()];
        shades.par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, shades)| {
            let mut sums = [[0.0f64; CHUNK]; 3];
            for (column, coefficient) in parts.columns.iter().zip(&self.coefficients) {
                let parts = column.get(chunk * CHUNK..).unwrap_or_default();
                for (sums, c) in sums.iter_mut().zip(coefficient.map(f64::from)) {
                    sums.iter_mut().zip(parts).for_each(|(sum, part)| *sum += f64::from(*part) * c);
                }
            }
            for (v, shades) in shades.iter_mut().enumerate() {
                *shades = [0, 1, 2].map(|channel| shade(sums[channel][v]) as f32);
            }
        });
        shades
    }
}

/// What each coefficient of a light contributes to the irradiance of each vertex of a posed hand.
#[derive(Debug, Clone, PartialEq)]
pub struct IrradianceParts {
    /// One column of V numbers per coefficient; empty for those that were not wanted.
    pub columns: Vec<Vec<f32>>,
    /// The posed vertices, metres, world axes.
    pub vertices: Vec<DVec3>,
    /// Their normals, unit length.
    pub normals: Vec<DVec3>,
}

impl IrradianceParts {
    /// The parts of the coefficients that `wanted` names, of a light whose axes are turned.
    ///
    /// # Errors
    /// [`InvalidHandModel`] if the pose does not fit the hand.
    pub fn new(
        kind: LightKind,
        turn: DQuat,
        model: &HandModel,
        pose: &Pose,
        wanted: &(dyn Fn(usize) -> bool + Sync),
    ) -> Result<IrradianceParts, InvalidHandModel> {
        let vertices = pose_hand(model, &[], pose)?.vertices;
        let normals = model.vertex_normals(&vertices);
        let columns = match kind {
            LightKind::Sh => {
                let all: Vec<[f64; HARMONIC_COUNT]> = normals.iter().map(|n| harmonics(turn.inverse() * *n)).collect();
                (0..HARMONIC_COUNT).map(|k| all.iter().map(|values| values[k] as f32).collect()).collect()
            }
            LightKind::Transfer => {
                let towards = directions().map(|d| turn * d);
                visibility::vertex_transfers(&model.faces, &vertices, &normals, &towards, wanted)
            }
        };
        Ok(IrradianceParts { columns, vertices, normals })
    }
}

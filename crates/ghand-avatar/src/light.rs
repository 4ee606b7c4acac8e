//! The light in which an avatar was captured, apart from its skin.
//!
//! Light is fixed in the world while the hand turns and bends in it. A pose gives each vertex of the hand's mesh a shade,
//! in which a Gaussian takes part by its place on the mesh; its colour is that of its skin times the shade
//! (`ghand_core::light`). What training learns as colour is then skin, and what a pose changes about the light follows
//! from the pose.
//!
//! Light comes from directions, and from lamps near the hand ([`Lamps`]). Where skin hides it, light comes from that skin
//! ([`AvatarLight::interreflection`]): as much as the hand's mean irradiance throws back, from wherever it is.

mod depth_maps;
pub mod environment;
pub mod gloss;
pub mod lamps;
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
pub use lamps::{Lamp, Lamps};
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
    /// Lamps near the hand, if light comes from directions.
    #[serde(default)]
    pub lamps: Option<Lamps>,
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
    /// Light that skin throws on skin, RGB: as parts of the hand's mean irradiance, how much comes from where other skin
    /// is in the light's way. 0 to [`MOST_INTERREFLECTION`]; needs a light from directions.
    pub interreflection: [f32; 3],
}

/// The parts of red, green and blue light that the lightest skin throws back.
pub const MOST_INTERREFLECTION: [f32; 3] = [0.65, 0.45, 0.35];

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
        AvatarLight { light, faces: samples.faces.clone(), barycentric, gloss, interreflection: [0.0; 3] }
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
        let shades = self.at_gaussians(model, &self.shades(&parts));
        Ok(LitGaussians { gloss: gloss.unwrap_or_else(|| vec![[0.0; 3]; shades.len()]), shades })
    }

    /// The shade of each vertex, RGB, from its parts of the light.
    pub fn shades(&self, parts: &IrradianceParts) -> Vec<[f32; 3]> {
        self.light.shades(parts, self.interreflection)
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

    /// What each of the light's coefficients and lamps gives the vertices of a hand in a pose: of its mean where the light
    /// is not to be trusted.
    ///
    /// # Errors
    /// [`InvalidHandModel`] if the pose does not fit the hand.
    pub fn parts(&self, model: &HandModel, pose: &Pose) -> Result<IrradianceParts, InvalidHandModel> {
        let mut parts = IrradianceParts::new(self.kind, self.turn, model, pose)?;
        if let Some(lamps) = &self.lamps {
            parts.add_lamps(lamps, self.turn, model);
        }
        if let Some(trust) = &self.trust {
            trust.blend(self, &mut parts);
        }
        Ok(parts)
    }

    /// The radiance of each of the parts' columns.
    pub(crate) fn radiances(&self) -> impl Iterator<Item = [f32; 3]> {
        let lamps = self.lamps.iter().flat_map(|lamps| lamps.lamps.iter().map(|lamp| lamp.radiance));
        self.coefficients.iter().copied().chain(lamps)
    }

    /// The irradiance of a surface with a normal in the light's own axes, RGB, where nothing is in the way, as if the
    /// light were to be trusted everywhere.
    pub fn open_irradiance(&self, normal: DVec3) -> [f64; 3] {
        let mut irradiance = [0.0; 3];
        for (part, radiance) in self.open_parts(normal).into_iter().zip(self.radiances()) {
            irradiance.iter_mut().zip(radiance).for_each(|(sum, c)| *sum += part * f64::from(c));
        }
        irradiance
    }

    /// What each coefficient and lamp gives a surface at the lamps' place with a normal in the light's own axes, where
    /// nothing is in the way.
    fn open_parts(&self, normal: DVec3) -> Vec<f64> {
        let mut parts: Vec<f64> = match self.kind {
            LightKind::Transfer => directions().iter().map(|d| cosine_transfer(normal, *d)).collect(),
            LightKind::Sh => harmonics(normal).to_vec(),
        };
        let lamps = self.lamps.iter().flat_map(|lamps| &lamps.lamps);
        parts.extend(lamps.map(|lamp| cosine_transfer(normal, lamp.offset.normalize_or_zero())));
        parts
    }

    /// The shade of each vertex, RGB, from its parts of this light. See [`AvatarLight::interreflection`].
    pub fn shades(&self, parts: &IrradianceParts, interreflection: [f32; 3]) -> Vec<[f32; 3]> {
        let mut irradiances = vec![[0.0; 3]; parts.vertices.len()];
        irradiances.par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, irradiances)| {
            let mut sums = [[0.0f64; CHUNK]; 3];
            for (column, radiance) in parts.columns.iter().zip(self.radiances()).filter(|(_, c)| *c != [0.0; 3]) {
                let parts = column.get(chunk * CHUNK..).unwrap_or_default();
                for (sums, c) in sums.iter_mut().zip(radiance.map(f64::from)) {
                    sums.iter_mut().zip(parts).for_each(|(sum, part)| *sum += f64::from(*part) * c);
                }
            }
            for (v, irradiance) in irradiances.iter_mut().enumerate() {
                *irradiance = sums.each_ref().map(|sums| sums[v]);
            }
        });
        let mean = parts.mean(&irradiances);
        let thrown: [f64; 3] = std::array::from_fn(|c| f64::from(interreflection[c]) * mean[c]);
        let lit = |(irradiance, closed): (&[f64; 3], &f32)| {
            std::array::from_fn(|c| shade(irradiance[c] + thrown[c] * f64::from(*closed)) as f32)
        };
        irradiances.iter().zip(&parts.closed).map(lit).collect()
    }
}

/// What each coefficient and lamp of a light contributes to the irradiance of each vertex of a posed hand.
#[derive(Debug, Clone, PartialEq)]
pub struct IrradianceParts {
    /// One column of V numbers per coefficient, then one per lamp.
    pub columns: Vec<Vec<f32>>,
    /// The posed vertices, metres, world axes.
    pub vertices: Vec<DVec3>,
    /// Their normals, unit length.
    pub normals: Vec<DVec3>,
    /// Where the lamps stand, metres, world axes.
    pub lamps: Vec<DVec3>,
    /// Of even light, the part that does not reach each vertex past the hand; 0 without directions.
    pub closed: Vec<f32>,
    /// Each vertex's part of the hand's surface.
    pub areas: Vec<f32>,
}

impl IrradianceParts {
    /// The parts of all coefficients of a light whose axes are turned, without lamps.
    ///
    /// # Errors
    /// [`InvalidHandModel`] if the pose does not fit the hand.
    pub fn new(
        kind: LightKind,
        turn: DQuat,
        model: &HandModel,
        pose: &Pose,
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
                visibility::vertex_transfers(&model.faces, &vertices, &normals, &towards)
            }
        };
        let mut closed = vec![0.0; vertices.len()];
        if kind == LightKind::Transfer {
            closed.fill(1.0);
            for column in &columns {
                closed.iter_mut().zip(column).for_each(|(closed, part)| *closed -= part);
            }
            closed.iter_mut().for_each(|closed| *closed = closed.max(0.0));
        }
        let areas = areas(&model.faces, &vertices);
        Ok(IrradianceParts { columns, vertices, normals, lamps: vec![], closed, areas })
    }

    /// Adds those of lamps. `turn` is that of the light.
    pub fn add_lamps(&mut self, lamps: &Lamps, turn: DQuat, model: &HandModel) {
        let positions = lamps.positions(turn, &self.vertices);
        self.columns.extend(lamps.columns(model, &positions, &self.vertices, &self.normals));
        self.lamps.extend(positions);
    }

    /// The mean of values of the vertices over the hand's surface.
    pub fn mean(&self, values: &[[f64; 3]]) -> [f64; 3] {
        let mut mean = [0.0; 3];
        for (value, area) in values.iter().zip(&self.areas) {
            mean.iter_mut().zip(value).for_each(|(sum, c)| *sum += f64::from(*area) * c);
        }
        mean
    }
}

/// Each vertex's part of a surface: a third of its triangles.
fn areas(faces: &[[u32; 3]], vertices: &[DVec3]) -> Vec<f32> {
    let mut areas = vec![0.0; vertices.len()];
    for face in faces {
        let [a, b, c] = face.map(|corner| vertices[corner as usize]);
        let area = (b - a).cross(c - a).length();
        face.iter().for_each(|corner| areas[*corner as usize] += area);
    }
    let whole = areas.iter().sum::<f64>().max(f64::MIN_POSITIVE);
    areas.into_iter().map(|area| (area / whole) as f32).collect()
}

//! The light in which an avatar was captured, apart from its skin.
//!
//! Light is fixed in the world while the hand turns and bends in it. A pose gives each vertex of the hand's mesh a shade,
//! in which a Gaussian takes part by its place on the mesh; its colour is that of its skin times the shade
//! (`ghand_core::light`). What training learns as colour is then skin, and what a pose changes about the light follows
//! from the pose.
//!
//! Light comes from directions, and from lamps near the hand ([`Lamps`]). Where skin hides it, light comes from that skin
//! ([`AvatarLight::interreflection`]): as much as the hand's mean irradiance throws back, from wherever it is.

mod bright;
mod depth_maps;
pub mod environment;
pub mod gloss;
mod irradiance_parts;
pub mod lamps;
pub(crate) mod lit_hand;
pub mod lit_mesh;
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
pub use irradiance_parts::IrradianceParts;
pub use lamps::{Lamp, Lamps};
pub use lit_mesh::{LitMesh, LitParts};
pub use trust::Trust;

/// Vertices whose shades are summed at once.
const CHUNK: usize = 256;
/// Normals whose irradiances are summed at once.
const LANES: usize = 16;

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
    /// Whether light falls on the avatar's mesh with each triangle divided into four, or on the mesh itself.
    pub divided: bool,
    /// Triangle of that mesh for each Gaussian.
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
    /// A light on the Gaussians at the samples of a surface, which is the avatar's own mesh.
    pub fn new(light: Light, gloss: Option<Gloss>, samples: &SurfaceSamples) -> AvatarLight {
        let barycentric = samples.barycentric.iter().map(|b| b.map(|x| x as f32)).collect();
        let faces = samples.faces.clone();
        AvatarLight { light, divided: false, faces, barycentric, gloss, interreflection: [0.0; 3] }
    }

    /// What light does to each Gaussian of a hand in a pose, seen by an eye (metres, world axes).
    ///
    /// # Errors
    /// [`InvalidHandModel`] if the pose does not fit the hand.
    pub fn of_gaussians(&self, model: &HandModel, pose: &Pose, eye: DVec3) -> Result<LitGaussians, InvalidHandModel> {
        let mesh = LitMesh::new(self, model);
        let parts = mesh.parts(&self.light, pose)?;
        let gloss =
            self.gloss.as_ref().map(|gloss| self.at_gaussians(&mesh, &mesh.gloss(gloss, &self.light, &parts, eye)));
        let shades = self.at_gaussians(&mesh, &mesh.shades(&self.light, &parts, self.interreflection));
        Ok(LitGaussians { gloss: gloss.unwrap_or_else(|| vec![[0.0; 3]; shades.len()]), shades })
    }

    /// The vertices of each Gaussian's triangle.
    pub fn corners(&self, mesh: &LitMesh) -> Vec<[u32; 3]> {
        self.faces.iter().map(|face| mesh.faces().get(*face as usize).copied().unwrap_or_default()).collect()
    }

    /// Values of the vertices, interpolated at the Gaussians.
    pub fn at_gaussians(&self, mesh: &LitMesh, vertices: &[[f32; 3]]) -> Vec<[f32; 3]> {
        let mix = |corners: [u32; 3], weights: &[f32; 3]| {
            let mut sum = [0.0; 3];
            for (corner, weight) in corners.iter().zip(weights) {
                for (s, value) in sum.iter_mut().zip(vertices[*corner as usize]) {
                    *s += weight * value;
                }
            }
            sum
        };
        self.corners(mesh).into_iter().zip(&self.barycentric).map(|(c, w)| mix(c, w)).collect()
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
        let vertices = pose_hand(model, &[], pose)?.vertices;
        let normals = model.vertex_normals(&vertices);
        Ok(self.parts_of(model, [vertices, normals], &[]))
    }

    /// As [`Light::parts`], of a hand with these vertices, metres, and normals, unit length, world axes. Columns that are
    /// `known`, perhaps of more vertices after these, are not computed.
    fn parts_of(
        &self,
        model: &HandModel,
        vertices_and_normals: [Vec<DVec3>; 2],
        known: &[Vec<f32>],
    ) -> IrradianceParts {
        let mut parts = IrradianceParts::of(self.kind, self.turn, model, vertices_and_normals, known);
        if let Some(lamps) = &self.lamps {
            parts.add_other_lamps(lamps, self.turn, model, known.get(self.kind.len()..).unwrap_or_default());
        }
        if let Some(trust) = &self.trust {
            trust.blend(self, &mut parts);
        }
        parts
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

    /// The irradiances of surfaces with these normals (world axes), RGB, where nothing is in the way, as if the light were to
    /// be trusted everywhere; without some of the sources.
    fn open_irradiances(&self, normals: &[DVec3], without: &[usize]) -> Vec<[f64; 3]> {
        let own_axes = self.turn.inverse();
        if self.kind == LightKind::Sh {
            return normals.iter().map(|normal| self.open_irradiance(own_axes * *normal)).collect();
        }
        let lamps = self.lamps.iter().flat_map(|lamps| &lamps.lamps);
        let towards = directions().into_iter().chain(lamps.map(|lamp| lamp.offset.normalize_or_zero()));
        let unit = cosine_transfer(DVec3::Z, DVec3::Z) as f32;
        let sources: Vec<([f32; 3], [f32; 3])> = (towards.zip(self.radiances()).enumerate())
            .filter(|(source, (_, radiance))| *radiance != [0.0; 3] && !without.contains(source))
            .map(|(_, (d, radiance))| ((self.turn * d).as_vec3().to_array(), radiance.map(|c| c * unit)))
            .collect();
        // Source by source over several normals at once, in an order that compilers make vectors of.
        let several = |normals: &[DVec3]| {
            let axis = |c: usize| std::array::from_fn(|lane| normals.get(lane).map_or(0.0, |n| n[c] as f32));
            let [x, y, z]: [[f32; LANES]; 3] = [axis(0), axis(1), axis(2)];
            let mut sums = [[0.0f32; LANES]; 3];
            for (d, radiance) in &sources {
                let cosines: [f32; LANES] =
                    std::array::from_fn(|lane| (x[lane] * d[0] + y[lane] * d[1] + z[lane] * d[2]).max(0.0));
                for (sum, c) in sums.iter_mut().zip(radiance) {
                    sum.iter_mut().zip(&cosines).for_each(|(sum, cosine)| *sum += cosine * c);
                }
            }
            (0..normals.len()).map(move |lane| sums.map(|sum| f64::from(sum[lane])))
        };
        normals.par_chunks(LANES).flat_map_iter(several).collect()
    }

    /// The shade of each vertex, RGB, from its parts of this light. See [`AvatarLight::interreflection`].
    pub fn shades(&self, parts: &IrradianceParts, interreflection: [f32; 3]) -> Vec<[f32; 3]> {
        shades(&self.irradiances(parts, interreflection))
    }

    /// The irradiance of each vertex, RGB, from its parts of this light.
    fn irradiances(&self, parts: &IrradianceParts, interreflection: [f32; 3]) -> Vec<[f64; 3]> {
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
        for (irradiance, closed) in irradiances.iter_mut().zip(&parts.closed) {
            irradiance.iter_mut().zip(thrown).for_each(|(sum, thrown)| *sum += thrown * f64::from(*closed));
        }
        irradiances
    }
}

/// The shades of irradiances, RGB.
fn shades(irradiances: &[[f64; 3]]) -> Vec<[f32; 3]> {
    irradiances.par_iter().map(|irradiance| irradiance.map(|value| shade(value) as f32)).collect()
}

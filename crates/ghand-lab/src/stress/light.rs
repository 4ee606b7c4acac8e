//! Light with something extreme about it, and the twin of what it does to Gaussians.

use ghand_avatar::Avatar;
use ghand_avatar::light::{AvatarLight, Gloss, Lamp, Lamps, Light, LightKind, LitMesh, MOST_INTERREFLECTION};
use ghand_avatar::reference::{PosedGaussians, rows, vectors};
use ghand_core::Pose;
use ghand_core::light::{SurfaceLight, lit, lit_vjp};
use ghand_hand_model::surface::sample_surface;
use ghand_hand_model::surface::smooth::smoothed;
use glam::{DQuat, DVec3};

use super::compare::move_by_one;
use super::hand::Sampler;

/// Radiances and strengths.
const FAINTEST: f64 = 1e-4;
const BRIGHTEST: f64 = 1e3;

/// Any light on an avatar with the Gaussians of all texels.
///
/// # Errors
/// If the surface cannot be sampled.
pub fn draw(draw: &mut Sampler, avatar: &Avatar) -> anyhow::Result<AvatarLight> {
    let kind = draw.one(&[LightKind::Transfer, LightKind::Sh]);
    let axis = draw.vector(1.0).try_normalize().unwrap_or(DVec3::X);
    let turn = DQuat::from_axis_angle(axis, draw.vector(3.0).x);
    // A part of the directions is dark; harmonics may darken.
    let dark = draw.one(&[0.0, 0.5, 0.95]);
    let bright = |draw: &mut Sampler, dark: f64| match draw.chance(dark) {
        true => 0.0,
        false => draw.log(FAINTEST, BRIGHTEST) as f32,
    };
    let mut coefficients = vec![[0.0; 3]; kind.len()];
    for value in coefficients.as_flattened_mut() {
        let sign = if kind == LightKind::Sh && draw.chance(0.5) { -1.0 } else { 1.0 };
        *value = sign * bright(draw, dark);
    }
    let glossy = kind == LightKind::Transfer && draw.chance(0.7);
    let gloss = glossy.then(|| Gloss {
        roughness: draw.log(0.01, 1.0),
        strengths: (0..avatar.template.joint_count()).map(|_| [0; 3].map(|_| bright(draw, 0.3))).collect(),
    });
    let near = kind == LightKind::Transfer && draw.chance(0.5);
    let lamps = near.then(|| Lamps {
        place: draw.vector(0.3),
        reach: draw.log(1e-3, 0.3),
        lamps: vec![Lamp {
            offset: draw.vector(1.0).normalize_or(DVec3::Y) * draw.log(0.31, 1e3),
            radius: draw.log(1e-6, 1e3),
            radiance: [0; 3].map(|_| bright(draw, dark)),
        }],
    });
    let thrown = if near { MOST_INTERREFLECTION.map(|most| draw.log(1e-3, f64::from(most)) as f32) } else { [0.0; 3] };
    let samples = sample_surface(&avatar.model, avatar.config.uv_resolution)?;
    let divided = draw.chance(0.5);
    let samples = if divided { samples.on_smoothed(&avatar.model, &smoothed(&avatar.model)) } else { samples };
    let lit = AvatarLight::new(Light { kind, turn, coefficients, lamps, trust: None }, gloss, &samples);
    Ok(AvatarLight { divided, interreflection: thrown, ..lit })
}

/// What falls on an avatar's mesh in a pose, as an eye sees it: the numbers that the device is given.
#[derive(Debug, Clone)]
pub struct TwinLight {
    corners: Vec<[u32; 3]>,
    barycentric: Vec<[f64; 3]>,
    shades: Vec<[f32; 3]>,
    /// Empty without gloss.
    gloss: Vec<[f32; 3]>,
}

fn wide(values: &[[f32; 3]]) -> Vec<[f64; 3]> {
    values.iter().map(|rgb| rgb.map(f64::from)).collect()
}

impl TwinLight {
    /// The light of an avatar; `None` if it has none apart from its skin.
    ///
    /// # Errors
    /// If the pose does not fit the hand.
    pub fn of(avatar: &Avatar, pose: &Pose, eye: DVec3) -> anyhow::Result<Option<TwinLight>> {
        let Some(on_avatar) = &avatar.light else { return Ok(None) };
        let mesh = LitMesh::new(on_avatar, &avatar.model);
        let light = &on_avatar.light;
        let parts = mesh.parts(light, pose)?;
        let mirrored = |of_skin: &Gloss| mesh.gloss(of_skin, light, &parts, eye);
        Ok(Some(TwinLight {
            corners: on_avatar.corners(&mesh),
            barycentric: wide(&on_avatar.barycentric),
            shades: mesh.shades(light, &parts, on_avatar.interreflection),
            gloss: on_avatar.gloss.as_ref().map(mirrored).unwrap_or_default(),
        }))
    }

    /// With every number moved by one unit in its last place.
    pub fn moved(&self, draw: &mut Sampler) -> TwinLight {
        let mut moved = self.clone();
        let all = moved.shades.as_flattened_mut().iter_mut().chain(moved.gloss.as_flattened_mut());
        // Where nothing is mirrored, no gloss is added at all.
        all.filter(|value| **value != 0.0).for_each(|value| *value = move_by_one(*value, draw.chance(0.5)));
        moved
    }

    fn with<T>(&self, see: impl FnOnce(&SurfaceLight<'_>) -> T) -> T {
        let shades = wide(&self.shades);
        let gloss = wide(&self.gloss);
        let corners = &self.corners[..];
        let barycentric = &self.barycentric[..];
        see(&SurfaceLight { corners, barycentric, shades: &shades, gloss: &gloss })
    }

    /// Lights Gaussians.
    pub fn light(&self, unlit: &PosedGaussians) -> PosedGaussians {
        let colors = self.with(|surface| lit(&rows(&unlit.colors), surface));
        PosedGaussians { colors: vectors(&colors, 0, unlit.colors.len()), ..unlit.clone() }
    }

    /// The gradient of unlit Gaussians from that of lit ones.
    pub fn light_vjp(&self, unlit: &PosedGaussians, d: &PosedGaussians) -> PosedGaussians {
        let colors = self.with(|surface| lit_vjp(&rows(&unlit.colors), surface, &rows(&d.colors)));
        PosedGaussians { colors: vectors(&colors, 0, d.colors.len()), ..d.clone() }
    }
}

//! The light on a hand that is drawn: the shades of each frame's mesh, and what it mirrors to the eye.

use std::collections::BTreeMap;

use ghand_core::light::{LitSurface, lit_surface_vjp};
use ghand_core::{HandModel, InvalidHandModel, Pose};
use glam::DVec3;

use super::{AvatarLight, Gloss, Light, LightKind, Parts, gloss};

/// Frames whose parts of the light are kept: half a megabyte each.
const MOST_KEPT: usize = 512;

/// An avatar's light, the mesh on which it falls, and its frames.
pub(crate) struct LitHand {
    lit: AvatarLight,
    model: HandModel,
    corners: Vec<[u32; 3]>,
    /// Of the vertices; empty without gloss.
    strengths: Vec<[f32; 3]>,
    learns: bool,
    frames: Vec<Option<LitFrame>>,
    /// Frames' parts of their light, if something asks for them again.
    parts: BTreeMap<usize, Parts>,
    /// The frame and eye whose gloss the device has.
    mirrored: Option<(usize, DVec3)>,
}

struct LitFrame {
    light: Light,
    pose: Pose,
    /// Whether the device has its shades.
    drawn: bool,
}

/// What the device lacks of a frame: one RGB per vertex each.
#[derive(Default)]
pub(crate) struct Missing {
    pub shades: Option<Vec<[f32; 3]>>,
    pub gloss: Option<Vec<[f32; 3]>>,
}

/// Gradients of an avatar's light.
#[derive(Debug, Clone, PartialEq)]
pub struct LightGradient {
    /// Of [`Light::coefficients`].
    pub coefficients: Vec<[f64; 3]>,
    /// Of the gloss's strengths; empty without gloss.
    pub strengths: Vec<[f64; 3]>,
}

impl LitHand {
    pub fn new(lit: &AvatarLight, model: &HandModel, frames: usize) -> LitHand {
        LitHand {
            lit: lit.clone(),
            model: model.clone(),
            corners: lit.corners(model),
            strengths: lit.gloss.as_ref().map_or(vec![], |gloss| gloss.vertex_strengths(model)),
            learns: false,
            frames: (0..frames).map(|_| None).collect(),
            parts: BTreeMap::new(),
            mirrored: None,
        }
    }

    /// Lets the light be learned, from poses that are set later.
    pub fn learn(&mut self) {
        self.learns = true;
    }

    /// The light and its gloss.
    pub fn lit(&self) -> &AvatarLight {
        &self.lit
    }

    /// Replaces the light for poses that are set later.
    pub fn set_light(&mut self, light: &Light) {
        self.lit.light.clone_from(light);
    }

    /// Replaces light and strengths of the gloss in all frames.
    pub fn set_learned(&mut self, light: &Light, strengths: &[[f32; 3]]) {
        self.lit.light.clone_from(light);
        if let Some(gloss) = &mut self.lit.gloss {
            gloss.strengths = strengths.to_vec();
            self.strengths = gloss.vertex_strengths(&self.model);
        }
        for frame in self.frames.iter_mut().flatten() {
            frame.light.clone_from(light);
            frame.drawn = false;
        }
        self.mirrored = None;
    }

    /// Sets the pose of a frame and returns its shades.
    pub fn set_pose(&mut self, frame: usize, pose: &Pose) -> Result<Vec<[f32; 3]>, InvalidHandModel> {
        let light = self.lit.light.clone();
        let parts = light.parts(&self.model, pose)?;
        let shades = light.shades(&parts);
        if self.lit.gloss.is_some() || self.learns {
            self.keep(frame, parts);
        }
        self.frames[frame] = Some(LitFrame { light, pose: pose.clone(), drawn: true });
        self.mirrored = None;
        Ok(shades)
    }

    fn keep(&mut self, frame: usize, parts: Parts) {
        if self.parts.len() >= MOST_KEPT {
            self.parts.pop_first();
        }
        self.parts.insert(frame, parts);
    }

    /// Makes sure that a frame's parts are kept.
    fn need_parts(&mut self, frame: usize) -> Result<(), InvalidHandModel> {
        if let Some(Some(LitFrame { light, pose, .. })) = self.frames.get(frame)
            && !self.parts.contains_key(&frame)
        {
            let parts = light.parts(&self.model, pose)?;
            self.keep(frame, parts);
        }
        Ok(())
    }

    /// What the device should have and has not for a frame and an eye, which is not finite if there is none: then
    /// nothing is mirrored.
    pub fn missing(&mut self, frame: usize, eye: DVec3) -> Result<Missing, InvalidHandModel> {
        let outdated = self.frames.get(frame).and_then(Option::as_ref).is_some_and(|frame| !frame.drawn);
        // A NaN is never equal: then it is computed each time.
        let mirrors = self.lit.gloss.is_some() && self.mirrored != Some((frame, eye));
        if !outdated && !mirrors {
            return Ok(Missing::default());
        }
        self.need_parts(frame)?;
        self.mirrored = Some((frame, eye));
        let roughness = self.lit.gloss.as_ref().map_or(1.0, |gloss| gloss.roughness);
        let (Some(Some(lit)), Some(parts)) = (self.frames.get_mut(frame), self.parts.get(&frame)) else {
            return Ok(Missing { shades: None, gloss: mirrors.then(|| vec![[0.0; 3]; self.strengths.len()]) });
        };
        lit.drawn = true;
        let mirrored = || {
            let visible = eye.is_finite() && lit.light.kind == LightKind::Transfer;
            let none = || vec![[0.0; 3]; self.strengths.len()];
            let mut values = if visible { gloss::of_vertices(&lit.light, parts, roughness, eye) } else { none() };
            gloss::scale(&mut values, &self.strengths);
            values
        };
        Ok(Missing { shades: outdated.then(|| lit.light.shades(parts)), gloss: mirrors.then(mirrored) })
    }

    /// The gradient of the light from those of the lit colours of a frame that an eye saw; colours are `[3][N]`, unlit.
    pub fn gradient(
        &mut self,
        frame: usize,
        eye: DVec3,
        colors: &[f64],
        d_lit: &[f64],
    ) -> Result<Option<LightGradient>, InvalidHandModel> {
        self.need_parts(frame)?;
        let Some(parts) = self.parts.get(&frame) else { return Ok(None) };
        let light = &self.lit.light;
        let wide = |values: &[[f32; 3]]| values.iter().map(|rgb| rgb.map(f64::from)).collect::<Vec<_>>();
        let of_gloss = |gloss: &Gloss| gloss::of_vertices(light, parts, gloss.roughness, eye);
        let unscaled = self.lit.gloss.as_ref().map(of_gloss).unwrap_or_default();
        let mut mirrored = unscaled.clone();
        gloss::scale(&mut mirrored, &self.strengths);
        let surface = LitSurface {
            corners: &self.corners,
            barycentric: &wide(&self.lit.barycentric),
            shades: &wide(&light.shades(parts)),
            gloss: &wide(&mirrored),
        };
        let d = lit_surface_vjp(colors, &surface, d_lit);
        let mut coefficients = light.shades_vjp(parts, &d.shades);
        let mut strengths = vec![];
        if let Some(gloss) = &self.lit.gloss {
            let of_gloss = gloss::vjp((light, gloss), &self.model, parts, eye, (&unscaled, &self.strengths), &d.gloss);
            for (sum, more) in coefficients.iter_mut().zip(&of_gloss.coefficients) {
                (0..3).for_each(|c| sum[c] += more[c]);
            }
            strengths = of_gloss.strengths;
        }
        Ok(Some(LightGradient { coefficients, strengths }))
    }
}

#[cfg(test)]
mod tests {
    use ghand_core::Side;
    use ghand_core::light::with_gloss;
    use ghand_hand_model::builtin::builtin_hand;
    use ghand_hand_model::surface::sample_surface;

    use super::*;

    #[test]
    fn the_gradient_of_a_light_is_that_of_finite_differences() {
        let model = builtin_hand(Side::Right).unwrap();
        let samples = sample_surface(&model, 24).unwrap();
        let strengths = (0..model.joint_count()).map(|k| [0.2, 0.1 * k as f32, 1.0]).collect();
        let gloss = Some(Gloss { roughness: 0.5, strengths });
        let lit = AvatarLight::new(Light::studio(), gloss, &samples);
        let pose = Pose::rest(model.joint_count());
        let count = samples.faces.len();
        let eye = DVec3::new(0.2, -0.5, 0.3);
        let colors: Vec<f64> = (0..3 * count).map(|i| 0.3 + 0.2 * (i as f64).sin()).collect();
        let d_lit: Vec<f64> = (0..3 * count).map(|i| 0.4 + (0.7 * i as f64).cos()).collect();
        let loss = |lit: &AvatarLight| -> f64 {
            let seen = lit.of_gaussians(&model, &pose, eye).unwrap();
            let of = |i: usize| {
                let (channel, p) = (i / count, i % count);
                let shaded = colors[i] * f64::from(seen.shades[p][channel]);
                d_lit[i] * with_gloss(shaded, f64::from(seen.gloss[p][channel]))
            };
            (0..3 * count).map(of).sum()
        };
        let mut hand = LitHand::new(&lit, &model, 1);
        assert_eq!(hand.gradient(0, eye, &colors, &d_lit).unwrap(), None, "no pose yet");
        hand.learn();
        hand.set_pose(0, &pose).unwrap();
        let gradient = hand.gradient(0, eye, &colors, &d_lit).unwrap().unwrap();
        let check = |what: &str, d: f64, change: &dyn Fn(&mut AvatarLight, f32)| {
            let moved = |by: f32| {
                let mut moved = lit.clone();
                change(&mut moved, by);
                loss(&moved)
            };
            let difference = (moved(0.02) - moved(-0.02)) / 0.04;
            assert!((d - difference).abs() < 0.01 * (1.0 + d.abs()), "{what}: {d}, {difference}");
        };
        for (k, c) in [(0, 0), (5, 1), (17, 2), (40, 0), (63, 1)] {
            if lit.light.coefficients[k][c] > 0.05 {
                let change = |lit: &mut AvatarLight, by: f32| lit.light.coefficients[k][c] += by;
                check("direction", gradient.coefficients[k][c], &change);
            }
            let change = |lit: &mut AvatarLight, by: f32| lit.gloss.as_mut().unwrap().strengths[k % 8 + 1][c] += by;
            check("strength", gradient.strengths[k % 8 + 1][c], &change);
        }
    }

    #[test]
    fn a_learned_light_reaches_frames_whose_pose_is_set_already() {
        let model = builtin_hand(Side::Left).unwrap();
        let samples = sample_surface(&model, 16).unwrap();
        let lit = AvatarLight::new(Light::studio(), None, &samples);
        let mut hand = LitHand::new(&lit, &model, 2);
        hand.learn();
        let pose = Pose::rest(model.joint_count());
        let first = hand.set_pose(0, &pose).unwrap();
        assert!(hand.missing(0, DVec3::NAN).unwrap().shades.is_none());
        let mut brighter = Light::studio();
        brighter.coefficients.iter_mut().flatten().for_each(|c| *c *= 2.0);
        hand.set_learned(&brighter, &[]);
        let shades = hand.missing(0, DVec3::NAN).unwrap().shades.unwrap();
        assert_eq!(shades, brighter.vertex_shades(&model, &pose).unwrap());
        assert!(shades != first && hand.missing(0, DVec3::NAN).unwrap().shades.is_none());
        assert!(hand.missing(1, DVec3::NAN).unwrap().shades.is_none(), "a frame without a pose");
    }
}

//! Training of the light with the avatar: radiances and strengths of the gloss follow their gradients through splatting.
//!
//! Both are learned as logarithms. What started dark stays dark, and directions that started with the same radiance keep
//! it: the sky of "few lamps in an even sky" stays even. The mean over all directions stays 1, as the skin's colours have
//! the brightness.

use ghand_avatar::light::LightGradient;
use ghand_avatar::{AvatarLight, Light, LightKind};
use ghand_render::reference::adam::adam;
use serde::{Deserialize, Serialize};

/// What training has changed in a light.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LightState {
    logarithms: Vec<f64>,
    moments: Vec<[f64; 2]>,
    steps: u64,
}

/// A light that is learned.
pub struct LightTraining {
    light: Light,
    strengths: Vec<[f32; 3]>,
    /// Number of the group of equal radiance of each direction, and how many directions a group has.
    groups: Vec<usize>,
    sizes: Vec<usize>,
    /// Logarithms, RGB: of the groups' radiances, then of the strengths.
    logarithms: Vec<f64>,
    moments: Vec<[f64; 2]>,
    steps: u64,
}

impl LightTraining {
    /// Starts from a light found. `None` for harmonics, which have no radiances.
    pub fn new(lit: &AvatarLight) -> Option<LightTraining> {
        let light = lit.light.clone();
        let mut radiances: Vec<[f32; 3]> = Vec::new();
        let group = |radiance: &[f32; 3]| {
            let known = radiances.iter().position(|other| other == radiance);
            known.unwrap_or_else(|| {
                radiances.push(*radiance);
                radiances.len() - 1
            })
        };
        let groups: Vec<usize> = light.coefficients.iter().map(group).collect();
        let mut sizes = vec![0; radiances.len()];
        groups.iter().for_each(|group| sizes[*group] += 1);
        let strengths = lit.gloss.as_ref().map_or(vec![], |gloss| gloss.strengths.clone());
        let values = radiances.iter().chain(&strengths).flatten();
        let logarithms: Vec<f64> = values.map(|value| f64::from(*value).ln()).collect();
        let moments = vec![[0.0; 2]; logarithms.len()];
        let transfer = light.kind == LightKind::Transfer;
        transfer.then_some(LightTraining { light, strengths, groups, sizes, logarithms, moments, steps: 0 })
    }

    /// The light at present.
    pub fn light(&self) -> &Light {
        &self.light
    }

    /// The strengths of the gloss at present.
    pub fn strengths(&self) -> &[[f32; 3]] {
        &self.strengths
    }

    /// What training has changed.
    pub fn state(&self) -> LightState {
        LightState { logarithms: self.logarithms.clone(), moments: self.moments.clone(), steps: self.steps }
    }

    /// Goes on from a state of the same light. Returns whether it is one.
    pub fn set_state(&mut self, state: &LightState) -> bool {
        let fits = [state.logarithms.len(), state.moments.len()] == [self.logarithms.len(); 2];
        // Before the first step the radiances are those found, of which the logarithms' are rounded.
        if fits && state.steps > 0 {
            self.logarithms.clone_from(&state.logarithms);
            self.moments.clone_from(&state.moments);
            self.steps = state.steps;
            self.set_values();
        }
        fits
    }

    /// Number of steps so far.
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// One Adam step. `rate` is the change of a logarithm.
    pub fn step(&mut self, gradient: &LightGradient, rate: f64) {
        self.steps += 1;
        let derivatives = self.logarithms_vjp(gradient);
        adam(&mut self.logarithms, &mut self.moments, &derivatives, rate, self.steps);
        self.set_values();
    }

    /// The gradient of the logarithms.
    fn logarithms_vjp(&self, gradient: &LightGradient) -> Vec<f64> {
        let directions = self.light.coefficients.len() as f64;
        let mut d = vec![0.0; self.logarithms.len()];
        let mut change_of_mean = [0.0; 3];
        for ((group, radiance), d_radiance) in
            self.groups.iter().zip(&self.light.coefficients).zip(&gradient.coefficients)
        {
            for c in 0..3 {
                let product = d_radiance[c] * f64::from(radiance[c]);
                d[3 * group + c] += product;
                change_of_mean[c] += product / directions;
            }
        }
        for (group, size) in self.sizes.iter().enumerate() {
            let member = self.groups.iter().position(|g| *g == group).unwrap_or_default();
            for c in 0..3 {
                d[3 * group + c] -= *size as f64 * f64::from(self.light.coefficients[member][c]) * change_of_mean[c];
            }
        }
        let first = 3 * self.sizes.len();
        for ((d, strength), d_strength) in
            d[first..].iter_mut().zip(self.strengths.as_flattened()).zip(gradient.strengths.as_flattened())
        {
            *d = d_strength * f64::from(*strength);
        }
        d
    }

    /// Sets radiances and strengths from the logarithms.
    fn set_values(&mut self) {
        let radiance = |group: usize, c: usize| self.logarithms[3 * group + c].exp();
        for c in 0..3 {
            let sum: f64 = self.groups.iter().map(|group| radiance(*group, c)).sum();
            let mean = sum / self.groups.len().max(1) as f64;
            for (group, values) in self.groups.iter().zip(&mut self.light.coefficients) {
                values[c] = (radiance(*group, c) / mean) as f32;
            }
        }
        let strengths = &self.logarithms[3 * self.sizes.len()..];
        self.strengths.as_flattened_mut().iter_mut().zip(strengths).for_each(|(s, log)| *s = log.exp() as f32);
    }
}

#[cfg(test)]
mod tests {
    use ghand_avatar::light::Gloss;

    use super::*;

    /// A lamp in an even sky, with one dark direction.
    fn lit() -> AvatarLight {
        let mut light = Light::studio();
        let count = light.coefficients.len() as f32;
        light.coefficients.fill([0.5, 0.6, 0.7]);
        light.coefficients[7] = [0.0; 3];
        light.coefficients[5] = [0, 1, 2].map(|c| count - light.coefficients[0][c] * (count - 2.0));
        let gloss = Some(Gloss { roughness: 0.5, strengths: vec![[0.3, 0.2, 0.1], [0.0, 1.0, 2.0]] });
        AvatarLight { light, faces: vec![], barycentric: vec![], gloss }
    }

    /// A loss with a known gradient: squared differences from another light.
    fn loss(training: &LightTraining, wanted: &AvatarLight) -> (f64, LightGradient) {
        let difference = |a: &[f32; 3], b: &[f32; 3]| [0, 1, 2].map(|c| f64::from(a[c]) - f64::from(b[c]));
        let pairs = |a: &[[f32; 3]], b: &[[f32; 3]]| a.iter().zip(b).map(|(a, b)| difference(a, b)).collect::<Vec<_>>();
        let coefficients = pairs(&training.light.coefficients, &wanted.light.coefficients);
        let strengths = pairs(&training.strengths, &wanted.gloss.as_ref().unwrap().strengths);
        let all = coefficients.as_flattened().iter().chain(strengths.as_flattened());
        (all.map(|d| 0.5 * d * d).sum(), LightGradient { coefficients, strengths })
    }

    #[test]
    fn the_gradient_of_the_logarithms_is_that_of_finite_differences() {
        let start = LightTraining::new(&lit()).unwrap();
        let mut wanted = lit();
        wanted.light.coefficients.iter_mut().enumerate().for_each(|(k, c)| c[k % 3] += 0.01 * k as f32);
        wanted.gloss.as_mut().unwrap().strengths[0] = [0.5; 3];
        let d = start.logarithms_vjp(&loss(&start, &wanted).1);
        for (i, d) in d.into_iter().enumerate() {
            let moved = |by: f64| {
                let mut moved = LightTraining::new(&lit()).unwrap();
                moved.logarithms[i] += by;
                moved.set_values();
                loss(&moved, &wanted).0
            };
            let difference = (moved(2e-3) - moved(-2e-3)) / 4e-3;
            assert!((d - difference).abs() < 2e-3 * (1.0 + d.abs()), "{i}: {d}, {difference}");
        }
    }

    #[test]
    fn a_light_reaches_another_and_keeps_its_mean_its_dark_and_its_even_sky() {
        let mut training = LightTraining::new(&lit()).unwrap();
        let mut wanted = lit();
        wanted.light.coefficients.iter_mut().for_each(|c| c[0] *= 0.5);
        wanted.light.coefficients[5][0] = 64.0 - wanted.light.coefficients[0][0] * 62.0;
        wanted.gloss.as_mut().unwrap().strengths[0] = [0.6, 0.4, 0.2];
        let before = loss(&training, &wanted).0;
        for step in 0..400 {
            training.step(&loss(&training, &wanted).1, 0.02 * 0.98f64.powi(step));
        }
        assert!(loss(&training, &wanted).0 < 1e-3 * before, "{before}, {}", loss(&training, &wanted).0);
        let light = &training.light.coefficients;
        for c in 0..3 {
            let mean = light.iter().map(|l| l[c]).sum::<f32>() / light.len() as f32;
            assert!((mean - 1.0).abs() < 1e-4, "{mean}");
        }
        assert_eq!(light[7], [0.0; 3]);
        assert!(light.iter().enumerate().all(|(k, l)| k == 5 || k == 7 || *l == light[0]));
        assert_eq!(training.strengths[1][0], 0.0);
    }

    #[test]
    fn harmonics_are_not_learned() {
        let mut lit = lit();
        lit.light = Light { kind: LightKind::Sh, coefficients: vec![[1.0; 3]; 9], ..lit.light };
        assert!(LightTraining::new(&lit).is_none());
    }
}

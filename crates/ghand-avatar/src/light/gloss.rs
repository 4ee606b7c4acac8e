//! What a hand's skin mirrors of its light: it depends on the eye.

use ghand_core::HandModel;
use ghand_core::light::mirrored;
use glam::DVec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::{IrradianceParts, Light};

/// The gloss of a hand's skin.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Gloss {
    /// Roughness of the surface, above 0 and at most 1.
    pub roughness: f64,
    /// How strong gloss is on the skin of each joint, `n_b`, as a factor on that of smooth skin with an albedo of 1 where
    /// the light has a mean radiance of 1; RGB, at least 0.
    pub strengths: Vec<[f32; 3]>,
}

impl Gloss {
    /// How strong it is at each vertex.
    pub fn vertex_strengths(&self, model: &HandModel) -> Vec<[f32; 3]> {
        let strength = |vertex: usize| {
            let joints = model.vertex_weights(vertex).iter().zip(&self.strengths);
            joints.fold([0.0; 3], |sum, (weight, strength)| [0, 1, 2].map(|c| sum[c] + *weight as f32 * strength[c]))
        };
        (0..model.vertices.len()).map(strength).collect()
    }
}

/// What vertices with these strengths mirror, from what they would with a strength of 1.
pub fn scale(values: &mut [[f32; 3]], strengths: &[[f32; 3]]) {
    for (value, strength) in values.iter_mut().zip(strengths) {
        value.iter_mut().zip(strength).for_each(|(value, strength)| *value *= strength);
    }
}

/// What each vertex of a posed hand mirrors towards an eye (metres, world axes) if its gloss is 1: linear RGB. `parts` are
/// those of the pose in the light, which has directions; sources without a column do not count.
pub fn of_vertices(light: &Light, parts: &IrradianceParts, roughness: f64, eye: DVec3) -> Vec<[f32; 3]> {
    let directions = light.directions();
    // Direction by direction in the order of memory; what is dark costs nothing.
    let counts = |(k, radiance): &(usize, [f32; 3])| *radiance != [0.0; 3] && !parts.columns[*k].is_empty();
    let bright: Vec<(usize, [f32; 3])> = light.radiances().enumerate().filter(counts).collect();
    let vertex = |(v, (vertex, normal)): (usize, (&DVec3, &DVec3))| {
        let towards_eye = (eye - *vertex).normalize_or_zero();
        let mut sum = [0.0; 3];
        for (k, radiance) in &bright {
            let part = f64::from(parts.columns[*k][v]);
            if part > 0.0 {
                let lamp = || (parts.lamps[*k - directions.len()] - *vertex).normalize_or_zero();
                let towards = directions.get(*k).copied().unwrap_or_else(lamp);
                let seen = part * mirrored(*normal, towards, towards_eye, roughness);
                sum.iter_mut().zip(radiance).for_each(|(s, radiance)| *s += seen * f64::from(*radiance));
            }
        }
        sum.map(|value| value as f32)
    };
    parts.vertices.par_iter().zip(&parts.normals).enumerate().map(vertex).collect()
}

#[cfg(test)]
mod tests {
    use ghand_core::{Pose, Side};
    use ghand_hand_model::builtin::builtin_hand;

    use super::*;

    #[test]
    fn a_hand_mirrors_a_lamp_to_an_eye_on_the_other_side() {
        let model = builtin_hand(Side::Right).unwrap();
        let mut light = Light::studio();
        light.coefficients.fill([0.0; 3]);
        // From where the back of the hand looks, and seen from there.
        let pose = Pose::rest(model.joint_count());
        let dark = IrradianceParts::new(light.kind, light.turn, &model, &pose).unwrap();
        let directions = light.directions();
        let toward = |d: DVec3| (0..64).max_by(|a, b| directions[*a].dot(d).total_cmp(&directions[*b].dot(d))).unwrap();
        let middle: DVec3 = dark.vertices.iter().sum::<DVec3>() / dark.vertices.len() as f64;
        let mean = |light: &Light, eye: DVec3| {
            let gloss = of_vertices(light, &dark, 0.5, eye);
            gloss.iter().map(|g| f64::from(g[1])).sum::<f64>() / gloss.len() as f64
        };
        assert_eq!(mean(&light, middle + DVec3::X), 0.0);
        let lamp = DVec3::new(0.6, -0.8, 0.0);
        let eye = DVec3::new(0.6, 0.8, 0.0);
        light.coefficients[toward(lamp)] = [64.0; 3];
        let opposite = mean(&light, middle + eye);
        let aside = mean(&light, middle - eye);
        assert!(opposite > 2.0 * aside && opposite > 0.0, "{opposite} {aside}");
    }

    #[test]
    fn the_strength_of_a_vertex_is_that_of_its_joints() {
        let model = builtin_hand(Side::Left).unwrap();
        let strengths = (0..model.joint_count()).map(|k| [k as f32, 1.0, 0.0]).collect();
        let gloss = Gloss { roughness: 0.5, strengths }.vertex_strengths(&model);
        for (v, strength) in gloss.iter().enumerate() {
            let expected: f64 = model.vertex_weights(v).iter().enumerate().map(|(k, w)| k as f64 * w).sum();
            assert!((f64::from(strength[0]) - expected).abs() < 1e-4 && (strength[1] - 1.0).abs() < 1e-5);
        }
    }
}

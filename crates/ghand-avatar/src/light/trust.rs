//! How far the light of a capture may be trusted.
//!
//! Images determine how much light falls on the normals that they show. What falls on others, such as on a palm in a
//! capture of the back of a hand, is a guess. There the light falls back to the mean over what the images show,
//! smoothly: skin there is as bright as skin in the images is on average.

use ghand_core::light::{DIRECTION_COUNT, directions};
use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::{IrradianceParts, Light, LightKind};

/// Power of the cosine with which a direction's value counts at a normal: half at 12 degrees, the distance of the nearest
/// direction from a normal between them.
const SHARPNESS: i32 = 32;

/// How far a light may be trusted, by the normal on which it falls.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Trust(Vec<[f32; 2]>);

impl Trust {
    /// From two values at normals along each of `ghand_core::light::directions`, in the light's own axes: the trust, 1 where
    /// the light is known and 0 where nothing is known of it, and how often images show such a normal, in any unit. `None`
    /// unless there are two for each, the trust is 0 to 1, and images show anything.
    pub fn new(values: Vec<[f32; 2]>) -> Option<Trust> {
        let valid = |[trust, shown]: &[f32; 2]| (0.0..=1.0).contains(trust) && (0.0..f32::MAX).contains(shown);
        let whole: f64 = values.iter().map(|[_, shown]| f64::from(*shown)).sum();
        (values.len() == DIRECTION_COUNT && values.iter().all(valid) && whole > 0.0).then_some(Trust(values))
    }

    /// The two values at normals along each of the directions.
    pub fn values(&self) -> &[[f32; 2]] {
        &self.0
    }

    /// The mean trust over all normals.
    pub fn mean(&self) -> f64 {
        self.0.iter().map(|[trust, _]| f64::from(*trust)).sum::<f64>() / self.0.len().max(1) as f64
    }

    /// The trust at a normal, in the light's own axes.
    fn at(&self, normal: DVec3, towards: &[DVec3; DIRECTION_COUNT]) -> f64 {
        let weights = towards.iter().map(|d| normal.dot(*d).max(0.0).powi(SHARPNESS));
        let (sum, whole) = weights
            .zip(&self.0)
            .fold((0.0, 0.0), |(sum, whole), (weight, [trust, _])| (sum + weight * f64::from(*trust), whole + weight));
        sum / whole
    }

    /// What each coefficient and lamp of a light gives the normals that images show, on average, where nothing is in its
    /// way.
    fn mean_parts(&self, light: &Light, towards: &[DVec3; DIRECTION_COUNT]) -> Vec<f64> {
        let whole: f64 = self.0.iter().map(|[_, shown]| f64::from(*shown)).sum();
        let mut mean = vec![];
        for (normal, [_, shown]) in towards.iter().zip(&self.0) {
            let parts = light.open_parts(*normal);
            mean.resize(parts.len(), 0.0);
            mean.iter_mut().zip(parts).for_each(|(sum, part)| *sum += f64::from(*shown) * part / whole);
        }
        mean
    }

    /// Replaces the parts of a light by those of its mean where it is not trusted. What is in the way of even light shades
    /// the mean.
    pub(super) fn blend(&self, light: &Light, parts: &mut IrradianceParts) {
        let towards = directions();
        let mean = self.mean_parts(light, &towards);
        for (v, normal) in parts.normals.iter().enumerate() {
            let trust = self.at(light.turn.inverse() * *normal, &towards);
            if trust < 1.0 {
                let open = match light.kind {
                    LightKind::Transfer => {
                        parts.columns[..DIRECTION_COUNT].iter().map(|column| f64::from(column[v])).sum()
                    }
                    LightKind::Sh => 1.0,
                };
                parts.trust[v] = trust as f32;
                for (column, mean) in parts.columns.iter_mut().zip(&mean) {
                    column[v] = (trust * f64::from(column[v]) + (1.0 - trust) * open * mean) as f32;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use ghand_core::Side;
    use ghand_core::light::shade;
    use ghand_core::{HandModel, Pose};
    use ghand_hand_model::builtin::builtin_hand;

    use glam::DQuat;

    use super::*;

    /// Known on one side; the border is smooth.
    fn half(axis: DVec3) -> Trust {
        let value = |d: DVec3| [(0.5 + 2.0 * d.dot(axis)).clamp(0.0, 1.0) as f32; 2];
        Trust::new(directions().map(value).to_vec()).unwrap()
    }

    fn shades(light: &Light, model: &HandModel, pose: &Pose) -> Vec<[f32; 3]> {
        light.shades(&light.parts(model, pose).unwrap(), [0.0; 3])
    }

    fn hand() -> (HandModel, Pose) {
        let model = builtin_hand(Side::Right).unwrap().without_blend_shapes();
        let pose = Pose::rest(model.joint_count());
        (model, pose)
    }

    #[test]
    fn values_that_are_no_trust_are_refused() {
        let with = |value: [f32; 2]| {
            let mut values = vec![[0.5; 2]; DIRECTION_COUNT];
            values[3] = value;
            Trust::new(values)
        };
        assert!(with([0.0, 0.0]).is_some() && with([1.0, 1e6]).is_some());
        for bad in [[-0.1, 1.0], [1.1, 1.0], [f32::NAN, 1.0], [0.5, -1.0], [0.5, f32::NAN], [0.5, f32::INFINITY]] {
            assert_eq!(with(bad), None, "{bad:?}");
        }
        assert_eq!(Trust::new(vec![[1.0; 2]; 9]), None);
        assert_eq!(Trust::new(vec![[1.0, 0.0]; DIRECTION_COUNT]), None, "images show nothing");
    }

    #[test]
    fn trust_changes_smoothly_between_normals() {
        let trust = half(DVec3::Z);
        let towards = directions();
        let at = |degrees: f64| trust.at(DQuat::from_rotation_x(degrees.to_radians()) * DVec3::Z, &towards);
        assert!(at(0.0) > 0.999 && at(180.0) < 0.001, "{} {}", at(0.0), at(180.0));
        for degrees in 0..180 {
            let change = at(f64::from(degrees)) - at(f64::from(degrees + 1));
            assert!(change.abs() < 0.06, "{degrees}: {change}");
        }
        let full = Trust::new(vec![[1.0; 2]; DIRECTION_COUNT]).unwrap();
        assert!((full.at(DVec3::new(0.6, 0.0, -0.8), &towards) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn full_trust_changes_nothing_and_none_leaves_the_mean() {
        let (model, pose) = hand();
        let sh = (0..9).map(|k| [1.0 - 0.1 * k as f32; 3]).collect();
        let sh = Light {
            kind: LightKind::Sh,
            turn: DQuat::from_rotation_y(0.4),
            coefficients: sh,
            lamps: None,
            trust: None,
        };
        for plain in [Light::studio(), sh] {
            let lit = shades(&plain, &model, &pose);
            let with = |value: f32| {
                let trust = Trust::new(vec![[value, 1.0]; DIRECTION_COUNT]);
                shades(&Light { trust, ..plain.clone() }, &model, &pose)
            };
            for (full, plain) in with(1.0).as_flattened().iter().zip(lit.as_flattened()) {
                assert!((full - plain).abs() < 1e-5, "{full} instead of {plain}");
            }
            let [none, half] = [with(0.0), with(0.5)].map(|shades| shades.concat());
            if plain.kind == LightKind::Sh {
                assert!(none.iter().all(|value| (value - none[0]).abs() < 1e-5), "no normal is brighter than another");
            }
            let strongest = |values: &[f32]| values.iter().copied().fold(0.0, f32::max);
            let all = lit.concat();
            assert!(strongest(&none) < strongest(&half) && strongest(&half) < strongest(&all), "{:?}", plain.kind);
        }
    }

    #[test]
    fn the_unknown_side_of_a_lamp_has_the_mean_of_the_known_one() {
        let (model, pose) = hand();
        for axis in [DVec3::Z, DVec3::X, DVec3::NEG_X] {
            let turn = DQuat::from_rotation_arc(DVec3::Z, axis);
            let coefficients = directions().map(|d| if d.z > 0.9 { [20.0; 3] } else { [0.0; 3] }).to_vec();
            let plain = Light { kind: LightKind::Transfer, turn, coefficients, lamps: None, trust: None };
            let trusted = Light { trust: Some(half(DVec3::Z)), ..plain.clone() };
            let parts = trusted.parts(&model, &pose).unwrap();
            let shaded = trusted.shades(&parts, [0.0; 3]);
            let dark = shades(&plain, &model, &pose);
            // A lamp of two or three directions: the mean over the half that it faces is about half of its strength.
            let lamps = plain.coefficients.iter().filter(|c| c[0] > 0.0).count() as f64;
            let mean = 20.0 * lamps * 4.0 / DIRECTION_COUNT as f64 * 0.5;
            let away = (0..shaded.len()).filter(|v| parts.normals[*v].dot(axis) < -0.6);
            let (lit, unlit): (Vec<f32>, Vec<f32>) = away.map(|v| (shaded[v][0], dark[v][0])).unzip();
            assert!(lit.len() > 20, "{}", lit.len());
            assert!(unlit.iter().all(|value| f64::from(*value) < 1.01 * shade(0.0)), "without trust it is black");
            let brightest = f64::from(lit.iter().copied().fold(0.0, f32::max));
            assert!((0.8..1.2).contains(&(brightest / shade(mean))), "{brightest} for {}", shade(mean));
        }
    }
}

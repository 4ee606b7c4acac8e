//! Where a light may be trusted: at and near the normals that images show.
//!
//! Irradiance varies slowly over normals. Under independent radiances of all directions, the correlation of the irradiances
//! of two normals at an angle a is `(sin a + (pi - a) cos a) / pi`, that of two clamped cosines (Cho and Saul 2009). With it,
//! how much of the variance of a normal's irradiance is known from the normals observed is that of a Gaussian process.

use std::f64::consts::PI;

use ghand_avatar::Light;
use ghand_avatar::light::Trust;
use ghand_core::light::{DIRECTION_COUNT, directions};
use ghand_core::posing::pose_hand;
use ghand_core::{HandModel, InvalidHandModel, Pose};
use glam::{DQuat, DVec3};
use nalgebra::{Cholesky, DMatrix, DVector};
use rayon::prelude::*;

use super::observations::Observations;

/// Noise of what images tell about a normal's irradiance, as a part of the variance of light: a template's normals are off
/// by some 18 degrees where it lacks creases and knuckles, over which the correlation above explains nine tenths.
const NOISE: f64 = 0.1;
/// Observations of a normal count half if they are this part of what it had if all normals were shown alike.
const FEW: f64 = 0.05;
/// The part of the variance up to which nothing is trusted, and from which all is: what noise leaves of it.
const KNOWN: [f64; 2] = [0.5, 1.0 - NOISE];
/// What a limit may be missed by: the rounding of an irradiance.
const ROUNDING: f64 = 1e-6;
/// The part of observations that is darker, brighter or more coloured than what counts as observed: shadows and normals
/// that the template has wrong.
const EXTREME: f64 = 0.01;

/// The normals that images show.
pub(super) struct Coverage {
    /// Texels in frames whose normals are closest to each of the light's directions.
    counts: [u64; DIRECTION_COUNT],
}

impl Coverage {
    /// Of the observations of a hand in the frames' poses, in the axes of a light.
    pub fn new(
        seen: &Observations,
        model: &HandModel,
        poses: &[Pose],
        turn: DQuat,
    ) -> Result<Coverage, InvalidHandModel> {
        let towards = directions();
        let count = |(f, frame): (usize, &usize)| -> Result<[u64; DIRECTION_COUNT], InvalidHandModel> {
            let vertices = pose_hand(model, &[], &poses[*frame])?.vertices;
            let normals = model.vertex_normals(&vertices);
            let mut counts = [0; DIRECTION_COUNT];
            for t in seen.shown(f) {
                let corners = model.faces[seen.samples.faces[t] as usize].iter().zip(seen.samples.barycentric[t]);
                let normal: DVec3 = corners.map(|(vertex, weight)| normals[*vertex as usize] * weight).sum();
                counts[nearest(turn.inverse() * normal, &towards)] += 1;
            }
            Ok(counts)
        };
        let frames: Vec<_> = seen.frames.par_iter().enumerate().map(count).collect::<Result<_, _>>()?;
        Ok(Coverage { counts: std::array::from_fn(|k| frames.iter().map(|counts| counts[k]).sum()) })
    }

    /// The part of the variance of the irradiance that is known, at a normal along each of the directions.
    fn known(&self) -> [f64; DIRECTION_COUNT] {
        let towards = directions();
        let shown: Vec<usize> = (0..DIRECTION_COUNT).filter(|k| self.counts[*k] > 0).collect();
        let even = self.counts.iter().sum::<u64>() as f64 / DIRECTION_COUNT as f64;
        let mut covariance =
            DMatrix::from_fn(shown.len(), shown.len(), |i, j| correlation(towards[shown[i]].dot(towards[shown[j]])));
        for (i, k) in shown.iter().enumerate() {
            covariance[(i, i)] += NOISE * (1.0 + FEW * even / self.counts[*k] as f64);
        }
        let Some(factor) = Cholesky::new(covariance) else { return [0.0; DIRECTION_COUNT] };
        towards.map(|normal| {
            let with_shown =
                DVector::from_iterator(shown.len(), shown.iter().map(|k| correlation(normal.dot(towards[*k]))));
            factor.solve(&with_shown).dot(&with_shown)
        })
    }

    /// How far a light may be trusted; `None` if everywhere. `observed` are the irradiances of what images show, RGB: beyond
    /// the normals that they show, nothing is trusted that is darker, brighter or more coloured.
    pub fn trust(&self, light: &Light, observed: &[[f64; 3]]) -> Option<Trust> {
        let known = self.known().map(|known| smoothstep((known - KNOWN[0]) / (KNOWN[1] - KNOWN[0])));
        let irradiances = directions().map(|normal| light.open_irradiance(normal));
        let whole = self.counts.iter().sum::<u64>() as f64;
        let of_channel =
            |c: usize| self.counts.iter().zip(&irradiances).map(|(n, e)| *n as f64 * e[c]).sum::<f64>() / whole;
        let mean = [0, 1, 2].map(of_channel);
        let limits = limits(observed);
        let trusted = known.iter().zip(&irradiances).zip(&self.counts).map(|((known, irradiance), count)| {
            let is_shown = *known == 1.0 && *count as f64 >= FEW * whole / DIRECTION_COUNT as f64;
            let within = |limit: &Limit| limit.largest_part(irradiance, &mean);
            if is_shown { 1.0 } else { limits.iter().map(within).fold(*known, f64::min) }
        });
        let values: Vec<[f32; 2]> =
            trusted.zip(&self.counts).map(|(t, n)| [t as f32, (*n as f64 / whole) as f32]).collect();
        if values.iter().all(|[trust, _]| *trust == 1.0) { None } else { Trust::new(values) }
    }
}

/// The correlation of the irradiances of normals at an angle with this cosine.
fn correlation(cosine: f64) -> f64 {
    let angle = cosine.clamp(-1.0, 1.0).acos();
    (angle.sin() + (PI - angle) * angle.cos()) / PI
}

fn nearest(normal: DVec3, towards: &[DVec3; DIRECTION_COUNT]) -> usize {
    let closeness = |k: &usize| normal.dot(towards[*k]);
    (0..DIRECTION_COUNT).max_by(|a, b| closeness(a).total_cmp(&closeness(b))).unwrap_or(0)
}

fn smoothstep(x: f64) -> f64 {
    let x = x.clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}

/// A limit of what is observed: a linear function of irradiance, RGB, and a constant that are positive together.
struct Limit {
    factors: [f64; 3],
    constant: f64,
}

impl Limit {
    fn value(&self, irradiance: &[f64; 3]) -> f64 {
        self.constant + self.factors.iter().zip(irradiance).map(|(factor, e)| factor * e).sum::<f64>()
    }

    /// The largest part of an irradiance in a mix with a mean that is within the limit.
    fn largest_part(&self, irradiance: &[f64; 3], mean: &[f64; 3]) -> f64 {
        let [there, at_mean] = [irradiance, mean].map(|e| self.value(e));
        // A mean that is beyond the limit itself, no mix of it can meet.
        if there < -ROUNDING && at_mean > 0.0 { at_mean / (at_mean - there) } else { 1.0 }
    }
}

/// The limits of all but the extreme ones of some irradiances: of each channel, and of its part of the sum.
fn limits(observed: &[[f64; 3]]) -> Vec<Limit> {
    let mut limits = vec![];
    for channel in 0..3 {
        let unit = [0, 1, 2].map(|c| f64::from(u8::from(c == channel)));
        if let Some([low, high]) = usual(observed.iter().map(|e| e[channel]).collect()) {
            limits.push(Limit { factors: unit, constant: -low });
            limits.push(Limit { factors: unit.map(|u| -u), constant: high });
        }
        let part = |e: &[f64; 3]| e[channel] / e.iter().sum::<f64>();
        if let Some([low, high]) = usual(observed.iter().filter(|e| e.iter().all(|v| *v > 0.0)).map(part).collect()) {
            limits.push(Limit { factors: unit.map(|u| u - low), constant: 0.0 });
            limits.push(Limit { factors: unit.map(|u| high - u), constant: 0.0 });
        }
    }
    limits
}

/// The smallest and the largest of some values but for the extreme ones; `None` without values.
fn usual(mut values: Vec<f64>) -> Option<[f64; 2]> {
    values.sort_by(f64::total_cmp);
    let cut = (EXTREME * values.len() as f64) as usize;
    Some([*values.get(cut)?, *values.get((values.len() - 1).checked_sub(cut)?)?])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Normals up to an angle around an axis are shown, each as often.
    fn cap(axis: DVec3, degrees: f64) -> Coverage {
        let counts = directions().map(|d| if d.angle_between(axis) <= degrees.to_radians() { 500 } else { 0 });
        Coverage { counts }
    }

    /// A side light in a dim sky, and what the normals shown see of it.
    fn side_light(coverage: &Coverage) -> (Light, Vec<[f64; 3]>) {
        let coefficients = directions().map(|d| if d.x > 0.8 { [9.0, 8.0, 6.0] } else { [0.1, 0.1, 0.12] }).to_vec();
        let light = Light { coefficients, ..Light::studio() };
        let shown = directions().into_iter().zip(coverage.counts).filter(|(_, count)| *count > 0);
        let observed = shown.map(|(normal, _)| light.open_irradiance(normal)).collect();
        (light, observed)
    }

    #[test]
    fn trust_is_full_where_normals_are_shown_and_falls_to_nothing_behind() {
        let axis = DVec3::new(0.5, -0.3, 0.8).normalize();
        let coverage = cap(axis, 75.0);
        let even = Light { coefficients: vec![[1.0; 3]; DIRECTION_COUNT], ..Light::studio() };
        let trust = coverage.trust(&even, &[[0.9; 3], [1.1; 3]]).unwrap();
        for (direction, [trust, _]) in directions().into_iter().zip(trust.values()) {
            let angle = direction.angle_between(axis).to_degrees();
            match angle {
                ..75.0 => assert!(*trust > 0.95, "{angle}: {trust}"),
                90.0..105.0 => assert!((0.1..1.0).contains(trust), "{angle}: {trust}"),
                135.0.. => assert_eq!(*trust, 0.0, "{angle}"),
                _ => {}
            }
        }
        assert!(trust.values().iter().filter(|[trust, _]| *trust == 1.0).count() > DIRECTION_COUNT / 4);
    }

    #[test]
    fn a_hand_that_was_seen_from_all_sides_is_trusted_everywhere() {
        let coverage = cap(DVec3::Z, 180.0);
        let (light, observed) = side_light(&coverage);
        assert_eq!(coverage.trust(&light, &observed), None);
        assert_eq!(cap(DVec3::Z, -1.0).trust(&light, &[]), None, "without images there is no mean");
    }

    #[test]
    fn a_glimpse_of_a_side_tells_less_than_a_look_at_it() {
        let mut coverage = cap(DVec3::Z, 60.0);
        let behind = nearest(DVec3::NEG_Z, &directions());
        let known = |coverage: &Coverage| coverage.known()[behind];
        let [never, glimpse, look] = [0, 1, 500].map(|count| {
            coverage.counts[behind] = count;
            known(&coverage)
        });
        assert!(never < 0.2 && glimpse < 0.7 && look > 0.8, "{never} {glimpse} {look}");
    }

    #[test]
    fn no_normal_is_darker_brighter_or_more_coloured_than_those_shown() {
        for axis in [DVec3::new(0.7, 0.0, 0.7), DVec3::X, DVec3::new(0.0, 0.8, 0.6)] {
            let coverage = cap(axis, 60.0);
            let (light, observed) = side_light(&coverage);
            let trust = coverage.trust(&light, &observed).unwrap();
            let all = directions().map(|normal| light.open_irradiance(normal));
            let mean = [0, 1, 2].map(|c| {
                let shown = trust.values().iter().zip(&all).map(|([_, shown], e)| f64::from(*shown) * e[c]);
                shown.sum::<f64>()
            });
            let range = |of: &dyn Fn(&[f64; 3]) -> f64| {
                let values = || observed.iter().map(of);
                [values().fold(f64::INFINITY, f64::min), values().fold(0.0, f64::max)]
            };
            let green = |e: &[f64; 3]| e[1];
            let blue_part = |e: &[f64; 3]| e[2] / e.iter().sum::<f64>();
            let mut beyond = 0;
            for ([trust, _], e) in trust.values().iter().zip(&all) {
                let trust = f64::from(*trust);
                let mixed = [0, 1, 2].map(|c| trust * e[c] + (1.0 - trust) * mean[c]);
                for of in [&green as &dyn Fn(&[f64; 3]) -> f64, &blue_part] {
                    let [low, high] = range(of);
                    assert!((0.97 * low..1.03 * high).contains(&of(&mixed)), "{axis}: {mixed:?}");
                    beyond += usize::from(!(low..=high).contains(&of(e)));
                }
            }
            assert!(beyond > 10, "without trust, many are");
        }
    }
}

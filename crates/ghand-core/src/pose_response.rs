//! The pose dependence of the `direct` property model: local, linear and limited.
//!
//! A channel i (a blend coefficient or a colour component) of Gaussian p has the value
//! `y_i^p = bias_i + sum_k W_k^p clamp(gain_{i,k} . vec(R_k - I), lo_{i,k}, hi_{i,k})`: only the joints that move a
//! Gaussian affect it. Joint 0, the root, turns the whole hand and has no effect: its features are 0.

use glam::DMat3;

use crate::Pose;
use crate::rotation::rotation_from_axis_angle;

/// `vec(R - I)`, row by row.
pub fn rotation_features(rotation: &DMat3) -> [f64; 9] {
    let r = (*rotation - DMat3::IDENTITY).transpose().to_cols_array();
    std::array::from_fn(|i| r[i])
}

/// dL/dR from dL/d(vec(R - I)).
fn rotation_features_vjp(d_features: &[f64; 9]) -> DMat3 {
    DMat3::from_cols_array(d_features).transpose()
}

/// The features that a response depends on, from the joints' local rotations: `vec(R_k - I)`, and 0 for the root.
pub fn response_features(local: &[DMat3]) -> Vec<[f64; 9]> {
    let one = |(k, rotation): (usize, &DMat3)| if k == 0 { [0.0; 9] } else { rotation_features(rotation) };
    local.iter().enumerate().map(one).collect()
}

/// dL/dR_k from the gradient of [`response_features`]; 0 for the root.
pub fn response_features_vjp(d_features: &[[f64; 9]]) -> Vec<DMat3> {
    let one = |(k, d): (usize, &[f64; 9])| if k == 0 { DMat3::ZERO } else { rotation_features_vjp(d) };
    d_features.iter().enumerate().map(one).collect()
}

/// The features of a pose.
pub fn pose_features(pose: &Pose) -> Vec<[f64; 9]> {
    let local: Vec<DMat3> = pose.rotations.iter().map(|v| rotation_from_axis_angle(*v)).collect();
    response_features(&local)
}

/// The learned parameters of a pose response with `bias.len()` channels.
#[derive(Debug, Clone, PartialEq)]
pub struct PoseResponse {
    /// Value at rest, one per channel.
    pub bias: Vec<f64>,
    /// Gains `[channels][n_b][9]`.
    pub gain: Vec<f64>,
    /// Smallest and largest term of each joint in each channel, `[channels][n_b]`; infinite if there is no limit.
    pub limits: Vec<[f64; 2]>,
}

/// The limits of an unlimited term.
pub const UNLIMITED: [f64; 2] = [f64::NEG_INFINITY, f64::INFINITY];

impl PoseResponse {
    /// The term of each joint in each channel before the limits, `[channels][n_b]`, for the joints' features.
    pub fn unlimited_terms(&self, features: &[[f64; 9]]) -> Vec<f64> {
        let gain = self.gain.chunks_exact(9).enumerate();
        gain.map(|(i, row)| row.iter().zip(&features[i % features.len()]).map(|(a, f)| a * f).sum()).collect()
    }

    /// The term of each joint in each channel, `[channels][n_b]`, for the joints' features. NaN stays NaN.
    pub fn joint_terms(&self, features: &[[f64; 9]]) -> Vec<f64> {
        let limited = |(term, [low, high]): (f64, &[f64; 2])| {
            if term < *low {
                *low
            } else if term > *high {
                *high
            } else {
                term
            }
        };
        self.unlimited_terms(features).into_iter().zip(&self.limits).map(limited).collect()
    }

    /// Limits `[channels][n_b]` that keep each term within its range over `poses` (the features of each), extended by
    /// `margin` times the width of that range at either end. Without poses there are no limits.
    ///
    /// The range need not include 0, the term at rest: a joint that was never seen straight is drawn as if at its
    /// smallest bend.
    pub fn limits_over(&self, poses: &[Vec<[f64; 9]>], margin: f64) -> Vec<[f64; 2]> {
        if poses.is_empty() {
            return vec![UNLIMITED; self.gain.len() / 9];
        }
        let mut ranges = vec![[f64::INFINITY, f64::NEG_INFINITY]; self.gain.len() / 9];
        for features in poses {
            for ([low, high], term) in ranges.iter_mut().zip(self.unlimited_terms(features)) {
                *low = low.min(term);
                *high = high.max(term);
            }
        }
        let widened = |[low, high]: [f64; 2]| [low - margin * (high - low), high + margin * (high - low)];
        ranges.into_iter().map(widened).collect()
    }

    /// Channel values `[channels][N]` for skinning weights `[n_b][N]`.
    pub fn evaluate(&self, weights: &[f64], features: &[[f64; 9]], count: usize) -> Vec<f64> {
        let joints = features.len();
        let terms = self.joint_terms(features);
        let mut values = Vec::with_capacity(self.bias.len() * count);
        for (i, bias) in self.bias.iter().enumerate() {
            for p in 0..count {
                let moved: f64 = (0..joints).map(|k| weights[k * count + p] * terms[i * joints + k]).sum();
                values.push(bias + moved);
            }
        }
        values
    }

    /// Gradients of bias and gain and of the features, from dL/d(values) `[channels][N]`. A term at or beyond a limit
    /// has no gradient. Limits are not learned; those of the gradient are empty.
    pub fn evaluate_vjp(
        &self,
        weights: &[f64],
        features: &[[f64; 9]],
        d_values: &[f64],
        count: usize,
    ) -> (PoseResponse, Vec<[f64; 9]>) {
        let joints = features.len();
        let terms = self.unlimited_terms(features);
        let mut d_features = vec![[0.0; 9]; joints];
        let mut d = PoseResponse { bias: vec![0.0; self.bias.len()], gain: vec![0.0; self.gain.len()], limits: vec![] };
        for i in 0..self.bias.len() {
            let d_value = &d_values[i * count..(i + 1) * count];
            d.bias[i] = d_value.iter().sum();
            for k in 0..joints {
                let [low, high] = self.limits[i * joints + k];
                let term = terms[i * joints + k];
                if term <= low || term >= high {
                    continue;
                }
                let row = &weights[k * count..(k + 1) * count];
                let d_term: f64 = row.iter().zip(d_value).map(|(w, v)| w * v).sum();
                for c in 0..9 {
                    let at = (i * joints + k) * 9 + c;
                    d.gain[at] = d_term * features[k][c];
                    d_features[k][c] += d_term * self.gain[at];
                }
            }
        }
        (d, d_features)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    /// Two channels, a root and a joint that turns about z: the first channel depends on the sine, the second on the
    /// cosine.
    fn response() -> PoseResponse {
        let mut gain = vec![0.0; 2 * 2 * 9];
        // Entry 3 of vec(R) is R_10 = sin, entry 0 is R_00 = cos.
        gain[9 + 3] = 2.0;
        gain[3 * 9] = 1.0;
        // The root's gains are set, and must have no effect.
        gain[..9].fill(5.0);
        PoseResponse { bias: vec![0.25, -0.5], gain, limits: vec![UNLIMITED; 4] }
    }

    fn turned(root: DVec3, angle: f64) -> Vec<[f64; 9]> {
        pose_features(&Pose { rotations: vec![root, DVec3::Z * angle], translation: DVec3::ZERO })
    }

    fn values(response: &PoseResponse, features: &[[f64; 9]]) -> Vec<f64> {
        // One Gaussian, which follows the root with a weight of a quarter.
        response.evaluate(&[0.25, 0.75], features, 1)
    }

    #[test]
    fn the_roots_rotation_changes_no_value_and_gets_no_gradient() {
        let response = response();
        let at_rest = values(&response, &turned(DVec3::ZERO, 0.4));
        let features = turned(DVec3::new(1.0, -2.0, 0.5), 0.4);
        assert_eq!(values(&response, &features), at_rest);
        let (d, d_features) = response.evaluate_vjp(&[0.25, 0.75], &features, &[1.0, 1.0], 1);
        assert!(d.gain[..9].iter().chain(&d.gain[18..27]).all(|g| *g == 0.0));
        assert!(d.gain[9..18].iter().any(|g| *g != 0.0));
        let d_local = response_features_vjp(&d_features);
        assert_eq!(d_local[0], DMat3::ZERO);
        assert_ne!(d_local[1], DMat3::ZERO);
    }

    #[test]
    fn the_response_is_unchanged_within_the_limits_and_constant_beyond_them() {
        let free = response();
        let seen: Vec<_> = [0.1, 0.3, 0.6].map(|angle| turned(DVec3::ZERO, angle)).to_vec();
        let limited = PoseResponse { limits: free.limits_over(&seen, 0.2), ..free.clone() };
        for features in &seen {
            assert_eq!(values(&limited, features), values(&free, features), "training poses keep their bits");
        }
        let [low, high] = limited.limits[1];
        let range = 2.0 * (0.6_f64.sin() - 0.1_f64.sin());
        assert!((low - (2.0 * 0.1_f64.sin() - 0.2 * range)).abs() < 1e-15);
        assert!((high - (2.0 * 0.6_f64.sin() + 0.2 * range)).abs() < 1e-15);
        // The root does not vary.
        assert_eq!(limited.limits[0], [0.0, 0.0]);
        for (angle, limit) in [(1.5, high), (-1.0, low)] {
            let features = turned(DVec3::ZERO, angle);
            let value = values(&limited, &features)[0];
            assert_eq!(value, 0.25 + 0.75 * limit);
            assert_ne!(value, values(&free, &features)[0]);
            let (d, d_features) = limited.evaluate_vjp(&[0.25, 0.75], &features, &[1.0, 0.0], 1);
            assert!(d.gain.iter().chain(d_features.as_flattened()).all(|g| *g == 0.0));
            assert_eq!(d.bias, [1.0, 0.0]);
        }
    }

    #[test]
    fn without_poses_there_are_no_limits_and_with_one_pose_the_response_is_constant() {
        let free = response();
        assert!(free.limits_over(&[], 0.2).iter().all(|l| *l == UNLIMITED));
        let seen = turned(DVec3::ZERO, 0.3);
        let limited = PoseResponse { limits: free.limits_over(std::slice::from_ref(&seen), 0.2), ..free };
        assert_eq!(values(&limited, &turned(DVec3::ZERO, 1.0)), values(&limited, &seen));
    }

    #[test]
    fn nan_is_kept() {
        let mut limited = response();
        limited.limits.fill([-1.0, 1.0]);
        assert!(values(&limited, &turned(DVec3::ZERO, f64::NAN)).iter().all(|v| v.is_nan()));
    }
}

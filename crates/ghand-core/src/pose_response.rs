//! How the `direct` property model depends on the pose: locally and linearly.
//!
//! A channel i (a blend coefficient or a colour component) of Gaussian p has the value
//! `y_i^p = bias_i + sum_k W_k^p  gain_{i,k} . vec(R_k - I)`: a Gaussian feels only the joints that move it.

use glam::DMat3;

/// `vec(R - I)`, row by row.
pub fn rotation_features(rotation: &DMat3) -> [f64; 9] {
    let r = (*rotation - DMat3::IDENTITY).transpose().to_cols_array();
    std::array::from_fn(|i| r[i])
}

/// dL/dR from dL/d(vec(R - I)).
pub fn rotation_features_vjp(d_features: &[f64; 9]) -> DMat3 {
    DMat3::from_cols_array(d_features).transpose()
}

/// The learned numbers of a pose response with `bias.len()` channels.
#[derive(Debug, Clone, PartialEq)]
pub struct PoseResponse {
    /// Value at rest, one a channel.
    pub bias: Vec<f64>,
    /// Gains `[channels][n_b][9]`.
    pub gain: Vec<f64>,
}

impl PoseResponse {
    /// What each joint adds to each channel, `[channels][n_b]`, for the joints' rotation features.
    pub fn joint_terms(&self, features: &[[f64; 9]]) -> Vec<f64> {
        let gain = self.gain.chunks_exact(9).enumerate();
        gain.map(|(i, row)| row.iter().zip(&features[i % features.len()]).map(|(a, f)| a * f).sum()).collect()
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

    /// Gradients of bias and gain (as a [`PoseResponse`]) and of the features, from dL/d(values) `[channels][N]`.
    pub fn evaluate_vjp(
        &self,
        weights: &[f64],
        features: &[[f64; 9]],
        d_values: &[f64],
        count: usize,
    ) -> (PoseResponse, Vec<[f64; 9]>) {
        let joints = features.len();
        let mut d_features = vec![[0.0; 9]; joints];
        let mut d = PoseResponse { bias: vec![0.0; self.bias.len()], gain: vec![0.0; self.gain.len()] };
        for i in 0..self.bias.len() {
            let d_value = &d_values[i * count..(i + 1) * count];
            d.bias[i] = d_value.iter().sum();
            for k in 0..joints {
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

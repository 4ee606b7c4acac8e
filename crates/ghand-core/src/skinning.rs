//! Linear blend skinning (paper eq. 4) with the residual correction (eq. 11), and its derivative.

use glam::DVec3;

use crate::skeleton::{Affine, outer};

/// What the residual skinning weights mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ResidualWeights {
    /// Used as they are, as in the paper: the rest pose swells by their sum.
    Paper,
    /// Their mean over the joints is subtracted, so that the rest pose stays where it is.
    #[default]
    ZeroSum,
}

/// The inputs of corrected skinning, all for the same N points and `n_b` joints.
#[derive(Debug, Clone, Copy)]
pub struct Skinning<'a> {
    /// Points at rest (metres), N.
    pub rest: &'a [DVec3],
    /// Skinning weights `[n_b][N]`.
    pub weights: &'a [f64],
    /// Residual skinning weights `[n_b][N]`, before `mode` is applied.
    pub residual_weights: &'a [f64],
    /// `posed_from_rest` of the skeleton, `n_b`.
    pub bones: &'a [Affine],
    /// `posed_from_rest` of the residual skeleton, `n_b`.
    pub residual_bones: &'a [Affine],
    /// Global translation, metres.
    pub translation: DVec3,
    /// What the residual weights mean.
    pub mode: ResidualWeights,
}

/// Gradients of [`skin`].
#[derive(Debug, Clone, PartialEq)]
pub struct SkinGradients {
    /// dL/d(rest points), N.
    pub rest: Vec<DVec3>,
    /// dL/d(residual weights before the mode), `[n_b][N]`.
    pub residual_weights: Vec<f64>,
    /// dL/dB, `n_b`.
    pub bones: Vec<Affine>,
    /// dL/dB^, `n_b`.
    pub residual_bones: Vec<Affine>,
    /// dL/d(translation).
    pub translation: DVec3,
}

impl Skinning<'_> {
    fn residual_mean(&self, point: usize) -> f64 {
        let (count, joints) = (self.rest.len(), self.bones.len());
        match self.mode {
            ResidualWeights::Paper => 0.0,
            ResidualWeights::ZeroSum => {
                (0..joints).map(|k| self.residual_weights[k * count + point]).sum::<f64>() / joints as f64
            }
        }
    }

    /// The affine map that moves one point: `sum_k W_k B_k + W^_k B^_k`.
    fn blended(&self, point: usize) -> Affine {
        let count = self.rest.len();
        let mean = self.residual_mean(point);
        let mut map = Affine::ZERO;
        for k in 0..self.bones.len() {
            map = map.add_scaled(self.weights[k * count + point], &self.bones[k]);
            map = map.add_scaled(self.residual_weights[k * count + point] - mean, &self.residual_bones[k]);
        }
        map
    }
}

/// Posed points (metres): `x_p = sum_k W_k B_k x + sum_k W^_k B^_k x + t`, applied as affine maps without
/// renormalising.
pub fn skin(s: &Skinning) -> Vec<DVec3> {
    s.rest.iter().enumerate().map(|(p, x)| s.blended(p).apply(*x) + s.translation).collect()
}

/// Gradients of all inputs from dL/d(posed points).
pub fn skin_vjp(s: &Skinning, d_posed: &[DVec3]) -> SkinGradients {
    let (count, joints) = (s.rest.len(), s.bones.len());
    let mut g = SkinGradients {
        rest: Vec::with_capacity(count),
        residual_weights: vec![0.0; joints * count],
        bones: vec![Affine::ZERO; joints],
        residual_bones: vec![Affine::ZERO; joints],
        translation: d_posed.iter().sum(),
    };
    for (p, (x, d)) in s.rest.iter().zip(d_posed).enumerate() {
        g.rest.push(s.blended(p).linear.transpose() * *d);
        let moment = Affine { linear: outer(*d, *x), translation: *d };
        let mean = s.residual_mean(p);
        let mut d_mean = 0.0;
        for k in 0..joints {
            let i = k * count + p;
            g.bones[k] = g.bones[k].add_scaled(s.weights[i], &moment);
            g.residual_bones[k] = g.residual_bones[k].add_scaled(s.residual_weights[i] - mean, &moment);
            g.residual_weights[i] = s.residual_bones[k].apply(*x).dot(*d);
            d_mean += g.residual_weights[i] / joints as f64;
        }
        if s.mode == ResidualWeights::ZeroSum {
            for k in 0..joints {
                g.residual_weights[k * count + p] -= d_mean;
            }
        }
    }
    g
}

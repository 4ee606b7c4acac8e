//! The networks once more, in f64 with plain loops.

use glam::DVec2;

use super::sigmoid;
use crate::properties::network::{Activation, NORM_EPSILON, NetworkSizes, OFFSET_GAIN};

/// Properties, `[rows][N]` each: S, W^, C, R, scale, colour.
pub(crate) type Outputs = [Vec<f64>; 6];

/// Networks with their inputs.
pub(crate) struct Twin {
    pub sizes: NetworkSizes,
    pub parameters: Vec<(String, Vec<f64>)>,
    /// Mean and variance by which each normalisation goes, in the order of the encoders' layers; empty: those of the map.
    pub fixed_norms: Vec<[Vec<f64>; 2]>,
    pub uvs: Vec<DVec2>,
    /// Of the rest hand and the posed one.
    pub maps: [Vec<f64>; 2],
    pub base_shape_basis: Vec<f64>,
    pub base_logits: Vec<f64>,
    pub max_scale: f64,
    pub coefficient_rows: usize,
}

/// Normalisations of an encoder.
const NORMS: usize = 7;

/// `[channels][side][side]`.
#[derive(Clone)]
struct Map {
    side: usize,
    values: Vec<f64>,
}

impl Map {
    fn channels(&self) -> usize {
        self.values.len() / (self.side * self.side)
    }

    /// 0 outside.
    fn at(&self, channel: usize, row: isize, column: isize) -> f64 {
        let inside = 0..self.side as isize;
        if !inside.contains(&row) || !inside.contains(&column) {
            return 0.0;
        }
        self.values[(channel * self.side + row as usize) * self.side + column as usize]
    }

    fn map(mut self, f: impl Fn(f64) -> f64) -> Map {
        self.values.iter_mut().for_each(|v| *v = f(*v));
        self
    }
}

/// `weight` is `[outputs][inputs][kernel][kernel]`.
fn conv(x: &Map, weight: &[f64], kernel: usize, stride: usize) -> Map {
    let side = x.side / stride;
    let inputs = x.channels();
    let outputs = weight.len() / (inputs * kernel * kernel);
    let padding = (kernel as isize - 1) / 2;
    let mut values = Vec::new();
    for o in 0..outputs {
        for row in 0..side {
            for column in 0..side {
                let mut sum = 0.0;
                for i in 0..inputs {
                    for ky in 0..kernel {
                        for kx in 0..kernel {
                            let w = weight[((o * inputs + i) * kernel + ky) * kernel + kx];
                            let at = |out: usize, k: usize| (out * stride + k) as isize - padding;
                            sum += w * x.at(i, at(row, ky), at(column, kx));
                        }
                    }
                }
                values.push(sum);
            }
        }
    }
    Map { side, values }
}

/// `weight` is `[inputs][outputs][4][4]`: every input texel is spread over 4 x 4 output texels around it.
fn conv_transposed(x: &Map, weight: &[f64], bias: Option<&[f64]>) -> Map {
    let side = 2 * x.side;
    let inputs = x.channels();
    let outputs = weight.len() / (inputs * 16);
    let mut values = vec![0.0; outputs * side * side];
    for i in 0..inputs {
        for o in 0..outputs {
            for row in 0..x.side {
                for column in 0..x.side {
                    for ky in 0..4 {
                        for kx in 0..4 {
                            let (y, z) = ((2 * row + ky).wrapping_sub(1), (2 * column + kx).wrapping_sub(1));
                            if y < side && z < side {
                                values[(o * side + y) * side + z] += weight[((i * outputs + o) * 4 + ky) * 4 + kx]
                                    * x.at(i, row as isize, column as isize);
                            }
                        }
                    }
                }
            }
        }
    }
    for (o, channel) in values.chunks_exact_mut(side * side).enumerate() {
        channel.iter_mut().for_each(|v| *v += bias.map_or(0.0, |b| b[o]));
    }
    Map { side, values }
}

/// By the map's own mean and variance, or by these.
fn normalized(mut x: Map, fixed: Option<&[Vec<f64>; 2]>) -> Map {
    let texels = x.side * x.side;
    for (c, channel) in x.values.chunks_exact_mut(texels).enumerate() {
        let (mean, variance) = match fixed {
            Some([means, variances]) => (means[c], variances[c]),
            None => {
                let mean = channel.iter().sum::<f64>() / texels as f64;
                (mean, channel.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / texels as f64)
            }
        };
        channel.iter_mut().for_each(|v| *v = (*v - mean) / (variance + NORM_EPSILON).sqrt());
    }
    x
}

impl Twin {
    fn parameter(&self, name: &str) -> &[f64] {
        &self.parameters.iter().find(|(n, _)| n == name).unwrap_or_else(|| unreachable!("no parameter {name}")).1
    }

    /// The encoder of this name, whose normalisations follow those of `before` others.
    fn unet(&self, name: &str, before: usize, map: &[f64]) -> Map {
        let mut norms = self.fixed_norms.iter().skip(before * NORMS);
        let mut x = Map { side: self.sizes.map_side, values: map.to_vec() };
        let mut skipped = Vec::new();
        for k in 0..5 {
            if k > 0 {
                skipped.push(x.clone());
                x = x.map(|v| if v < 0.0 { 0.2 * v } else { v });
            }
            x = conv(&x, self.parameter(&format!("{name}.down.{k}")), 4, 2);
            if (1..4).contains(&k) {
                x = normalized(x, norms.next());
            }
        }
        for k in 0..5 {
            if k > 0 {
                x.values.extend(skipped.pop().into_iter().flat_map(|skip: Map| skip.values));
            }
            let bias = (k == 4).then(|| self.parameter(&format!("{name}.up.{k}.bias")));
            x = conv_transposed(&x.map(|v| v.max(0.0)), self.parameter(&format!("{name}.up.{k}.weight")), bias);
            if k < 4 {
                x = normalized(x, norms.next());
            }
        }
        x
    }

    fn activate(&self, x: f64) -> f64 {
        match self.sizes.activation {
            Activation::Relu => x.max(0.0),
            Activation::Softplus => x.max(0.0) + (-x.abs()).exp().ln_1p(),
        }
    }

    /// Of one point.
    fn mlp(&self, name: &str, layers: usize, input: &[f64]) -> Vec<f64> {
        let mut x = input.to_vec();
        for k in 0..layers {
            if k > 0 {
                x.iter_mut().for_each(|v| *v = self.activate(*v));
            }
            let weight = self.parameter(&format!("{name}.{k}.weight"));
            let bias = self.parameter(&format!("{name}.{k}.bias"));
            let output = |o: usize| (0..x.len()).map(|i| x[i] * weight[i * bias.len() + o]).sum::<f64>() + bias[o];
            x = (0..bias.len()).map(output).collect();
        }
        x
    }

    /// A map at a place, between texel centres.
    fn sample(map: &Map, uv: DVec2) -> Vec<f64> {
        let side = map.side as f64;
        let value = |c: usize| {
            let near = |at: f64| (0.0f64).max((side - 1.0).min(at * side - 0.5));
            let (x, y) = (near(uv.x), near(uv.y));
            // Hat functions of all texels.
            let mut sum = 0.0;
            for row in 0..map.side {
                for column in 0..map.side {
                    let hat = |a: f64, b: usize| (1.0 - (a - b as f64).abs()).max(0.0);
                    sum += hat(y, row) * hat(x, column) * map.at(c, row as isize, column as isize);
                }
            }
            sum
        };
        (0..map.channels()).map(value).collect()
    }

    pub fn outputs(&self) -> Outputs {
        let side = self.sizes.map_side;
        let mut canonical = self.unet("canonical_encoder", 0, &self.maps[0]);
        let mut tensor = Map { side, values: self.parameter("feature_tensor").to_vec() };
        for k in 0..3 {
            tensor = conv(&tensor, self.parameter(&format!("smoothing.{k}")), 5, 1);
        }
        canonical.values.iter_mut().zip(&tensor.values).for_each(|(a, b)| *a += b);
        let posed = self.unet("pose_encoder", 1, &self.maps[1]);
        let count = self.uvs.len();
        let mut rows: [Vec<Vec<f64>>; 6] = Default::default();
        for (p, uv) in self.uvs.iter().enumerate() {
            let mut features = Self::sample(&canonical, *uv);
            features.extend([uv.x, uv.y]);
            let basis = self.mlp("shape_basis", 4, &features).into_iter().enumerate();
            rows[0].push(basis.map(|(r, v)| OFFSET_GAIN * v + self.base_shape_basis[r * count + p]).collect());
            rows[1].push(self.mlp("residual_weights", 4, &features));
            features.extend(Self::sample(&posed, *uv));
            let shared: Vec<f64> = self.mlp("trunk", 4, &features).into_iter().map(|v| self.activate(v)).collect();
            rows[2].push(self.mlp("coefficients", 3, &shared));
            rows[3].push(self.mlp("regressor", 3, &shared).into_iter().map(|v| v / count as f64).collect());
            let logit = |r: usize| self.base_logits[r * count + p];
            rows[4].push(
                self.mlp("scale", 3, &shared).into_iter().map(|v| self.max_scale * sigmoid(v + logit(0))).collect(),
            );
            let color = self.mlp("color", 3, &shared).into_iter().enumerate();
            let own = |c: usize| if self.sizes.own_colors { self.parameter("own_colors")[c * count + p] } else { 0.0 };
            rows[5].push(color.map(|(c, v)| sigmoid(v + logit(1 + c) + own(c))).collect());
        }
        debug_assert_eq!(rows[2][0].len(), self.coefficient_rows);
        // Points to rows.
        rows.map(|points| (0..points[0].len()).flat_map(|r| points.iter().map(move |p| p[r])).collect())
    }
}

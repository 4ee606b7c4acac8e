//! Twin of `adam.wgsl`.

use crate::optimizer::{BETAS, EPSILON};

/// Adam step number `step` (from 1) on parameters with their two moments. Parameters with zero gradient, which the view
/// did not see, keep their values and moments.
pub fn adam(parameters: &mut [f64], moments: &mut [[f64; 2]], gradients: &[f64], learning_rate: f64, step: u64) {
    let correction = BETAS.map(|b| 1.0 / (1.0 - b.powf(step as f64)));
    for ((p, m), g) in parameters.iter_mut().zip(moments).zip(gradients) {
        if *g == 0.0 {
            continue;
        }
        m[0] = BETAS[0] * m[0] + (1.0 - BETAS[0]) * g;
        m[1] = BETAS[1] * m[1] + (1.0 - BETAS[1]) * g * g;
        *p -= learning_rate * m[0] * correction[0] / ((m[1] * correction[1]).sqrt() + f64::from(EPSILON));
    }
}

/// The same on vectors of three parameters that share a second moment, the mean over their components.
pub fn adam_vectors(
    parameters: &mut [f64],
    moments: &mut [[f64; 2]],
    gradients: &[f64],
    learning_rate: f64,
    step: u64,
) {
    let correction = BETAS.map(|b| 1.0 / (1.0 - b.powf(step as f64)));
    let vectors = parameters.chunks_exact_mut(3).zip(moments.chunks_exact_mut(3)).zip(gradients.chunks_exact(3));
    for ((p, m), g) in vectors {
        let square = g.iter().map(|g| g * g).sum::<f64>() / 3.0;
        if square == 0.0 {
            continue;
        }
        for ((p, m), g) in p.iter_mut().zip(m).zip(g) {
            m[0] = BETAS[0] * m[0] + (1.0 - BETAS[0]) * g;
            m[1] = BETAS[1] * m[1] + (1.0 - BETAS[1]) * square;
            *p -= learning_rate * m[0] * correction[0] / ((m[1] * correction[1]).sqrt() + f64::from(EPSILON));
        }
    }
}

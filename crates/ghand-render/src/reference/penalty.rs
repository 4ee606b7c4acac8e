//! Twin of `penalty.wgsl`.

/// Adds the gradient of `weight / 2 * |values|^2` to `gradients`.
pub fn add_penalty(values: &[f64], gradients: &mut [f64], weight: f64) {
    gradients.iter_mut().zip(values).for_each(|(gradient, value)| *gradient += weight * value);
}

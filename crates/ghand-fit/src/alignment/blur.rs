//! Blurred images.

/// An image, row-major, blurred by a Gaussian of this standard deviation in pixels, with zeros around.
pub fn blurred(values: &[f32], [columns, rows]: [usize; 2], deviation: f64) -> Vec<f32> {
    let radius = (3.0 * deviation).ceil() as usize;
    let mut kernel: Vec<f32> = (0..=radius).map(|k| (-0.5 * (k as f64 / deviation).powi(2)).exp() as f32).collect();
    let total = kernel[0] + 2.0 * kernel[1..].iter().sum::<f32>();
    kernel.iter_mut().for_each(|weight| *weight /= total);
    let add = |to: &mut [f32], from: &[f32], weight: f32| {
        to.iter_mut().zip(from).for_each(|(to, from)| *to += weight * from);
    };
    let mut across = vec![0.0; values.len()];
    for (to, from) in across.chunks_exact_mut(columns).zip(values.chunks_exact(columns)) {
        add(to, from, kernel[0]);
        for (k, weight) in kernel.iter().enumerate().take(columns).skip(1) {
            add(&mut to[k..], from, *weight);
            add(to, &from[k..], *weight);
        }
    }
    let mut result = vec![0.0; values.len()];
    for (y, to) in result.chunks_exact_mut(columns).enumerate() {
        for from in y.saturating_sub(radius)..(y + radius + 1).min(rows) {
            add(to, &across[from * columns..(from + 1) * columns], kernel[from.abs_diff(y)]);
        }
    }
    result
}

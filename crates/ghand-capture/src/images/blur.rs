//! Gaussian blur.

/// A picture after a Gaussian blur; what is beyond its border is 0.
pub fn blurred(values: &[f32], [width, height]: [u32; 2], deviation: f64) -> Vec<f32> {
    let reach = (3.0 * deviation).ceil() as usize;
    let weight = |k: usize| (-0.5 * (k as f64 / deviation.max(f64::MIN_POSITIVE)).powi(2)).exp();
    let total = 1.0 + 2.0 * (1..=reach).map(weight).sum::<f64>();
    let kernel: Vec<f32> = (0..=reach).map(|k| (weight(k) / total) as f32).collect();
    let (width, height) = (width as usize, height as usize);
    let along = |values: &[f32], step: usize, length: usize, place: fn(usize, usize) -> usize| -> Vec<f32> {
        let at = |i: usize| {
            let at = place(i, width);
            let term = |k: usize| {
                let before = if k <= at { values[i - k * step] } else { 0.0 };
                let after = if at + k < length { values[i + k * step] } else { 0.0 };
                kernel[k] * (before + after)
            };
            kernel[0] * values[i] + (1..=reach).map(term).sum::<f32>()
        };
        (0..values.len()).map(at).collect()
    };
    let rows = along(values, 1, width, |i, width| i % width);
    along(&rows, width, height, |i, width| i / width)
}

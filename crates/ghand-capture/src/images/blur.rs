//! Gaussian blur.

/// A picture after a Gaussian blur; what is beyond its border is 0.
pub fn blurred(values: &[f32], [width, _]: [u32; 2], deviation: f64) -> Vec<f32> {
    let reach = (3.0 * deviation).ceil() as usize;
    let weight = |k: usize| (-0.5 * (k as f64 / deviation.max(f64::MIN_POSITIVE)).powi(2)).exp();
    let total = 1.0 + 2.0 * (1..=reach).map(weight).sum::<f64>();
    let kernel: Vec<f32> = (0..=reach).map(|k| (weight(k) / total) as f32).collect();
    let width = (width as usize).max(1);
    let along_rows: Vec<f32> = values.chunks(width).flat_map(|row| blurred_line(row, 1, &kernel)).collect();
    blurred_line(&along_rows, width, &kernel)
}

/// A line of values of which each has its neighbours `step` before and after it.
fn blurred_line(line: &[f32], step: usize, kernel: &[f32]) -> Vec<f32> {
    let margin = vec![0.0; (kernel.len() - 1) * step];
    let padded = [&margin, line, &margin].concat();
    let mut sums = vec![0.0; line.len()];
    for (k, weight) in kernel.iter().enumerate().skip(1) {
        let [before, after] = [margin.len() - k * step, margin.len() + k * step].map(|from| &padded[from..]);
        for (sum, (before, after)) in sums.iter_mut().zip(before.iter().zip(after)) {
            *sum += weight * (before + after);
        }
    }
    sums.iter().zip(line).map(|(sum, value)| kernel[0] * value + sum).collect()
}

//! Twin of `roughness.wgsl`.

/// The penalty on differences between neighbours, `weight * width^2 * (sqrt(1 + (difference / width)^2) - 1)` summed over
/// all pairs. `values` is `[rows][N]`, `neighbors` `[K][N]`, in which each pair of neighbours occurs once at either.
pub fn roughness(values: &[f64], neighbors: &[u32], count: usize, weight: f64, width: f64) -> f64 {
    let pair = |row: &[f64], p: usize, q: usize| ((1.0 + ((row[p] - row[q]) / width).powi(2)).sqrt() - 1.0) / 2.0;
    let of_row =
        |row: &[f64]| -> f64 { neighbors.iter().enumerate().map(|(i, q)| pair(row, i % count, *q as usize)).sum() };
    weight * width * width * values.chunks_exact(count).map(of_row).sum::<f64>()
}

/// Adds its gradient to `gradients`.
pub fn add_roughness(values: &[f64], gradients: &mut [f64], neighbors: &[u32], count: usize, weight: f64, width: f64) {
    for (row, gradients) in values.chunks_exact(count).zip(gradients.chunks_exact_mut(count)) {
        for (i, q) in neighbors.iter().enumerate() {
            let difference = row[i % count] - row[*q as usize];
            gradients[i % count] += weight * difference / (1.0 + (difference / width).powi(2)).sqrt();
        }
    }
}

//! Small systems of linear equations.

/// Solves `A x = b` for a symmetric positive definite `A` (row-major, `n` x `n`), by Cholesky's factorisation.
///
/// A pivot that is not positive because of rounding counts as infinite: its unknown becomes 0.
pub(crate) fn solve(mut a: Vec<f64>, b: &[f64]) -> Vec<f64> {
    let n = b.len();
    // The factor L of A = L L^T replaces the lower triangle.
    for i in 0..n {
        for j in 0..=i {
            let dot: f64 = (0..j).map(|k| a[i * n + k] * a[j * n + k]).sum();
            let rest = a[i * n + j] - dot;
            a[i * n + j] = match (i == j, rest > 0.0) {
                (true, true) => rest.sqrt(),
                (true, false) => f64::INFINITY,
                (false, _) => rest / a[j * n + j],
            };
        }
    }
    let mut x = b.to_vec();
    for i in 0..n {
        let dot: f64 = (0..i).map(|k| a[i * n + k] * x[k]).sum();
        x[i] = (x[i] - dot) / a[i * n + i];
    }
    for i in (0..n).rev() {
        let dot: f64 = (i + 1..n).map(|k| a[k * n + i] * x[k]).sum();
        x[i] = (x[i] - dot) / a[i * n + i];
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};

    #[test]
    fn the_solution_satisfies_the_equations() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(5);
        for n in [1, 4, 9, 34] {
            let factor: Vec<f64> = (0..n * n).map(|_| rng.random_range(-1.0..1.0)).collect();
            let mut a = vec![0.0; n * n];
            for i in 0..n {
                for j in 0..n {
                    a[i * n + j] = (0..n).map(|k| factor[i * n + k] * factor[j * n + k]).sum();
                }
                a[i * n + i] += 1.0;
            }
            let b: Vec<f64> = (0..n).map(|_| rng.random_range(-1.0..1.0)).collect();
            let x = solve(a.clone(), &b);
            for i in 0..n {
                let product: f64 = (0..n).map(|j| a[i * n + j] * x[j]).sum();
                assert!((product - b[i]).abs() < 1e-12, "{n}: {product} against {}", b[i]);
            }
        }
    }
}

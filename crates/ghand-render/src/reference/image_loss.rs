//! Twin of `image_loss.wgsl`.

/// Half width of the SSIM window.
pub(super) const RADIUS: usize = 5;
pub(super) const C1: f64 = 0.01 * 0.01;
pub(super) const C2: f64 = 0.03 * 0.03;

/// A picture of three channels in 0..1, row-major.
#[derive(Debug, Clone, PartialEq)]
pub struct Picture {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// `width * height` colours.
    pub rgb: Vec<[f64; 3]>,
}

fn window() -> [f64; 2 * RADIUS + 1] {
    let raw: [f64; 2 * RADIUS + 1] = std::array::from_fn(|i| (-((i as f64 - RADIUS as f64) / 1.5).powi(2) / 2.0).exp());
    let sum: f64 = raw.iter().sum();
    raw.map(|w| w / sum)
}

/// Gaussian-window average of a picture-shaped array, with zeros outside.
fn blur(values: &[[f64; 3]], width: usize, height: usize) -> Vec<[f64; 3]> {
    let weights = window();
    let pass = |from: &[[f64; 3]], horizontal: bool| -> Vec<[f64; 3]> {
        let mut to = vec![[0.0; 3]; from.len()];
        for y in 0..height {
            for x in 0..width {
                let sum = &mut to[y * width + x];
                for (j, w) in weights.iter().enumerate() {
                    let (sx, sy) = if horizontal { (x + j, y + RADIUS) } else { (x + RADIUS, y + j) };
                    if (RADIUS..width + RADIUS).contains(&sx) && (RADIUS..height + RADIUS).contains(&sy) {
                        let value = from[(sy - RADIUS) * width + sx - RADIUS];
                        (0..3).for_each(|c| sum[c] += w * value[c]);
                    }
                }
            }
        }
        to
    };
    pass(&pass(values, true), false)
}

struct Ssim {
    value: Vec<[f64; 3]>,
    /// Derivatives of the value with respect to the blurred x, x^2 and x y.
    d: [Vec<[f64; 3]>; 3],
}

fn ssim_map(x: &Picture, y: &Picture) -> Ssim {
    let (w, h) = (x.width, x.height);
    let product = |a: &Picture, b: &Picture| -> Vec<[f64; 3]> {
        let pixels = a.rgb.iter().zip(&b.rgb).map(|(a, b)| std::array::from_fn(|c| a[c] * b[c])).collect::<Vec<_>>();
        blur(&pixels, w, h)
    };
    let (mean_x, mean_y) = (blur(&x.rgb, w, h), blur(&y.rgb, w, h));
    let (xx, yy, xy) = (product(x, x), product(y, y), product(x, y));
    let mut out = Ssim { value: vec![], d: [vec![], vec![], vec![]] };
    for i in 0..w * h {
        let mut value = [0.0; 3];
        let mut d = [[0.0; 3]; 3];
        for c in 0..3 {
            let (mx, my) = (mean_x[i][c], mean_y[i][c]);
            let n1 = 2.0 * mx * my + C1;
            let n2 = 2.0 * (xy[i][c] - mx * my) + C2;
            let d1 = mx * mx + my * my + C1;
            let d2 = xx[i][c] - mx * mx + yy[i][c] - my * my + C2;
            value[c] = n1 * n2 / (d1 * d2);
            d[0][c] = 2.0 * my * (n2 - n1) / (d1 * d2) - 2.0 * mx * value[c] * (1.0 / d1 - 1.0 / d2);
            d[1][c] = -value[c] / d2;
            d[2][c] = 2.0 * n1 / (d1 * d2);
        }
        out.value.push(value);
        (0..3).for_each(|k| out.d[k].push(d[k]));
    }
    out
}

/// The sum of `l1 |x - y| + ssim (1 - SSIM)` over pixels and channels, times `inverse_count`, and its gradient with
/// respect to x.
pub fn image_loss(x: &Picture, y: &Picture, [l1, ssim]: [f64; 2], inverse_count: f64) -> (f64, Vec<[f64; 3]>) {
    let map = ssim_map(x, y);
    let mut value = 0.0;
    for (i, s) in map.value.iter().enumerate() {
        for (c, s) in s.iter().enumerate() {
            let error = x.rgb[i][c] - y.rgb[i][c];
            value += l1 * error.abs() + ssim * (1.0 - s);
        }
    }
    let d = map.d.map(|d| blur(&d, x.width, x.height));
    let gradient = (0..x.rgb.len())
        .map(|i| {
            std::array::from_fn(|c| {
                let (a, b) = (x.rgb[i][c], y.rgb[i][c]);
                let sign = if a == b { 0.0 } else { (a - b).signum() };
                let d_ssim = d[0][i][c] + 2.0 * a * d[1][i][c] + b * d[2][i][c];
                inverse_count * (l1 * sign - ssim * d_ssim)
            })
        })
        .collect();
    (value * inverse_count, gradient)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};

    fn random(seed: u64, width: usize, height: usize) -> Picture {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        let rgb = (0..width * height).map(|_| std::array::from_fn(|_| rng.random_range(0.0..1.0))).collect();
        Picture { width, height, rgb }
    }

    #[test]
    fn equal_pictures_have_ssim_one_and_different_ones_less() {
        let x = random(1, 19, 13);
        let ssim = |y: &Picture| 1.0 - image_loss(&x, y, [0.0, 1.0], 1.0 / 741.0).0;
        assert!((ssim(&x) - 1.0).abs() < 1e-12);
        assert!(ssim(&random(2, 19, 13)) < 0.5);
    }

    #[test]
    fn the_gradient_agrees_with_central_differences() {
        let (x, y) = (random(3, 9, 14), random(4, 9, 14));
        let loss = |x: &Picture| image_loss(x, &y, [0.8, 0.2], 1.0 / 378.0);
        let (_, gradient) = loss(&x);
        for (i, d) in gradient.iter().enumerate() {
            for (c, d) in d.iter().enumerate() {
                let shifted = |h: f64| {
                    let mut other = x.clone();
                    other.rgb[i][c] += h;
                    loss(&other).0
                };
                let numeric = (shifted(1e-6) - shifted(-1e-6)) / 2e-6;
                assert!((d - numeric).abs() <= 1e-8, "pixel {i}: {d} against {numeric}");
            }
        }
    }
}

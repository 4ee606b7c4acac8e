//! Mean structural similarity of two pictures, as scikit-image computes it with `gaussian_weights=True`, `sigma=1.5`,
//! `use_sample_covariance=False` and `data_range=1`: a Gaussian window of 11x11 pixels, and the mean over the pixels whose
//! window lies in the picture and over the three channels.

use rayon::prelude::*;

/// Pixels from the middle of the window to its edge: 3.5 standard deviations, rounded.
const RADIUS: usize = 5;
const WINDOW: usize = 2 * RADIUS + 1;
/// Standard deviation of the window, pixels.
const SIGMA: f64 = 1.5;
/// Wang et al. 2004, for values in `[0, 1]`.
const C1: f64 = 0.01 * 0.01;
const C2: f64 = 0.03 * 0.03;
/// Per channel: means of both pictures, of their squares and of their product.
type Moments = [[f64; 5]; 3];

/// SSIM of two row-major pictures of `width` pixels a row, of 8-bit display values. NaN if a side is shorter than the
/// window, or the pictures differ in size.
pub fn mean_ssim(width: usize, picture: &[[u8; 3]], truth: &[[u8; 3]]) -> f64 {
    let height = picture.len().checked_div(width).unwrap_or(0);
    if width < WINDOW || height < WINDOW || picture.len() != truth.len() || picture.len() != width * height {
        return f64::NAN;
    }
    let window = window();
    let columns = width + 1 - WINDOW;
    // Along the rows first. Sums are in a fixed order, so that the result does not depend on the number of threads.
    let along_rows: Vec<Vec<Moments>> = (picture.par_chunks(width).zip(truth.par_chunks(width)))
        .map(|(picture, truth)| {
            let products: Vec<Moments> = picture.iter().zip(truth).map(|(p, t)| products(*p, *t)).collect();
            products.windows(WINDOW).map(|around| weighted(&window, around.iter())).collect()
        })
        .collect();
    let sums: Vec<f64> = (along_rows.par_windows(WINDOW))
        .map(|rows| {
            let at = |x: usize| weighted(&window, rows.iter().map(|row| &row[x]));
            (0..columns).map(|x| at(x).map(similarity).iter().sum::<f64>()).sum()
        })
        .collect();
    sums.iter().sum::<f64>() / (3 * columns * sums.len()) as f64
}

fn window() -> [f64; WINDOW] {
    let weights: [f64; WINDOW] = std::array::from_fn(|k| (-0.5 * ((k as f64 - RADIUS as f64) / SIGMA).powi(2)).exp());
    let sum: f64 = weights.iter().sum();
    weights.map(|weight| weight / sum)
}

fn products(picture: [u8; 3], truth: [u8; 3]) -> Moments {
    std::array::from_fn(|c| {
        let (p, t) = (f64::from(picture[c]) / 255.0, f64::from(truth[c]) / 255.0);
        [p, t, p * p, t * t, p * t]
    })
}

fn weighted<'a>(window: &[f64; WINDOW], around: impl Iterator<Item = &'a Moments>) -> Moments {
    let mut sum = [[0.0; 5]; 3];
    for (weight, moments) in window.iter().zip(around) {
        for (sum, value) in sum.as_flattened_mut().iter_mut().zip(moments.as_flattened()) {
            *sum += weight * value;
        }
    }
    sum
}

fn similarity([p, t, pp, tt, pt]: [f64; 5]) -> f64 {
    let variances = pp - p * p + tt - t * t;
    let covariance = pt - p * t;
    (2.0 * p * t + C1) * (2.0 * covariance + C2) / ((p * p + t * t + C1) * (variances + C2))
}

#[cfg(test)]
pub(crate) mod test_pictures {
    /// Two pictures by formula, cut to their first columns and rows.
    pub(crate) fn pictures(width: usize, height: usize) -> [Vec<[u8; 3]>; 2] {
        let first = |x: usize, y: usize, c: usize| (x * x * 3 + y * y * 5 + c * 40 + x * y) % 256;
        let second = |x: usize, y: usize, c: usize| (3 * first(x, y, c) + (x * 29 + y * 17 + c * 11) % 256) / 4;
        let picture = |value: &dyn Fn(usize, usize, usize) -> usize| {
            let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
            pixels.map(|(x, y)| [0, 1, 2].map(|c| value(x, y, c) as u8)).collect()
        };
        [picture(&first), picture(&second)]
    }
}

#[cfg(test)]
mod tests {
    use super::test_pictures::pictures;
    use super::*;

    const SIZE: [usize; 2] = [24, 20];

    #[test]
    fn values_are_those_of_scikit_image() {
        // structural_similarity of scikit-image 0.26.0 with the arguments above and channel_axis=2.
        let expect = |found: f64, expected: f64| assert!((found - expected).abs() < 1e-12, "{found}, not {expected}");
        let [a, b] = pictures(SIZE[0], SIZE[1]);
        expect(mean_ssim(SIZE[0], &a, &b), 0.9284161181417382);
        expect(mean_ssim(SIZE[0], &b, &a), 0.9284161181417382);
        expect(mean_ssim(SIZE[0], &a, &a), 1.0);
        let negative: Vec<[u8; 3]> = a.iter().map(|p| p.map(|v| 255 - v)).collect();
        expect(mean_ssim(SIZE[0], &a, &negative), -0.9831390582690748);
        let [a, b] = pictures(13, 20);
        expect(mean_ssim(13, &a, &b), 0.9364520242281728);
        let [a, b] = pictures(11, 11);
        expect(mean_ssim(11, &a, &b), 0.9387518356200869);
    }

    #[test]
    fn pictures_smaller_than_the_window_have_no_ssim() {
        for (width, height) in [(10, 20), (20, 10), (0, 0)] {
            let [a, b] = pictures(width, height);
            assert!(mean_ssim(width, &a, &b).is_nan());
        }
    }
}

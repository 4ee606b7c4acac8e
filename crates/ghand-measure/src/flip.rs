//! FLIP (Andersson et al. 2020): how different two pictures look to a person who flips between them.

use nv_flip::{DEFAULT_PIXELS_PER_DEGREE, FlipImageRgb8};

/// Mean FLIP of two row-major pictures of 8-bit display values, from 0 (equal) to 1, at the usual viewing distance of 67
/// pixels per degree. NaN if a picture is not of this size, or is empty.
pub fn mean_flip([width, height]: [u32; 2], picture: &[[u8; 3]], truth: &[[u8; 3]]) -> f64 {
    let pixels = width as usize * height as usize;
    if pixels == 0 || picture.len() != pixels || truth.len() != pixels {
        return f64::NAN;
    }
    let image = |pixels: &[[u8; 3]]| FlipImageRgb8::with_data(width, height, pixels.as_flattened());
    let map = nv_flip::flip(image(truth), image(picture), DEFAULT_PIXELS_PER_DEGREE).to_vec();
    map.iter().map(|difference| f64::from(*difference)).sum::<f64>() / pixels as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ssim::test_pictures::pictures;

    #[test]
    fn values_are_those_of_the_authors_program() {
        let [a, b] = pictures(24, 20);
        // flip-evaluator 1.7 with its default of 67.02 pixels per degree.
        let found = mean_flip([24, 20], &a, &b);
        assert!((found - 0.22181).abs() < 1e-4, "{found}");
        assert_eq!(mean_flip([24, 20], &a, &a), 0.0);
    }

    #[test]
    fn pictures_of_another_size_have_no_value() {
        let [a, b] = pictures(24, 20);
        assert!(mean_flip([24, 19], &a, &b).is_nan() && mean_flip([24, 20], &a, &b[1..]).is_nan());
        assert!(mean_flip([0, 0], &[], &[]).is_nan());
    }
}

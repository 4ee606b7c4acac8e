//! Pictures as they were when they were last looked at: `tests/golden/*.png`, made on a CPU adapter.
//!
//! With `GHAND_UPDATE_GOLDEN=1` tests write the pictures that they compare; look at them before you commit them.

use std::path::Path;

use image::RgbImage;

/// Values of 8 bits that all adapters and drivers agree to within; the part of a picture's values that may be farther off; and
/// how far any may be.
const CLOSE: u8 = 2;
const FARTHER: f64 = 0.002;
const FARTHEST: u8 = 24;

/// The environment variable that has the pictures written.
const UPDATE: &str = "GHAND_UPDATE_GOLDEN";

/// What is wrong with a picture.
fn difference(picture: &RgbImage, golden: &RgbImage) -> Option<String> {
    if picture.dimensions() != golden.dimensions() {
        return Some(format!("has {:?} pixels, not {:?}", picture.dimensions(), golden.dimensions()));
    }
    let differences: Vec<u8> = picture.as_raw().iter().zip(golden.as_raw()).map(|(a, b)| a.abs_diff(*b)).collect();
    let far = differences.iter().filter(|difference| **difference > CLOSE).count();
    let farthest = differences.iter().copied().max().unwrap_or(0);
    let is_other = far as f64 > FARTHER * differences.len() as f64 || farthest > FARTHEST;
    is_other
        .then(|| format!("{far} of {} values differ by more than {CLOSE}, by {farthest} at most", differences.len()))
}

/// Compares a picture with `tests/golden/NAME.png`.
///
/// # Panics
/// Panics if they differ; the picture is then in the folder for temporary files.
pub fn check(name: &str, picture: &RgbImage) {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../golden").join(format!("{name}.png"));
    if std::env::var_os(UPDATE).is_some() {
        picture.save(&file).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
    }
    let golden = image::open(&file).unwrap_or_else(|e| panic!("{}: {e}", file.display())).into_rgb8();
    if let Some(difference) = difference(picture, &golden) {
        let made = std::env::temp_dir().join(format!("{name}.png"));
        picture.save(&made).unwrap_or_else(|e| panic!("{}: {e}", made.display()));
        panic!("{name}: {difference}; compare {} with {}", made.display(), file.display());
    }
}

#[cfg(test)]
mod tests {
    use image::Rgb;

    use super::*;

    #[test]
    fn another_picture_is_found() {
        let golden = RgbImage::from_fn(64, 64, |x, y| Rgb([x as u8, y as u8, 90]));
        assert_eq!(difference(&golden, &golden), None);
        let brighter = RgbImage::from_fn(64, 64, |x, y| Rgb([x as u8 + 3, y as u8, 90]));
        let mut spot = golden.clone();
        spot.put_pixel(5, 5, Rgb([255, 0, 0]));
        for wrong in [brighter, spot, RgbImage::new(63, 64)] {
            assert!(difference(&wrong, &golden).is_some());
        }
    }
}

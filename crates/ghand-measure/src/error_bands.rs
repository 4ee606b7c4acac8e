//! Squared errors by where a pixel lies: beside the hand, at its outline, or well inside of it.

use serde::Serialize;

use ghand_capture::mask::depths;

/// Upper ends of the bands inside the mask, pixels from its outline; the last band has none.
const ENDS: [f64; 2] = [3.0, 8.0];
const BANDS: usize = 4;

/// Sums of squared errors of display values in `[0, 1]`, by band.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct ErrorBands {
    sums: [f64; BANDS],
    /// Number of values: three per pixel.
    counts: [usize; BANDS],
}

/// Mean squared errors of display values in `[0, 1]`; `None` for a band without pixels.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct MeanBandErrors {
    /// Outside the mask.
    pub outside: Option<f64>,
    /// In the mask, up to 3 pixels from its outline.
    pub inside_to_3_px: Option<f64>,
    /// In the mask, from 3 to 8 pixels from its outline.
    pub inside_3_to_8_px: Option<f64>,
    /// Deeper in the mask.
    pub inside_over_8_px: Option<f64>,
}

impl ErrorBands {
    /// Adds the errors of one picture; `bands` are those of its pixels.
    pub fn add(&mut self, bands: &[u8], picture: &[[u8; 3]], truth: &[[u8; 4]]) {
        for ((band, p), t) in bands.iter().zip(picture).zip(truth) {
            let band = usize::from(*band);
            self.sums[band] += squared_error(*p, *t);
            self.counts[band] += 3;
        }
    }

    /// Adds the errors of other pictures.
    pub fn merge(&mut self, other: &ErrorBands) {
        for band in 0..BANDS {
            self.sums[band] += other.sums[band];
            self.counts[band] += other.counts[band];
        }
    }

    /// The means over all pixels of each band.
    pub fn means(&self) -> MeanBandErrors {
        let [outside, inside_to_3_px, inside_3_to_8_px, inside_over_8_px] =
            std::array::from_fn(|band| (self.counts[band] > 0).then(|| self.sums[band] / self.counts[band] as f64));
        MeanBandErrors { outside, inside_to_3_px, inside_3_to_8_px, inside_over_8_px }
    }
}

/// Sum over the channels of the squared difference of display values in `[0, 1]`.
pub fn squared_error(picture: [u8; 3], truth: [u8; 4]) -> f64 {
    (0..3).map(|c| ((f64::from(picture[c]) - f64::from(truth[c])) / 255.0).powi(2)).sum()
}

/// The band of each pixel of a row-major image, from its mask. A pixel's distance from the outline is that of its centre.
pub fn bands_of(truth: &[[u8; 4]], size: [u32; 2]) -> Vec<u8> {
    let band = |depth: f64| {
        if depth < 0.0 {
            return 0;
        }
        1 + ENDS.iter().filter(|end| depth > **end).count() as u8
    };
    depths(truth.iter().map(|pixel| pixel[3] >= 128), size).into_iter().map(band).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_counted_where_they_are() {
        // A mask of 21x21 in the middle of 31x31 pixels.
        let size = [31, 31];
        let inside = |x: u32, y: u32| (5..26).contains(&x) && (5..26).contains(&y);
        let depth = |x: u32, y: u32| (x - 4).min(y - 4).min(26 - x).min(26 - y);
        let pixels: Vec<(u32, u32)> = (0..31).flat_map(|y| (0..31).map(move |x| (x, y))).collect();
        let truth: Vec<[u8; 4]> =
            pixels.iter().map(|&(x, y)| [100, 100, 100, if inside(x, y) { 255 } else { 0 }]).collect();
        // An error of 2, 4, 6 and 8 grey levels in one channel of the four bands; the centres of the first three rings
        // are 0.5, 1.5 and 2.5 pixels from the outline.
        let error = |x: u32, y: u32| match inside(x, y).then(|| depth(x, y)) {
            None => 2,
            Some(..=3) => 4,
            Some(..=8) => 6,
            Some(_) => 8,
        };
        let picture: Vec<[u8; 3]> = pixels.iter().map(|&(x, y)| [100, 100 - error(x, y), 100]).collect();
        let bands = bands_of(&truth, size);
        let mut errors = ErrorBands::default();
        errors.add(&bands, &picture, &truth);
        let expected = |levels: f64| Some((levels / 255.0).powi(2) / 3.0);
        let close = |found: Option<f64>, expected: Option<f64>| (found.unwrap() - expected.unwrap()).abs() < 1e-15;
        let found = errors.means();
        assert!(close(found.outside, expected(2.0)), "{found:?}");
        assert!(close(found.inside_to_3_px, expected(4.0)), "{found:?}");
        assert!(close(found.inside_3_to_8_px, expected(6.0)), "{found:?}");
        assert!(close(found.inside_over_8_px, expected(8.0)), "{found:?}");
        // Means are over pixels, not over pictures.
        let none = vec![[100, 100, 100, 0]; truth.len()];
        let mut more = ErrorBands::default();
        more.add(&bands_of(&none, size), &picture, &none);
        assert_eq!(more.means().inside_to_3_px, None);
        errors.merge(&more);
        assert!(close(errors.means().inside_to_3_px, expected(4.0)));
        assert!(errors.means().outside > found.outside);
    }

    #[test]
    fn a_mask_over_the_whole_image_is_deep_everywhere() {
        let truth = vec![[0, 0, 0, 255]; 12];
        assert_eq!(bands_of(&truth, [4, 3]), [3; 12]);
    }
}

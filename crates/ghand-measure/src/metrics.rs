//! Similarity of pictures.

use crate::error_bands::{ErrorBands, bands_of, squared_error};
use crate::hand_box::Square;
use crate::ssim::mean_ssim;

/// Similarity of a picture to its truth.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct ImageSimilarity {
    /// PSNR over all pixels, dB, on 8-bit values.
    pub psnr: f64,
    /// PSNR over the square around the truth's mask ([`crate::hand_box`]), both scaled to 256 x 256 pixels, dB; `None` if
    /// the mask is empty.
    pub psnr_square: Option<f64>,
    /// PSNR over the truth's mask, dB.
    pub psnr_hand: f64,
    /// Mean SSIM ([`mean_ssim`]).
    pub ssim: f64,
    /// [LPIPS](crate::lpips), if there are weights for it.
    pub lpips: Option<f64>,
    /// Squared errors by distance from the mask's outline.
    pub bands: ErrorBands,
}

/// A picture as 8-bit display values.
pub fn quantize(rgb: [f32; 3]) -> [u8; 3] {
    rgb.map(|v| (v.clamp(0.0, 1.0) * 255.0).round() as u8)
}

/// PSNR of 8-bit pictures, dB, from the sum of squared differences of `values` display values 0..1.
pub fn psnr_of(sum: f64, values: usize) -> f64 {
    // Equal 8-bit pictures would have infinite PSNR. An error of at least half a grey level in one value keeps the mean
    // over views finite.
    let mean = sum / values.max(1) as f64;
    -10.0 * mean.max((0.5f64 / 255.0).powi(2) / values.max(1) as f64).log10()
}

/// PSNR of a picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Psnr {
    /// Over all pixels, dB, on 8-bit values.
    pub whole: f64,
    /// Over the truth's mask, dB.
    pub hand: f64,
}

/// PSNR of an 8-bit picture against a truth (red, green, blue, mask) of the same size.
pub fn psnr(picture: &[[u8; 3]], truth: &[[u8; 4]]) -> Psnr {
    let mut sum = 0.0;
    let mut hand_sum = 0.0;
    let mut hand = 0;
    for (p, t) in picture.iter().zip(truth) {
        let error = squared_error(*p, *t);
        sum += error;
        if t[3] >= 128 {
            hand_sum += error;
            hand += 3;
        }
    }
    Psnr { whole: psnr_of(sum, 3 * picture.len()), hand: psnr_of(hand_sum, hand) }
}

/// Similarity of 8-bit pictures to one truth (red, green, blue, mask) of the same size.
pub fn compare<const N: usize>(size: [u32; 2], pictures: [&[[u8; 3]]; N], truth: &[[u8; 4]]) -> [ImageSimilarity; N] {
    let colors: Vec<[u8; 3]> = truth.iter().map(|&[r, g, b, _]| [r, g, b]).collect();
    let bands = bands_of(truth, size);
    let square = Square::around_mask(truth, size[0]);
    pictures.map(|picture| {
        let psnr = psnr(picture, truth);
        let mut errors = ErrorBands::default();
        errors.add(&bands, picture, truth);
        ImageSimilarity {
            psnr: psnr.whole,
            psnr_square: square.map(|square| psnr_in(&square, size, picture, &colors)),
            psnr_hand: psnr.hand,
            ssim: mean_ssim(size[0] as usize, picture, &colors),
            lpips: None,
            bands: errors,
        }
    })
}

/// PSNR over a square, both pictures scaled, dB.
fn psnr_in(square: &Square, size: [u32; 2], picture: &[[u8; 3]], truth: &[[u8; 3]]) -> f64 {
    let scaled = |pixels: &[[u8; 3]]| {
        let opaque: Vec<[u8; 4]> = pixels.iter().map(|&[r, g, b]| [r, g, b, 255]).collect();
        square.scaled(&opaque, size, [0, 0, 0, 255])
    };
    let picture: Vec<[u8; 3]> = scaled(picture).iter().map(|&[r, g, b, _]| [r, g, b]).collect();
    psnr(&picture, &scaled(truth)).whole
}

/// Means over pictures; errors by band are means over pixels.
pub fn mean_similarity(all: &[ImageSimilarity]) -> ImageSimilarity {
    let mean = |value: fn(&ImageSimilarity) -> f64| all.iter().map(value).sum::<f64>() / all.len().max(1) as f64;
    let squares: Vec<f64> = all.iter().filter_map(|s| s.psnr_square).collect();
    let distances: Option<Vec<f64>> = all.iter().map(|s| s.lpips).collect();
    let mut bands = ErrorBands::default();
    all.iter().for_each(|one| bands.merge(&one.bands));
    ImageSimilarity {
        psnr: mean(|s| s.psnr),
        psnr_square: (!squares.is_empty()).then(|| squares.iter().sum::<f64>() / squares.len() as f64),
        psnr_hand: mean(|s| s.psnr_hand),
        ssim: mean(|s| s.ssim),
        lpips: distances.filter(|all| !all.is_empty()).map(|all| all.iter().sum::<f64>() / all.len() as f64),
        bands,
    }
}

//! The meaning of the values in a mask's file.

use image::DynamicImage;

/// A mask from a file.
pub(crate) struct MaskValues {
    /// Row-major; values of at least 128 are hand.
    pub values: Vec<u8>,
    pub sort: MaskSort,
}

/// What the values in a mask's file are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum MaskSort {
    /// At least 128 on the hand.
    Usual,
    /// 0 and this one, which is below 128 and counts as hand.
    Low(u8),
    /// Black everywhere: the alpha channel is the mask.
    Alpha,
    /// Several below 128, up to this: they do not say which is the hand.
    Labels(u8),
    /// None below this one, which is at least 128: they do not say what is not the hand.
    High(u8),
    /// Those of a photograph.
    Photo,
}

/// Most values of labels.
const MOST_LABELS: usize = 32;
/// A photograph has more values than this, and more than this part of its pixels that are not black far from white.
const MASK_VALUES: usize = 64;
const MOST_BETWEEN: f64 = 0.4;

/// The values of a mask, from any depth and colours of its file. The largest channel of a coloured mask counts, so that
/// a dark red label is hand just like white; transparent pixels are not.
///
/// In an integer mask with only 0 and one other value, this means hand. A 16-bit mask with all values below 256 was
/// converted from 8 bits without scaling.
pub(crate) fn mask_values(picture: DynamicImage) -> MaskValues {
    use DynamicImage::{ImageLuma16, ImageLumaA16, ImageRgb16, ImageRgb32F, ImageRgba16, ImageRgba32F};
    match picture {
        ImageRgb32F(_) | ImageRgba32F(_) => {
            let byte = |v: f32| (v * 255.0).round().clamp(0.0, 255.0) as u8;
            let values = picture.into_rgba32f().pixels().map(|p| byte(opaque_part(p.0, 1.0))).collect();
            MaskValues { values, sort: MaskSort::Usual }
        }
        ImageLuma16(_) | ImageLumaA16(_) | ImageRgb16(_) | ImageRgba16(_) => {
            let pixels: Vec<[f32; 4]> = picture.into_rgba16().pixels().map(|p| p.0.map(f32::from)).collect();
            let wide: Vec<f32> = pixels.iter().map(|p| opaque_part(*p, 65535.0)).collect();
            let largest = wide.iter().copied().fold(0.0, f32::max);
            let scale = if largest <= 255.0 { 1.0 } else { 257.0 };
            let alpha = || pixels.iter().map(|[.., a]| (a / 257.0).round() as u8).collect();
            of_bytes(wide.into_iter().map(|v| (v / scale).round() as u8).collect(), alpha)
        }
        // As most are: of one channel and opaque.
        DynamicImage::ImageLuma8(picture) => {
            let values = picture.into_raw();
            let count = values.len();
            of_bytes(values, || vec![255; count])
        }
        _ => {
            let pixels = picture.into_rgba8();
            let values = pixels.pixels().map(|p| opaque_part(p.0.map(f32::from), 255.0).round() as u8).collect();
            of_bytes(values, || pixels.pixels().map(|p| p.0[3]).collect())
        }
    }
}

/// The largest of red, green and blue, over black if alpha is less than `full`.
fn opaque_part([r, g, b, a]: [f32; 4], full: f32) -> f32 {
    let value = r.max(g).max(b);
    if a < full { value * a / full } else { value }
}

fn of_bytes(mut values: Vec<u8>, alpha: impl FnOnce() -> Vec<u8>) -> MaskValues {
    let mut sort = sort_of(&values);
    match sort {
        MaskSort::Low(_) => values.iter_mut().for_each(|value| *value = if *value > 0 { 255 } else { 0 }),
        MaskSort::Usual if values.iter().all(|value| *value == 0) => {
            let alpha = alpha();
            let has = |inside: bool| alpha.iter().any(|value| (*value >= 128) == inside);
            if has(true) && has(false) {
                (values, sort) = (alpha, MaskSort::Alpha);
            }
        }
        _ => {}
    }
    MaskValues { values, sort }
}

fn sort_of(values: &[u8]) -> MaskSort {
    let mut counts = [0_usize; 256];
    values.iter().for_each(|value| counts[usize::from(*value)] += 1);
    let present: Vec<u8> = (0..=255).filter(|value| counts[usize::from(*value)] > 0).collect();
    let [between, shown]: [usize; 2] = [240, 256].map(|end| counts[16..end].iter().sum());
    match present[..] {
        [0, high] if high < 128 => MaskSort::Low(high),
        [_, .., high] if high < 128 && present.len() <= MOST_LABELS => MaskSort::Labels(high),
        _ if present.len() > MASK_VALUES && between as f64 > MOST_BETWEEN * shown as f64 => MaskSort::Photo,
        [low, .., _] if low >= 128 => MaskSort::High(low),
        _ => MaskSort::Usual,
    }
}

#[cfg(test)]
mod tests {
    use super::MaskSort::{Alpha, High, Labels, Low, Photo, Usual};
    use super::*;
    use image::{GrayImage, ImageBuffer, Luma, Rgb, RgbImage, Rgba, RgbaImage};

    /// Which pixels are hand, and what the values are.
    fn hand(picture: impl Into<DynamicImage>) -> (Vec<bool>, MaskSort) {
        let mask = mask_values(picture.into());
        (mask.values.iter().map(|v| *v >= 128).collect(), mask.sort)
    }

    fn grey(values: [u8; 4]) -> GrayImage {
        GrayImage::from_raw(4, 1, values.to_vec()).unwrap()
    }

    fn wide(values: [u16; 4]) -> ImageBuffer<Luma<u16>, Vec<u16>> {
        ImageBuffer::from_raw(4, 1, values.to_vec()).unwrap()
    }

    #[test]
    fn the_hand_is_at_128_and_above() {
        assert_eq!(hand(grey([0, 127, 128, 255])), (vec![false, false, true, true], Usual));
        assert_eq!(hand(grey([0, 1, 2, 100])), (vec![false; 4], Labels(100)));
    }

    #[test]
    fn zero_and_one_are_off_and_on_and_an_empty_mask_stays_empty() {
        assert_eq!(hand(grey([0, 1, 1, 0])), (vec![false, true, true, false], Low(1)));
        assert_eq!(hand(grey([0; 4])), (vec![false; 4], Usual));
        assert_eq!(hand(wide([0, 1, 1, 0])), (vec![false, true, true, false], Low(1)));
    }

    #[test]
    fn sixteen_bits_are_scaled_unless_all_values_fit_into_eight() {
        assert_eq!(hand(wide([0, 32767, 32896, 65535])), (vec![false, false, true, true], Usual));
        assert_eq!(hand(wide([0, 127, 128, 255])), (vec![false, false, true, true], Usual));
    }

    #[test]
    fn floats_range_from_zero_to_one() {
        let mask = ImageBuffer::<Rgb<f32>, _>::from_fn(4, 1, |x, _| Rgb([[0.0, 0.4, 0.6, f32::NAN][x as usize]; 3]));
        assert_eq!(hand(mask), (vec![false, false, true, false], Usual));
    }

    #[test]
    fn coloured_labels_are_hand_and_transparent_pixels_are_not() {
        let labels =
            RgbImage::from_fn(4, 1, |x, _| Rgb([[0, 0, 0], [128, 0, 0], [0, 128, 0], [20, 20, 20]][x as usize]));
        assert_eq!(hand(labels), (vec![false, true, true, false], Usual));
        let alpha = [0, 127, 128, 255];
        let cut_out = RgbaImage::from_fn(4, 1, |x, _| Rgba([255, 255, 255, alpha[x as usize]]));
        assert_eq!(hand(cut_out), (vec![false, false, true, true], Usual));
    }

    #[test]
    fn other_values_are_named_for_what_they_are() {
        assert_eq!(hand(grey([0, 2, 2, 0])), (vec![false, true, true, false], Low(2)));
        assert_eq!(hand(grey([0, 100, 0, 0])), (vec![false, true, false, false], Low(100)));
        assert_eq!(hand(grey([0, 1, 2, 2])).1, Labels(2));
        assert_eq!(hand(grey([140, 255, 255, 140])).1, High(140));
        assert_eq!(hand(grey([255; 4])).1, Usual);
        let black = RgbaImage::from_fn(4, 1, |x, _| Rgba([0, 0, 0, [0, 255, 200, 0][x as usize]]));
        assert_eq!(hand(black), (vec![false, true, true, false], Alpha));
        assert_eq!(hand(RgbaImage::from_pixel(4, 1, Rgba([0, 0, 0, 255]))), (vec![false; 4], Usual));
        let photo = GrayImage::from_fn(64, 64, |x, y| Luma([(30 + 3 * x + (7 * y) % 13) as u8]));
        assert_eq!(hand(photo).1, Photo);
        // A probability, and the rings of a compression.
        let soft = GrayImage::from_fn(200, 20, |x, _| Luma([(12 * x).saturating_sub(1000).min(255) as u8]));
        assert_eq!(hand(soft).1, Usual);
    }
}

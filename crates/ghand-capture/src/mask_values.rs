//! The meaning of the values in a mask's file.

use image::DynamicImage;

/// A mask from a file.
pub(crate) struct MaskValues {
    /// Row-major; values of at least 128 are hand.
    pub values: Vec<u8>,
    /// Whether the file has 0 and 1 instead of 0 and 255. The 1 is converted to 255.
    pub is_zero_one: bool,
}

/// The values of a mask, from any depth and colours of its file. The largest channel of a coloured mask counts, so that
/// a dark red label is hand just like white; transparent pixels are not.
///
/// In an integer mask with only 0 and 1, 1 means hand. A 16-bit mask with all values below 256 was converted from 8
/// bits without scaling.
pub(crate) fn mask_values(picture: DynamicImage) -> MaskValues {
    use DynamicImage::{ImageLuma16, ImageLumaA16, ImageRgb16, ImageRgb32F, ImageRgba16, ImageRgba32F};
    match picture {
        ImageRgb32F(_) | ImageRgba32F(_) => {
            let byte = |v: f32| (v * 255.0).round().clamp(0.0, 255.0) as u8;
            let values = picture.into_rgba32f().pixels().map(|p| byte(opaque_part(p.0, 1.0))).collect();
            MaskValues { values, is_zero_one: false }
        }
        ImageLuma16(_) | ImageLumaA16(_) | ImageRgb16(_) | ImageRgba16(_) => {
            let wide: Vec<f32> =
                picture.into_rgba16().pixels().map(|p| opaque_part(p.0.map(f32::from), 65535.0)).collect();
            let largest = wide.iter().copied().fold(0.0, f32::max);
            let scale = if largest <= 255.0 { 1.0 } else { 257.0 };
            of_bytes(wide.into_iter().map(|v| (v / scale).round() as u8).collect())
        }
        _ => of_bytes(
            picture.into_rgba8().pixels().map(|p| opaque_part(p.0.map(f32::from), 255.0).round() as u8).collect(),
        ),
    }
}

/// The largest of red, green and blue, over black if alpha is less than `full`.
fn opaque_part([r, g, b, a]: [f32; 4], full: f32) -> f32 {
    let value = r.max(g).max(b);
    if a < full { value * a / full } else { value }
}

fn of_bytes(mut values: Vec<u8>) -> MaskValues {
    let is_zero_one = values.iter().max() == Some(&1);
    if is_zero_one {
        values.iter_mut().for_each(|value| *value *= 255);
    }
    MaskValues { values, is_zero_one }
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{GrayImage, ImageBuffer, Luma, Rgb, RgbImage, Rgba, RgbaImage};

    /// Which pixels are hand, and whether the mask had only 0 and 1.
    fn hand(picture: impl Into<DynamicImage>) -> (Vec<bool>, bool) {
        let mask = mask_values(picture.into());
        (mask.values.iter().map(|v| *v >= 128).collect(), mask.is_zero_one)
    }

    fn grey(values: [u8; 4]) -> GrayImage {
        GrayImage::from_raw(4, 1, values.to_vec()).unwrap()
    }

    fn wide(values: [u16; 4]) -> ImageBuffer<Luma<u16>, Vec<u16>> {
        ImageBuffer::from_raw(4, 1, values.to_vec()).unwrap()
    }

    #[test]
    fn the_hand_is_at_128_and_above() {
        assert_eq!(hand(grey([0, 127, 128, 255])), (vec![false, false, true, true], false));
        assert_eq!(hand(grey([0, 1, 2, 100])), (vec![false; 4], false));
    }

    #[test]
    fn zero_and_one_are_off_and_on_and_an_empty_mask_stays_empty() {
        assert_eq!(hand(grey([0, 1, 1, 0])), (vec![false, true, true, false], true));
        assert_eq!(hand(grey([0; 4])), (vec![false; 4], false));
        assert_eq!(hand(wide([0, 1, 1, 0])), (vec![false, true, true, false], true));
    }

    #[test]
    fn sixteen_bits_are_scaled_unless_all_values_fit_into_eight() {
        assert_eq!(hand(wide([0, 32767, 32896, 65535])), (vec![false, false, true, true], false));
        assert_eq!(hand(wide([0, 127, 128, 255])), (vec![false, false, true, true], false));
    }

    #[test]
    fn floats_range_from_zero_to_one() {
        let mask = ImageBuffer::<Rgb<f32>, _>::from_fn(4, 1, |x, _| Rgb([[0.0, 0.4, 0.6, f32::NAN][x as usize]; 3]));
        assert_eq!(hand(mask), (vec![false, false, true, false], false));
    }

    #[test]
    fn coloured_labels_are_hand_and_transparent_pixels_are_not() {
        let labels =
            RgbImage::from_fn(4, 1, |x, _| Rgb([[0, 0, 0], [128, 0, 0], [0, 128, 0], [20, 20, 20]][x as usize]));
        assert_eq!(hand(labels), (vec![false, true, true, false], false));
        let alpha = [0, 127, 128, 255];
        let cut_out = RgbaImage::from_fn(4, 1, |x, _| Rgba([255, 255, 255, alpha[x as usize]]));
        assert_eq!(hand(cut_out), (vec![false, false, true, true], false));
    }
}

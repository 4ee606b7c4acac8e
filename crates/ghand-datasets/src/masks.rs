//! Masks of the hand, from what data sets have.

use ghand_files::Value;
use image::{GrayImage, Luma, RgbImage, imageops};

use crate::DatasetError;
use crate::pictures::decoded;
use crate::sequence::Mask;
use crate::warp::{Warp, warped};

/// Pixels above this are the hand.
const HALF: u8 = 127;

impl Mask {
    /// The mask of an image of that size: 255 is the hand. Files of another size are stretched, if their proportions are the
    /// image's: HO-3D has some at half the size.
    pub fn load(&self, size: (u32, u32)) -> Result<GrayImage, DatasetError> {
        let (file, mask) = match self {
            Mask::Bright(file) => {
                let image = decoded(file)?;
                (file, of_pixels(&image, |[red, green, blue]| red.max(green).max(blue) > HALF))
            }
            Mask::Blue(file) => {
                let image = decoded(file)?;
                (file, of_pixels(&image, |[red, green, blue]| blue > HALF && red.max(green) <= HALF))
            }
            Mask::Label { file, array, label } => {
                let fail = |problem: String| DatasetError::file(file, problem);
                let value = Value::read(file).map_err(|error| fail(error.to_string()))?;
                let labels = value.get(array).and_then(Value::numbers);
                let labels = labels.ok_or_else(|| fail(format!("lacks the array {array:?}; download it again")))?;
                let [rows, columns] = labels.shape[..] else {
                    return Err(fail(format!("{array}: has the shape {:?}, expected two axes", labels.shape)));
                };
                let pixels = labels.values.iter().map(|value| if value == label { 255 } else { 0 }).collect();
                let mask = GrayImage::from_raw(columns as u32, rows as u32, pixels);
                (file, mask.ok_or_else(|| fail(format!("{array}: is too small")))?)
            }
        };
        if mask.dimensions() == size {
            return Ok(mask);
        }
        let (width, height) = mask.dimensions();
        if u64::from(width) * u64::from(size.1) != u64::from(height) * u64::from(size.0) || width == 0 {
            let problem = format!("is a mask of {width} x {height} pixels for an image of {} x {}", size.0, size.1);
            return Err(DatasetError::file(file, format!("{problem}; download both again")));
        }
        Ok(imageops::resize(&mask, size.0, size.1, imageops::FilterType::Nearest))
    }
}

fn of_pixels(image: &RgbImage, is_hand: impl Fn([u8; 3]) -> bool) -> GrayImage {
    GrayImage::from_fn(image.width(), image.height(), |x, y| {
        Luma([if is_hand(image.get_pixel(x, y).0) { 255 } else { 0 }])
    })
}

/// A mask as the sequence's camera sees it.
pub(crate) fn warped_mask(mask: &GrayImage, warp: &Warp, size: (u32, u32)) -> GrayImage {
    let grey = RgbImage::from_fn(mask.width(), mask.height(), |x, y| image::Rgb([mask.get_pixel(x, y).0[0]; 3]));
    of_pixels(&warped(&grey, warp, size), |[value, ..]| value > HALF)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    fn image(folder: &Path, name: &str, size: u32, pixel: impl Fn(u32, u32) -> [u8; 3]) -> std::path::PathBuf {
        let path = folder.join(name);
        RgbImage::from_fn(size, size, |x, y| image::Rgb(pixel(x, y))).save(&path).unwrap();
        path
    }

    #[test]
    fn a_mask_of_half_the_size_is_stretched_and_another_shape_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let colors = [[0, 0, 0], [0, 0, 255], [0, 255, 0], [255, 255, 255]];
        let path = image(folder.path(), "m.png", 2, |x, y| colors[(2 * y + x) as usize]);
        let mask = Mask::Blue(path.clone()).load((4, 4)).unwrap();
        let hand: Vec<(u32, u32)> =
            mask.enumerate_pixels().filter(|(_, _, p)| p.0[0] == 255).map(|(x, y, _)| (x, y)).collect();
        assert_eq!(hand, [(2, 0), (3, 0), (2, 1), (3, 1)]);
        let bright = Mask::Bright(path.clone()).load((2, 2)).unwrap();
        assert_eq!(bright.into_raw(), [0, 255, 255, 255]);
        let error = Mask::Blue(path).load((4, 3)).unwrap_err().to_string();
        assert!(error.contains("m.png: is a mask of 2 x 2 pixels for an image of 4 x 3"), "{error}");
    }
}

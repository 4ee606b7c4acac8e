//! Training views in memory, cropped to the hand.

use ghand_core::Camera;
use ghand_data::{Capture, CaptureError, Split};
use rayon::prelude::*;

/// One image of one frame, cropped to the hand.
#[derive(Debug, Clone)]
pub struct TrainView {
    /// Index of the camera in the capture.
    pub camera_index: usize,
    /// Position of the frame in the split.
    pub frame: usize,
    /// The camera of the cropped image.
    pub camera: Camera,
    /// Size of the crop, pixels.
    pub size: [u32; 2],
    /// Pixels of the crop: red, green, blue, mask.
    pub pixels: Vec<[u8; 4]>,
}

impl TrainView {
    /// The view at an integer fraction of its resolution, by box filter; what does not fill a whole pixel is cut off.
    pub fn reduced(&self, factor: u32) -> TrainView {
        let [width, height] = self.size;
        let size = [(width / factor).max(1), (height / factor).max(1)];
        let mut pixels = Vec::with_capacity((size[0] * size[1]) as usize);
        for y in 0..size[1] {
            for x in 0..size[0] {
                let (mut sum, mut n) = ([0u32; 4], 0);
                for sy in y * factor..((y + 1) * factor).min(height) {
                    for sx in x * factor..((x + 1) * factor).min(width) {
                        let pixel = self.pixels[(sy * width + sx) as usize];
                        sum.iter_mut().zip(pixel).for_each(|(s, p)| *s += u32::from(p));
                        n += 1;
                    }
                }
                pixels.push(sum.map(|s| ((s + n / 2) / n.max(1)) as u8));
            }
        }
        let scale = 1.0 / f64::from(factor);
        let camera = Camera {
            width: size[0],
            height: size[1],
            focal: self.camera.focal * scale,
            principal: self.camera.principal * scale,
            ..self.camera.clone()
        };
        TrainView { camera, size, pixels, ..*self }
    }
}

/// The box of the mask grown by `margin` pixels and cut at the image, as x, y, width, height; the whole image if the mask
/// is empty.
fn crop_box(pixels: &[[u8; 4]], width: u32, height: u32, margin: u32) -> [u32; 4] {
    let mut low = [u32::MAX; 2];
    let mut high = [0; 2];
    for (i, p) in pixels.iter().enumerate() {
        if p[3] >= 128 {
            let at = [i as u32 % width, i as u32 / width];
            for axis in 0..2 {
                low[axis] = low[axis].min(at[axis]);
                high[axis] = high[axis].max(at[axis]);
            }
        }
    }
    if low[0] > high[0] {
        return [0, 0, width, height];
    }
    let first = low.map(|v| v.saturating_sub(margin));
    [first[0], first[1], (high[0] + margin + 1).min(width) - first[0], (high[1] + margin + 1).min(height) - first[1]]
}

/// Loads and crops all views of a split, frames outermost.
///
/// # Errors
/// The first [`CaptureError`] among the images.
pub fn load_views(capture: &Capture, split: &Split, margin: u32) -> Result<Vec<TrainView>, CaptureError> {
    let pairs: Vec<(usize, usize)> =
        (0..split.frames.len()).flat_map(|f| split.cameras.iter().map(move |c| (f, *c))).collect();
    pairs
        .into_par_iter()
        .map(|(frame, camera_index)| {
            let view = capture.load_view(camera_index, split.frames[frame])?;
            let [x, y, width, height] = crop_box(&view.rgba, view.width, view.height, margin);
            let row = |r: u32| {
                let start = ((y + r) * view.width + x) as usize;
                view.rgba[start..start + width as usize].iter().copied()
            };
            Ok(TrainView {
                camera_index,
                frame,
                camera: capture.cameras[camera_index].cropped(x as i32, y as i32, width, height),
                size: [width, height],
                pixels: (0..height).flat_map(row).collect(),
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn crops_hold_the_mask_and_its_margin_and_stay_inside() {
        let mut pixels = vec![[0, 0, 0, 0]; 20 * 10];
        assert_eq!(crop_box(&pixels, 20, 10, 3), [0, 0, 20, 10]);
        pixels[4 * 20 + 6][3] = 255;
        pixels[6 * 20 + 9][3] = 255;
        assert_eq!(crop_box(&pixels, 20, 10, 2), [4, 2, 8, 7]);
        assert_eq!(crop_box(&pixels, 20, 10, 50), [0, 0, 20, 10]);
    }
}

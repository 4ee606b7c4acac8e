//! One image of a capture with its mask.

use ghand_core::Camera;
use image::{DynamicImage, ImageFormat};

use super::file::{Role, decode, read_bytes};
use super::mask_values::{MaskSort, MaskValues, mask_values};
use crate::capture::Capture;
use crate::error::CaptureError;
use crate::mask::{MaskMethod, made_mask, mask_by_colors, squared_distances};

/// One image of the capture with its mask.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct View {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Row-major display values: red, green and blue, and 255 where the mask says hand, 0 elsewhere. Colours are
    /// exactly those of the file, with these exceptions: images with an alpha channel are composited over the capture's
    /// background, the linear light of EXR is encoded as sRGB, images of cameras with distortion are undistorted
    /// and colours are corrected if the capture says so. Outside the mask there is the capture's background: what an image
    /// shows there is hidden, except for the soft edges of a hand that the image shows before that background.
    pub rgba: Vec<[u8; 4]>,
}

/// A view cropped to the hand.
#[derive(Debug, Clone, PartialEq)]
pub struct CroppedView {
    /// The camera of the cropped image; its size is that of the crop.
    pub camera: Camera,
    /// Pixels of the crop, as in [`View::rgba`].
    pub pixels: Vec<[u8; 4]>,
}

/// Observations made while reading a view.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct ViewNotes {
    /// Whether the hand is marked: by a mask, or by an alpha channel that is not opaque everywhere.
    pub has_mask: bool,
    /// What the values in the mask's file are.
    pub mask_sort: MaskSort,
    /// Pixels of the image's file with a channel that is not a number. Such channels are black.
    pub nan_pixels: usize,
    /// The largest difference of two values of a channel in what the image shows, surroundings and all.
    pub contrast: u8,
    /// The one colour that the image has beside the hand, if it is another than the background.
    pub other_background: Option<[u8; 3]>,
}

impl View {
    /// The view cropped to the box of its mask, grown by `margin` pixels; the whole view if the mask is empty. `camera`
    /// is the view's.
    pub fn cropped(&self, camera: &Camera, margin: u32) -> CroppedView {
        let [x, y, width, height] = crop_box(&self.rgba, self.width, self.height, margin);
        let rows = self.rgba.chunks_exact(self.width.max(1) as usize).skip(y as usize).take(height as usize);
        let pixels = rows.flat_map(|row| row.iter().skip(x as usize).take(width as usize).copied()).collect();
        CroppedView { camera: camera.cropped(x as i32, y as i32, width, height), pixels }
    }
}

/// The box of the mask, grown by `margin` pixels and clipped to the image, as x, y, width, height; the whole image if
/// the mask is empty.
fn crop_box(pixels: &[[u8; 4]], width: u32, height: u32, margin: u32) -> [u32; 4] {
    let mut low = [u32::MAX; 2];
    let mut high = [0; 2];
    for (y, row) in (0..).zip(pixels.chunks_exact(width.max(1) as usize)) {
        let on_hand = |p: &[u8; 4]| p[3] >= 128;
        let Some(first) = row.iter().position(on_hand) else { continue };
        let last = row.iter().rposition(on_hand).unwrap_or(first);
        low = [low[0].min(first as u32), low[1].min(y)];
        high = [high[0].max(last as u32), y];
    }
    if low[0] > high[0] {
        return [0, 0, width, height];
    }
    let first = low.map(|v| v.saturating_sub(margin));
    let end = |axis: usize, size: u32| high[axis].saturating_add(margin).saturating_add(1).min(size);
    [first[0], first[1], end(0, width) - first[0], end(1, height) - first[1]]
}

impl Capture {
    /// Reads the image and the mask of a camera and a frame (indices). Pairs that are not in any split may have no
    /// file.
    ///
    /// # Errors
    /// [`CaptureError`] if there is no such camera or frame, or a file is missing, broken or not of the camera's size.
    pub fn load_view(&self, camera: usize, frame: usize) -> Result<View, CaptureError> {
        self.load_view_with_notes(camera, frame).map(|(view, _)| view)
    }

    /// The mask of a camera and a frame alone, row-major: as in [`Capture::load_view`], but the image is read only if it
    /// is needed for the mask.
    ///
    /// # Errors
    /// As [`Capture::load_view`].
    pub fn load_hand_mask(&self, camera: usize, frame: usize) -> Result<Vec<bool>, CaptureError> {
        let size = self.camera_and_frame(camera, frame).map(|(c, _)| (c.width, c.height))?;
        if self.distortion.get(camera).copied().flatten().is_none()
            && let Some(mask) = self.load_mask(camera, frame, size)?
        {
            return Ok(mask.values.iter().map(|value| *value >= 128).collect());
        }
        Ok(self.load_view(camera, frame)?.rgba.iter().map(|pixel| pixel[3] >= 128).collect())
    }

    /// Like [`Capture::load_view`], with observations.
    pub(crate) fn load_view_with_notes(&self, camera: usize, frame: usize) -> Result<(View, ViewNotes), CaptureError> {
        let size = self.camera_and_frame(camera, frame).map(|(c, _)| (c.width, c.height))?;
        let file = self.image_file(camera, frame)?;
        let bytes = read_bytes(&file, Role::Image, size)?;
        let picture = decode(&file, Role::Image, &bytes, size)?;
        let nan_pixels = nan_pixels(&picture);
        let mut rgba = self.display_values(picture, &bytes);
        let mut mask = self.load_mask(camera, frame, size)?;
        let made = self.images.made_masks.as_ref().filter(|_| mask.is_none());
        if made.is_some_and(|made| made.method == MaskMethod::Outline) {
            let values = made_mask(self, camera, frame, &bytes, &rgba)?;
            mask = Some(MaskValues { values, sort: MaskSort::Usual });
        }
        let mask_sort = mask.as_ref().map_or(MaskSort::Usual, |mask| mask.sort);
        let mut has_mask = mask.is_some();
        if let Some(mask) = mask {
            rgba.iter_mut().zip(mask.values).for_each(|(pixel, mask)| pixel[3] = mask);
        }
        let cut = |rgba: &mut [[u8; 4]]| {
            rgba.iter_mut().for_each(|pixel| pixel[3] = if pixel[3] >= 128 { 255 } else { 0 });
        };
        if made.is_some() {
            self.leave_out_other_hands(camera, frame, &mut rgba)?;
        }
        cut(&mut rgba);
        has_mask |= rgba.iter().any(|pixel| pixel[3] == 0);
        let [r, g, b] = self.background.map(|v| (v * 255.0).round() as u8);
        rgba = self.undistorted(camera, rgba)?;
        cut(&mut rgba);
        if let Some(made) = made.filter(|made| made.method == MaskMethod::Colors) {
            let values = mask_by_colors(self, made, camera, frame, &bytes, &rgba)?;
            rgba.iter_mut().zip(values).for_each(|(pixel, mask)| pixel[3] = mask);
            has_mask = true;
        }
        let hide = shows_surroundings(&rgba, size.0 as usize, [r, g, b]);
        let other_background = (hide && has_mask)
            .then(|| usual_surroundings(&rgba))
            .filter(|color| !shows_surroundings(&rgba, size.0 as usize, *color));
        let wrist = self.wrist_pixels(camera, frame, &rgba)?;
        wrist.cut(&mut rgba);
        self.color_correction.apply(camera, [r, g, b], &mut rgba);
        let contrast = contrast(&rgba);
        if hide {
            rgba.iter_mut().filter(|pixel| pixel[3] == 0).for_each(|pixel| *pixel = [r, g, b, 0]);
        }
        wrist.hide([r, g, b], &mut rgba);
        let notes = ViewNotes { has_mask, mask_sort, nan_pixels, contrast, other_background };
        Ok((View { width: size.0, height: size.1, rgba }, notes))
    }

    /// The pixels of a camera's image without the distortion of its lens; alpha is 0 outside what the camera sees.
    fn undistorted(&self, camera: usize, rgba: Vec<[u8; 4]>) -> Result<Vec<[u8; 4]>, CaptureError> {
        let Some(distortion) = self.distortion.get(camera).copied().flatten() else { return Ok(rgba) };
        let camera = self.cameras.get(camera).ok_or_else(|| self.absent("cameras", camera, self.cameras.len()))?;
        let [r, g, b] = self.background.map(|v| (v * 255.0).round() as u8);
        Ok(distortion.undistorted(camera, &rgba, [r, g, b, 0]))
    }

    /// An image alone, as in [`Capture::load_view`] but for its mask: alpha is 0 outside what the camera sees.
    pub(crate) fn undistorted_image(&self, camera: usize, frame: usize) -> Result<Vec<[u8; 4]>, CaptureError> {
        let size = self.camera_and_frame(camera, frame).map(|(c, _)| (c.width, c.height))?;
        let file = self.image_file(camera, frame)?;
        let bytes = read_bytes(&file, Role::Image, size)?;
        let mut rgba = self.display_values(decode(&file, Role::Image, &bytes, size)?, &bytes);
        self.leave_out_other_hands(camera, frame, &mut rgba)?;
        self.undistorted(camera, rgba)
    }

    /// Makes the alpha of pixels 0 where another hand is: as outside what the camera sees.
    fn leave_out_other_hands(&self, camera: usize, frame: usize, rgba: &mut [[u8; 4]]) -> Result<(), CaptureError> {
        let size = self.camera_and_frame(camera, frame).map(|(c, _)| (c.width, c.height))?;
        let Some(file) = self.other_hands_file(camera, frame)? else { return Ok(()) };
        let bytes = read_bytes(&file, Role::Mask, size)?;
        let others = mask_values(decode(&file, Role::Mask, &bytes, size)?).values;
        rgba.iter_mut().zip(others).filter(|(_, value)| *value >= 128).for_each(|(pixel, _)| pixel[3] = 0);
        Ok(())
    }

    /// The mask from its file, if the capture has masks. `None` for a missing mask that can be made.
    pub(crate) fn load_mask(
        &self,
        camera: usize,
        frame: usize,
        size: (u32, u32),
    ) -> Result<Option<MaskValues>, CaptureError> {
        let Some(file) = self.mask_file(camera, frame)? else { return Ok(None) };
        if self.images.made_masks.is_some() && !file.exists() {
            return Ok(None);
        }
        let bytes = read_bytes(&file, Role::Mask, size)?;
        Ok(Some(mask_values(decode(&file, Role::Mask, &bytes, size)?)))
    }

    /// Pixels of an image over the background; alpha as in the file, 255 if it has none.
    pub(crate) fn display_values(&self, picture: DynamicImage, file: &[u8]) -> Vec<[u8; 4]> {
        let picture = match image::guess_format(file) {
            Ok(ImageFormat::OpenExr) => encoded(&picture),
            _ => picture,
        };
        if !picture.color().has_alpha() {
            return picture.into_rgb8().pixels().map(|p| [p.0[0], p.0[1], p.0[2], 255]).collect();
        }
        let blend = |value: u8, alpha: u8, behind: f64| {
            let alpha = f64::from(alpha) / 255.0;
            (f64::from(value) * alpha + behind * (1.0 - alpha)).round().clamp(0.0, 255.0) as u8
        };
        let [r0, g0, b0] = self.background.map(|b| b * 255.0);
        (picture.into_rgba8().pixels())
            .map(|p| {
                let [r, g, b, a] = p.0;
                [blend(r, a, r0), blend(g, a, g0), blend(b, a, b0), a]
            })
            .collect()
    }
}

/// The largest difference of two values of a channel.
fn contrast(rgba: &[[u8; 4]]) -> u8 {
    let range = |channel: usize| {
        let values = || rgba.iter().map(|pixel| pixel[channel]);
        values().max().unwrap_or(0) - values().min().unwrap_or(0)
    };
    range(0).max(range(1)).max(range(2))
}

/// Pixels outside a mask that are nearer than the sum of these to it may be edges of the hand, or parts of it that the mask
/// lacks: pixels, and a part of the square root of the mask's area.
const EDGE: f64 = 2.5;
const WRONG_MASK: f64 = 0.1;
/// Channels of the background's colour differ by no more than this from it, by lossy compression.
const LIKE_BACKGROUND: u8 = 16;
/// Part of an image outside its mask that may have other colours: wrong pixels of a mask, and of the compression.
const OTHER_COLORS: f64 = 0.002;

/// Whether an image (red, green, blue, mask 0 or 255) shows anything but the background away from the hand. If it does not, its
/// edges are mixed of hand and background, and stay, and so does what a mask lacks; else they are mixed of hand and surroundings.
fn shows_surroundings(rgba: &[[u8; 4]], width: usize, background: [u8; 3]) -> bool {
    let width = width.max(1);
    let outside = rgba.iter().filter(|pixel| pixel[3] == 0).count();
    let near = EDGE + WRONG_MASK * ((rgba.len() - outside) as f64).sqrt();
    let allowed = (OTHER_COLORS * outside as f64) as usize;
    let is_other = |pixel: &[u8; 4]| {
        pixel[3] == 0 && (0..3).any(|channel| pixel[channel].abs_diff(background[channel]) > LIKE_BACKGROUND)
    };
    let margin = near.ceil() as u32 + 1;
    let height = rgba.len() / width;
    let [left, top, columns, rows] = crop_box(rgba, width as u32, height as u32, margin).map(|v| v as usize);
    let is_within =
        |i: usize| (left..left + columns).contains(&(i % width)) && (top..top + rows).contains(&(i / width));
    let far = rgba.iter().enumerate().filter(|(i, pixel)| is_other(pixel) && !is_within(*i)).take(allowed + 1).count();
    if far > allowed {
        return true;
    }
    let inside: Vec<&[u8; 4]> = (top..top + rows).flat_map(|y| &rgba[y * width + left..][..columns]).collect();
    let start = inside.iter().map(|pixel| if pixel[3] == 0 { f64::INFINITY } else { 0.0 }).collect();
    let distances = squared_distances(start, [columns, rows]);
    let others = inside.iter().zip(&distances).filter(|(pixel, squared)| **squared > near.powi(2) && is_other(pixel));
    far + others.count() > allowed
}

/// The median of each channel outside the mask; black without pixels there.
fn usual_surroundings(rgba: &[[u8; 4]]) -> [u8; 3] {
    let mut counts = [[0usize; 256]; 3];
    let mut all = 0;
    for pixel in rgba.iter().filter(|pixel| pixel[3] == 0) {
        all += 1;
        counts.iter_mut().zip(pixel).for_each(|(counts, value)| counts[usize::from(*value)] += 1);
    }
    counts.map(|counts| {
        let mut below = 0;
        let middle = counts.iter().position(|count| {
            below += count;
            2 * below > all
        });
        middle.unwrap_or(0) as u8
    })
}

/// Number of pixels with a NaN channel.
fn nan_pixels(picture: &DynamicImage) -> usize {
    let count = |values: &[f32], channels: usize| {
        values.chunks_exact(channels).filter(|pixel| pixel.iter().any(|v| v.is_nan())).count()
    };
    match picture {
        DynamicImage::ImageRgb32F(image) => count(image.as_raw(), 3),
        DynamicImage::ImageRgba32F(image) => count(image.as_raw(), 4),
        _ => 0,
    }
}

/// Converts an EXR's linear light with premultiplied alpha to display values with straight alpha.
fn encoded(picture: &DynamicImage) -> DynamicImage {
    let byte = |v: f32| (v * 255.0).round().clamp(0.0, 255.0) as u8;
    let encode = |linear: f32| {
        let linear = linear.clamp(0.0, 1.0);
        byte(if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 })
    };
    if !picture.color().has_alpha() {
        let linear = picture.to_rgb32f();
        let pixels = linear.pixels().flat_map(|p| p.0.map(encode)).collect();
        return image::RgbImage::from_raw(linear.width(), linear.height(), pixels).unwrap_or_default().into();
    }
    let linear = picture.to_rgba32f();
    let straight = linear.pixels().flat_map(|p| {
        let [r, g, b, a] = p.0;
        let alpha = if a > 0.0 { a } else { 1.0 };
        [encode(r / alpha), encode(g / alpha), encode(b / alpha), byte(a)]
    });
    image::RgbaImage::from_raw(linear.width(), linear.height(), straight.collect()).unwrap_or_default().into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn crops_contain_the_mask_and_its_margin_and_stay_inside() {
        let mut pixels = vec![[0, 0, 0, 0]; 20 * 10];
        assert_eq!(crop_box(&pixels, 20, 10, 3), [0, 0, 20, 10]);
        pixels[4 * 20 + 6][3] = 255;
        pixels[6 * 20 + 9][3] = 255;
        assert_eq!(crop_box(&pixels, 20, 10, 2), [4, 2, 8, 7]);
        assert_eq!(crop_box(&pixels, 20, 10, u32::MAX), [0, 0, 20, 10]);
        pixels[5 * 20 + 3][3] = 255;
        assert_eq!(crop_box(&pixels, 20, 10, 0), [3, 4, 7, 3]);
        let camera = Camera::look_at(glam::DVec3::NEG_Z, glam::DVec3::ZERO, glam::DVec3::Y, 0.5, 20, 10);
        let crop = View { width: 20, height: 10, rgba: pixels.clone() }.cropped(&camera, 0);
        assert_eq!((crop.camera.width, crop.camera.height, crop.pixels.len()), (7, 3, 21));
        assert_eq!(crop.camera.principal, camera.principal - glam::DVec2::new(3.0, 4.0));
        assert_eq!((crop.pixels[3][3], crop.pixels[7][3], crop.pixels[20][3]), (255, 255, 255));
    }

    #[test]
    fn a_desk_is_surroundings_and_the_soft_edge_of_a_hand_is_not() {
        // A hand of 20 x 20 pixels in 60 x 60, with a half covered edge.
        let image = |beside: [u8; 3]| -> Vec<[u8; 4]> {
            let pixel = |i: usize| {
                let (x, y) = (i % 60, i / 60);
                let within = |low: usize, high: usize| (low..high).contains(&x) && (low..high).contains(&y);
                match (within(20, 40), within(19, 41)) {
                    (true, _) => [200, 150, 120, 255],
                    (_, true) => [90, 70, 60, 0],
                    _ => [beside[0], beside[1], beside[2], 0],
                }
            };
            (0..3600).map(pixel).collect()
        };
        assert!(!shows_surroundings(&image([0; 3]), 60, [0; 3]));
        // Noise of the compression.
        assert!(!shows_surroundings(&image([9, 3, 14]), 60, [0; 3]));
        assert!(shows_surroundings(&image([180, 170, 160]), 60, [0; 3]));
        assert!(shows_surroundings(&image([0; 3]), 60, [255; 3]));
        // A mask that is too small by 2 pixels, a tenth of its size.
        let mut eroded = image([0; 3]);
        for (i, pixel) in eroded.iter_mut().enumerate() {
            let (x, y) = (i % 60, i / 60);
            pixel[3] = if (22..38).contains(&x) && (22..38).contains(&y) { 255 } else { 0 };
        }
        assert!(!shows_surroundings(&eroded, 60, [0; 3]));
        // A forearm.
        let mut arm = image([0; 3]);
        (41..60).for_each(|y| (25..35).for_each(|x| arm[y * 60 + x] = [200, 150, 120, 0]));
        assert!(shows_surroundings(&arm, 60, [0; 3]));
        // A small thing on an empty table.
        let mut thing = image([0; 3]);
        (0..12).for_each(|x| thing[3 * 60 + x] = [0, 200, 0, 0]);
        assert!(shows_surroundings(&thing, 60, [0; 3]));
        assert!(!shows_surroundings(&[[7, 7, 7, 255]; 9], 3, [0; 3]));
    }
}

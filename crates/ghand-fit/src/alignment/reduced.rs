//! The images of a capture at the size at which hands are fitted.
//!
//! Distances within which contours are matched, and how far off they may be, are in pixels: of hands a few
//! hundred pixels long. Images of larger ones are reduced by a whole number, for each camera its own.

use ghand_capture::{Capture, CaptureError, Split, SplitView, View};
use ghand_core::Camera;
use rayon::prelude::*;

use super::Calibration;
use super::cameras::unknowns::Part;
use super::fit::quantiles;
use super::outlines::distance_field::DistanceField;
use crate::views::{reduced, reduced_camera};

/// The largest hand that is fitted as it is, as the square root of its mask's area, pixels: of 110 to 280 pixels hands are
/// fitted alike, of 420 worse.
const LARGEST_HAND: f64 = 300.0;
/// Masks of each camera that tell how large its hands are.
const MASKS: usize = 5;

/// See the module.
pub(super) struct Reduced<'a> {
    capture: &'a Capture,
    /// The cameras of the reduced images.
    pub cameras: Vec<Camera>,
    /// Pixels of an image's side per pixel of the reduced one's, by camera.
    by: Vec<u32>,
}

impl<'a> Reduced<'a> {
    /// By the hands in a split.
    ///
    /// # Errors
    /// [`CaptureError`] if a mask is unusable.
    pub fn new(capture: &'a Capture, split: &Split) -> Result<Reduced<'a>, CaptureError> {
        let by = (0..capture.cameras.len()).into_par_iter().map(|camera| {
            let views: Vec<&SplitView> = split.views.iter().filter(|view| view.camera == camera).collect();
            let some = (0..views.len().min(MASKS)).map(|k| views[k * views.len() / views.len().min(MASKS)]);
            let size = |view: &SplitView| -> Result<f64, CaptureError> {
                let mask = capture.load_hand_mask(view.camera, view.frame)?;
                Ok((mask.iter().filter(|inside| **inside).count() as f64).sqrt())
            };
            let sizes: Vec<f64> = some.map(size).collect::<Result<_, _>>()?;
            let [median, _] = quantiles(sizes.into_iter().filter(|size| *size > 0.0).collect());
            Ok((median / LARGEST_HAND).ceil().max(1.0) as u32)
        });
        let by: Vec<u32> = by.collect::<Result<_, CaptureError>>()?;
        let cameras = capture.cameras.iter().zip(&by).map(|(camera, by)| reduced_camera(camera, *by));
        Ok(Reduced { capture, cameras: cameras.collect(), by })
    }

    /// Pixels of an image's side per pixel of the reduced one's: the median over the cameras.
    pub fn usual(&self) -> f64 {
        quantiles(self.by.iter().map(|by| f64::from(*by)).collect())[0]
    }

    /// Other cameras of the reduced images, for the images as they are.
    pub fn full_size(&self, cameras: Vec<Camera>) -> Vec<Camera> {
        let full = |((camera, given), by): ((Camera, &Camera), &u32)| Camera {
            width: given.width,
            height: given.height,
            focal: camera.focal * f64::from(*by),
            principal: camera.principal * f64::from(*by),
            ..camera
        };
        cameras.into_iter().zip(&self.capture.cameras).zip(&self.by).map(full).collect()
    }

    /// A calibration of the reduced images' cameras, for the images as they are.
    pub fn full_size_calibration(&self, mut found: Calibration) -> Calibration {
        for (change, by) in found.changes.iter_mut().zip(&self.by) {
            change[Part::PrincipalPoint.places()].iter_mut().for_each(|pixels| *pixels *= f64::from(*by));
        }
        found
    }

    /// As [`Capture::load_view`].
    ///
    /// # Errors
    /// As [`Capture::load_view`].
    pub fn view(&self, camera: usize, frame: usize) -> Result<View, CaptureError> {
        let mut view = self.capture.load_view(camera, frame)?;
        let by = self.by[camera];
        if by > 1 {
            let (rgba, [width, height]) = reduced(&view.rgba, [view.width, view.height], by);
            view = View { rgba: rgba.into_iter().map(|[r, g, b, a]| [r, g, b, half(a)]).collect(), width, height };
        }
        Ok(view)
    }

    /// As [`Capture::load_hand_mask`]: pixels of which at least half is the hand's.
    ///
    /// # Errors
    /// As [`Capture::load_hand_mask`].
    pub fn mask(&self, camera: usize, frame: usize) -> Result<Vec<bool>, CaptureError> {
        let mask = self.capture.load_hand_mask(camera, frame)?;
        let by = self.by[camera];
        if by == 1 {
            return Ok(mask);
        }
        let Camera { width, height, .. } = self.capture.cameras[camera];
        let values: Vec<[u8; 4]> = mask.into_iter().map(|inside| [0, 0, 0, if inside { 255 } else { 0 }]).collect();
        Ok(reduced(&values, [width, height], by).0.into_iter().map(|[.., a]| half(a) == 255).collect())
    }

    /// The field of a mask; `None` if it has no outline.
    ///
    /// # Errors
    /// As [`Capture::load_hand_mask`].
    pub fn field(&self, camera: usize, frame: usize) -> Result<Option<DistanceField>, CaptureError> {
        let mask = self.capture.load_hand_mask(camera, frame)?;
        let width = self.capture.cameras[camera].width as usize;
        Ok(DistanceField::of_mask(&mask, width, self.by[camera] as usize))
    }

    /// The fields of some views.
    ///
    /// # Errors
    /// As [`Capture::load_hand_mask`].
    pub fn fields(&self, views: &[SplitView]) -> Result<Vec<Option<DistanceField>>, CaptureError> {
        views.par_iter().map(|view| self.field(view.camera, view.frame)).collect()
    }
}

/// A mask's value: hand from one half on.
fn half(mean: u8) -> u8 {
    if mean >= 128 { 255 } else { 0 }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use ghand_capture::capture::{Frame, HandModelSource, ImagePaths};
    use ghand_core::Side;
    use ghand_hand_model::builtin::builtin_hand;
    use glam::{DVec2, DVec3};

    use super::*;
    use crate::alignment::cameras::unknowns::NUMBERS;

    /// Two cameras that see a square, of 390 pixels a side and of 40.
    fn capture(root: &Path) -> Capture {
        let model = builtin_hand(Side::Right).unwrap();
        let camera = |(name, size): (&str, u32)| {
            let mask = image::GrayImage::from_fn(2 * size + 21, 2 * size + 11, |x, y| {
                image::Luma([if (4..4 + size).contains(&x) && (8..8 + size).contains(&y) { 255 } else { 0 }])
            });
            image::RgbImage::from_pixel(mask.width(), mask.height(), image::Rgb([90, 80, 70]))
                .save(root.join(format!("{name}.png")))
                .unwrap();
            mask.save(root.join(format!("{name}_mask.png"))).unwrap();
            let camera = Camera::look_at(DVec3::NEG_Z, DVec3::ZERO, DVec3::Y, 0.5, mask.width(), mask.height());
            Camera { id: name.into(), ..camera }
        };
        Capture {
            root: root.into(),
            side: Side::Right,
            background: [0.0; 3],
            template: model.clone(),
            hand_model: model,
            hand_model_source: HandModelSource::Builtin,
            cameras: [("near", 390), ("far", 40)].map(camera).into(),
            distortion: vec![],
            color_correction: Default::default(),
            frames: vec![Frame { id: "0".into(), pose: ghand_core::Pose::rest(1), shape: vec![] }],
            images: ImagePaths::plain("{camera}.png", Some("{camera}_mask.png")),
            splits: [("train".to_owned(), Split::product(vec![0, 1], vec![0]))].into(),
            truth: None,
        }
    }

    #[test]
    fn large_hands_are_reduced_and_what_is_found_is_of_the_images_as_they_are() {
        let folder = tempfile::tempdir().unwrap();
        let capture = capture(folder.path());
        let split = capture.split("train").unwrap();
        let reduced = Reduced::new(&capture, split).unwrap();
        let sizes: Vec<[u32; 2]> = reduced.cameras.iter().map(|camera| [camera.width, camera.height]).collect();
        assert_eq!(sizes, [[400, 395], [101, 91]]);
        // A point is seen at the same place of both images.
        let point = DVec3::new(0.02, -0.03, 0.01);
        let [full, small] = [&capture.cameras[0], &reduced.cameras[0]].map(|camera| camera.project(point).0);
        assert!((full - 2.0 * small).length() < 1e-9, "{full} {small}");
        let fields = reduced.fields(&split.views).unwrap();
        for (field, size) in fields.into_iter().zip([390.0, 40.0]) {
            let field = field.unwrap();
            // Its corners are rounded.
            let found = (field.area() as f64).sqrt() * field.image_pixels;
            assert!((found - size).abs() < 1.0, "{found} of {size}");
        }
        // Left of the square, which begins at column 4 of the image, 2 of the reduced one.
        let field = reduced.field(0, 0).unwrap().unwrap();
        assert!((field.at(DVec2::new(1.0, 100.0)).unwrap().0 - 1.0).abs() < 0.01);
        let view = reduced.view(0, 0).unwrap();
        let mask: Vec<bool> = view.rgba.iter().map(|pixel| pixel[3] == 255).collect();
        assert_eq!([view.width, view.height], sizes[0]);
        assert!(mask == reduced.mask(0, 0).unwrap());
        // Cameras that are refined are those of the images.
        let change: [f64; NUMBERS] = [0.01, 0.02, -0.01, 0.001, 0.002, 0.003, 0.02, 3.0, -5.0, 0.0];
        let found = Calibration { parts: vec![], changes: vec![change; 2], moved: vec![], left_out: [0.0; 2] };
        let of_reduced = reduced.full_size(found.applied_to(&reduced.cameras));
        let of_images = reduced.full_size_calibration(found).applied_to(&capture.cameras);
        for (a, b) in of_reduced.iter().zip(&of_images) {
            assert!((a.project(point).0 - b.project(point).0).length() < 1e-9);
            assert_eq!([a.width, a.height], [b.width, b.height]);
        }
    }
}

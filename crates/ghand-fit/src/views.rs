//! Training views, cropped to the hand, from a store that keeps a bounded part of them in memory.

use std::sync::OnceLock;

use ghand_capture::{Capture, CaptureError, CroppedView, Split, SplitView, ViewStore, ViewStoreOptions};
use ghand_core::Camera;

use crate::sharpness::{sharpness, weights};

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
    /// The view at an integer fraction of its resolution, by box filter; partial pixels at the edges are dropped.
    pub fn reduced(&self, factor: u32) -> TrainView {
        let (pixels, size) = reduced(&self.pixels, self.size, factor);
        let camera = reduced_camera(&self.camera, factor);
        TrainView { camera, size, pixels, ..*self }
    }
}

/// The camera of images at an integer fraction of their resolution; partial pixels at the right and below are dropped.
pub fn reduced_camera(camera: &Camera, factor: u32) -> Camera {
    let scale = 1.0 / f64::from(factor);
    Camera {
        width: (camera.width / factor).max(1),
        height: (camera.height / factor).max(1),
        focal: camera.focal * scale,
        principal: camera.principal * scale,
        ..camera.clone()
    }
}

/// An image at an integer fraction of its resolution, by box filter, and its size.
pub fn reduced(pixels: &[[u8; 4]], [width, height]: [u32; 2], factor: u32) -> (Vec<[u8; 4]>, [u32; 2]) {
    let size = [(width / factor).max(1), (height / factor).max(1)];
    let mut out = Vec::with_capacity((size[0] * size[1]) as usize);
    for y in 0..size[1] {
        for x in 0..size[0] {
            let mut sum = [0u32; 4];
            let mut n = 0;
            for sy in y * factor..((y + 1) * factor).min(height) {
                for sx in x * factor..((x + 1) * factor).min(width) {
                    let pixel = pixels[(sy * width + sx) as usize];
                    sum.iter_mut().zip(pixel).for_each(|(s, p)| *s += u32::from(p));
                    n += 1;
                }
            }
            out.push(sum.map(|s| ((s + n / 2) / n.max(1)) as u8));
        }
    }
    (out, size)
}

/// The views of a split. The trainer decides in which order they are used.
pub struct TrainViews {
    store: ViewStore,
    views: Vec<SplitView>,
    /// Width and height of the largest crop.
    largest: [u32; 2],
    /// See [`TrainViews::weights`].
    weights: OnceLock<Vec<f64>>,
}

impl TrainViews {
    /// Decodes every view of a split once, so that a broken image fails here and not in the middle of training, and
    /// keeps as many as fit.
    ///
    /// # Errors
    /// [`CaptureError`] if one of the images is unusable.
    pub fn new(capture: &Capture, split: &Split, margin: u32) -> Result<TrainViews, CaptureError> {
        let store = ViewStore::new(capture, &ViewStoreOptions { margin, ..Default::default() })?;
        let pairs: Vec<(usize, usize)> = split.views.iter().map(|v| (v.camera, v.frame)).collect();
        let sizes = store.map(&pairs, |view| [view.camera.width, view.camera.height])?;
        let largest = [0, 1].map(|axis| sizes.iter().map(|size| size[axis]).max().unwrap_or(1));
        Ok(TrainViews { store, views: split.views.clone(), largest, weights: OnceLock::new() })
    }

    /// Number of views.
    pub fn len(&self) -> usize {
        self.views.len()
    }

    /// Whether there are no views.
    pub fn is_empty(&self) -> bool {
        self.views.is_empty()
    }

    /// Position in the split of the frame of a view.
    pub fn position(&self, index: usize) -> Option<usize> {
        self.views.get(index).map(|view| view.position)
    }

    /// Width and height of the largest view at an integer fraction of the resolution.
    pub fn largest(&self, reduction: u32) -> [u32; 2] {
        self.largest.map(|size| (size / reduction.max(1)).max(1))
    }

    /// One view at an integer fraction of its resolution.
    ///
    /// # Errors
    /// [`CaptureError`] if the image has become unreadable.
    pub fn get(&self, index: usize, reduction: u32) -> Result<TrainView, CaptureError> {
        let SplitView { position, frame, camera } = self.views[index];
        let view = self.store.get(camera, frame)?;
        let train_view = TrainView {
            camera_index: camera,
            frame: position,
            size: [view.camera.width, view.camera.height],
            camera: view.camera.clone(),
            pixels: view.pixels.clone(),
        };
        Ok(if reduction > 1 { train_view.reduced(reduction) } else { train_view })
    }

    /// How much each view counts, 0.1 to 1: less where it is blurred.
    ///
    /// # Errors
    /// [`CaptureError`] if an image has become unreadable.
    pub fn weights(&self) -> Result<&[f64], CaptureError> {
        if let Some(known) = self.weights.get() {
            return Ok(known);
        }
        let pairs: Vec<(usize, usize)> = self.views.iter().map(|v| (v.camera, v.frame)).collect();
        let sharpness = |view: &CroppedView| sharpness(&view.pixels, [view.camera.width, view.camera.height]);
        let views = pairs.iter().map(|(camera, _)| *camera).zip(self.store.map(&pairs, sharpness)?);
        Ok(self.weights.get_or_init(|| weights(&views.collect::<Vec<_>>())))
    }

    /// How many views are so blurred that they count less than half.
    ///
    /// # Errors
    /// As for [`TrainViews::weights`].
    pub fn blurred(&self) -> Result<usize, CaptureError> {
        Ok(self.weights()?.iter().filter(|weight| **weight < 0.5).count())
    }

    /// Starts decoding a view in the background.
    pub fn prefetch(&self, index: usize) {
        if let Some(view) = self.views.get(index) {
            self.store.prefetch(view.camera, view.frame);
        }
    }
}

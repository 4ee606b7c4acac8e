//! What the frames of a split show of the template's texels, view by view: from it exposures and light are found.

use ghand_capture::{Capture, ColorCorrection, Split, SplitView};
use ghand_core::Pose;
use ghand_hand_model::SurfaceSamples;
use ghand_hand_model::surface::sample_surface;
use ghand_render::Gpu;
use glam::DVec3;

use super::TexelError;
use super::views::{COLOR_COSINE, TexelObserver, TexelView};

/// Resolution of the texels: some two thousand points.
const RESOLUTION: u32 = 72;
/// Most frames used, evenly spaced, and most views of each.
const MOST_FRAMES: usize = 60;
const VIEWS_PER_FRAME: usize = 5;
/// A display value this bright or this dark in all channels says little about colour.
const BURNT: f64 = 0.99;
const BLACK: f64 = 0.02;

/// A camera's image of a frame.
#[derive(Clone)]
pub struct TexelImage {
    /// Index of the camera in the capture.
    pub camera: usize,
    /// Where it was taken from, metres, world axes.
    pub eye: DVec3,
    /// Each texel, where the image shows it.
    pub texels: Vec<Option<TexelView>>,
}

/// Frames with their images.
#[derive(Clone)]
pub struct TexelFrames {
    /// The texels.
    pub samples: SurfaceSamples,
    /// Positions of the frames in the split.
    pub frames: Vec<usize>,
    /// The images of each frame.
    pub images: Vec<Vec<TexelImage>>,
}

impl TexelFrames {
    /// Of a split whose frames have these poses.
    ///
    /// # Errors
    /// [`TexelError`] if an image or the model is unusable, or the device failed.
    pub fn new(gpu: &Gpu, capture: &Capture, split: &Split, poses: &[Pose]) -> Result<TexelFrames, TexelError> {
        let observer = TexelObserver::new(gpu, capture, sample_surface(&capture.template, RESOLUTION)?)?;
        let mut frames: Vec<usize> = split.views.iter().map(|view| view.position).collect();
        frames.sort_unstable();
        frames.dedup();
        let frames = evenly(&frames, MOST_FRAMES, 0);
        let mut images = Vec::new();
        for (turn, frame) in frames.iter().enumerate() {
            let views: Vec<&SplitView> = split.views.iter().filter(|view| view.position == *frame).collect();
            let image = |view: &SplitView| -> Result<TexelImage, TexelError> {
                Ok(TexelImage {
                    camera: view.camera,
                    eye: capture.cameras[view.camera].center(),
                    texels: observer.observe(view, &poses[*frame], COLOR_COSINE)?,
                })
            };
            // Other cameras in each frame, so that all of them meet.
            images.push(evenly(&views, VIEWS_PER_FRAME, turn).into_iter().map(image).collect::<Result<Vec<_>, _>>()?);
        }
        Ok(TexelFrames { samples: observer.samples().clone(), frames, images })
    }

    /// Of images of frames that a split and a capture number alike.
    #[cfg(test)]
    pub fn of_images(samples: SurfaceSamples, frames: Vec<usize>, images: Vec<Vec<TexelImage>>) -> TexelFrames {
        TexelFrames { samples, frames, images }
    }

    /// Corrects all colours.
    pub fn corrected(&self, correction: &ColorCorrection) -> TexelFrames {
        let mut frames = self.clone();
        for image in frames.images.iter_mut().flatten() {
            for view in image.texels.iter_mut().flatten() {
                view.color = correction.corrected(image.camera, view.color).map(|v| v.clamp(0.0, 1.0));
            }
        }
        frames
    }

    /// The parts of what images show of the hand that are burnt out and that are black.
    pub fn extremes(&self) -> [f64; 2] {
        let all = || self.images.iter().flatten().flat_map(|image| image.texels.iter().flatten());
        let part = |is: &dyn Fn(f64) -> bool| {
            all().filter(|view| view.color.iter().all(|v| is(*v))).count() as f64 / all().count().max(1) as f64
        };
        [part(&|v| v >= BURNT), part(&|v| v <= BLACK)]
    }
}

/// At most `most` of some items, evenly spaced, beginning `first` items later and going round.
pub fn evenly<T: Clone>(items: &[T], most: usize, first: usize) -> Vec<T> {
    let count = items.len().min(most);
    (0..count).map(|i| items[(i * items.len() / count + first) % items.len()].clone()).collect()
}

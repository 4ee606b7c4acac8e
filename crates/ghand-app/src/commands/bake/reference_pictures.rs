//! How much worse a baked avatar looks than the one that it was baked from.

use anyhow::bail;
use ghand_avatar::{Avatar, Scene};
use ghand_capture::Capture;
use ghand_core::{Camera, Pose};
use ghand_fit::views::TrainViews;
use ghand_measure::metrics::quantize;
use ghand_measure::protocol::given_views;
use ghand_render::Gpu;
use ghand_render::splat::{Purpose, band_rows};
use serde::Serialize;

use super::pose_set::NamedPose;
use ghand_avatar::framing::turntable;

/// Without images of a capture, the avatar is taken to differ from such images by this, dB: what trained avatars reach on
/// images that they have not seen.
const ASSUMED_PSNR: f64 = 33.0;
/// Views around each pose.
const VIEWS: usize = 3;
/// Size of the pictures.
const SIZE: [u32; 2] = [334, 512];
/// Most images of a capture.
const MOST_IMAGES: usize = 48;
/// Space around the hand in its images, pixels.
const MARGIN: u32 = 16;
/// PSNR of equal pictures, dB: they differ by less than their 8 bits show.
const EQUAL: f64 = 99.0;

/// The loss of a baked avatar.
#[derive(Debug, Clone, Serialize)]
pub struct Loss {
    /// What the difference from the exact avatar makes of its PSNR, dB: the mean over the pictures, with two errors that
    /// have nothing to do with each other. The PSNR of the exact avatar is that on the images, or assumed.
    pub db: f64,
    /// By how much PSNR on the images falls, dB, as a mean; negative if it rises. `null` without images.
    pub on_images: Option<f64>,
    /// PSNR to the exact avatar's picture of each image, dB.
    pub psnr_to_exact: Vec<f64>,
}

/// One picture of the exact avatar.
struct Picture {
    pose: Pose,
    camera: Camera,
    exact: Vec<[u8; 3]>,
    truth: Option<Vec<[u8; 3]>>,
}

/// Pictures of the exact avatar.
pub struct ReferencePictures {
    pictures: Vec<Picture>,
    background: [f32; 3],
    size: [u32; 2],
}

impl ReferencePictures {
    /// From an even selection of the images of a split.
    ///
    /// # Errors
    /// An error if the split has no images, an image is unusable, or the device failed.
    pub fn with_images(
        gpu: &Gpu,
        avatar: &Avatar,
        capture: &Capture,
        split: &str,
    ) -> anyhow::Result<ReferencePictures> {
        let split = capture.split(split)?;
        if capture.template.joint_count() != avatar.template.joint_count() || split.views.is_empty() {
            bail!("{}: has no images of this avatar's hand", capture.root.display());
        }
        let posed = given_views(capture, split);
        let views = TrainViews::new(capture, split, MARGIN)?;
        let count = views.len().min(MOST_IMAGES);
        let mut pictures = vec![];
        for k in 0..count {
            let index = k * views.len() / count;
            let view = views.get(index, 1)?;
            let truth = view.pixels.iter().map(|&[r, g, b, _]| [r, g, b]).collect();
            let pose = posed[index].pose.clone();
            pictures.push(Picture { pose, camera: view.camera, exact: vec![], truth: Some(truth) });
        }
        ReferencePictures { pictures, background: capture.background.map(|b| b as f32), size: views.largest(1) }
            .drawn(gpu, avatar)
    }

    /// From poses, seen from all around.
    ///
    /// # Errors
    /// An error if the device failed.
    pub fn without_images(gpu: &Gpu, avatar: &Avatar, poses: &[NamedPose]) -> anyhow::Result<ReferencePictures> {
        let all = poses.iter().flat_map(|named| {
            let cameras = turntable(&avatar.model, &[&named.pose], VIEWS, SIZE).into_iter().flatten();
            cameras.map(|camera| Picture { pose: named.pose.clone(), camera, exact: vec![], truth: None })
        });
        ReferencePictures { pictures: all.collect(), background: [0.0; 3], size: SIZE }.drawn(gpu, avatar)
    }

    fn drawn(mut self, gpu: &Gpu, avatar: &Avatar) -> anyhow::Result<ReferencePictures> {
        let drawn = self.draw(gpu, avatar)?;
        self.pictures.iter_mut().zip(drawn).for_each(|(picture, drawn)| picture.exact = drawn);
        Ok(self)
    }

    fn draw(&self, gpu: &Gpu, avatar: &Avatar) -> anyhow::Result<Vec<Vec<[u8; 3]>>> {
        let most = [self.size[0], band_rows(gpu, self.size)];
        let mut scene = Scene::new(gpu, &[avatar], Purpose::Images, 1, most)?;
        let mut drawn = vec![];
        for picture in &self.pictures {
            scene.set_pose(gpu, 0, 0, &picture.pose)?;
            let mut pixels = vec![];
            scene.render_bands(gpu, 0, &picture.camera, self.background, |_, band| {
                pixels.extend(band.rgba.iter().map(|p| quantize([p[0], p[1], p[2]])));
            })?;
            drawn.push(pixels);
        }
        Ok(drawn)
    }

    /// The loss of an avatar.
    ///
    /// # Errors
    /// An error if the device failed.
    pub fn loss(&self, gpu: &Gpu, baked: &Avatar) -> anyhow::Result<Loss> {
        let mut db = 0.0;
        let mut on_images = None;
        let mut psnr_to_exact = vec![];
        let count = self.pictures.len().max(1) as f64;
        for (picture, drawn) in self.pictures.iter().zip(self.draw(gpu, baked)?) {
            let to_exact = squared_error(&picture.exact, &drawn);
            let mut exact_to_truth = 10f64.powf(-0.1 * ASSUMED_PSNR);
            if let Some(truth) = &picture.truth {
                exact_to_truth = squared_error(&picture.exact, truth);
                let fall = psnr(exact_to_truth) - psnr(squared_error(&drawn, truth));
                *on_images.get_or_insert(0.0) += fall / count;
            }
            db += 10.0 * (1.0 + to_exact / exact_to_truth).log10() / count;
            psnr_to_exact.push(psnr(to_exact));
        }
        Ok(Loss { db, on_images, psnr_to_exact })
    }

    /// What the loss is of.
    pub fn description(&self) -> String {
        match self.pictures.iter().any(|picture| picture.truth.is_some()) {
            true => format!("in {} images' poses, beside their difference from the avatar", self.pictures.len()),
            false => format!("in poses that were not fitted, if the avatar differs from images by {ASSUMED_PSNR} dB"),
        }
    }
}

fn psnr(squared_error: f64) -> f64 {
    (-10.0 * squared_error.log10()).min(EQUAL)
}

/// Mean squared difference of display values.
fn squared_error(a: &[[u8; 3]], b: &[[u8; 3]]) -> f64 {
    let pairs = a.as_flattened().iter().zip(b.as_flattened());
    let sum: f64 = pairs.map(|(a, b)| ((f64::from(*a) - f64::from(*b)) / 255.0).powi(2)).sum();
    sum / (3 * a.len().max(1)) as f64
}

//! Accuracy of the variants on images, and their times in turns.

use std::time::Instant;

use ghand_avatar::Scene;
use ghand_capture::Capture;
use ghand_core::statistics::{median, quantile};
use ghand_core::{Camera, Pose};
use ghand_fit::views::TrainViews;
use ghand_measure::metrics::{ImageSimilarity, compare, mean_similarity, quantize};
use ghand_measure::protocol::given_views;
use ghand_render::Gpu;
use ghand_render::splat::{Image, Purpose, SplatOptions};
use image::imageops::{FilterType, resize};
use image::{Rgb, Rgb32FImage};
use serde::Serialize;

use super::variants::Variant;
use ghand_app::say;

/// Space around the hand in its images, pixels.
const MARGIN: u32 = 16;
/// Frames of a variant's turn, after one that is not timed.
const FRAMES: usize = 8;

/// The figures of a variant.
#[derive(Debug, Clone, Serialize)]
pub struct Measured {
    /// Its name.
    pub name: String,
    /// What differs from the exact avatar.
    pub knob: &'static str,
    /// Number of Gaussians.
    pub gaussians: usize,
    /// Size of its file, bytes.
    pub bytes: usize,
    /// Memory of the device for the avatar and its pictures, bytes, where the device tells.
    pub device_bytes: Option<u64>,
    /// PSNR over the hand's surroundings, dB, and over its mask.
    pub psnr: f64,
    pub psnr_hand: f64,
    /// SSIM.
    pub ssim: f64,
    /// From a pose to the picture on the device, ms: the median over the rounds of each round's median.
    pub frame_ms: f64,
    /// Quartiles of the rounds.
    pub frame_ms_range: [f64; 2],
    /// This one's time over that of the first variant, which is exact: the median of the rounds' ratios. On a busy machine
    /// it says more than the time.
    pub relative: f64,
    /// Whether no variant is faster and as accurate, or as fast and more accurate.
    pub best: bool,
}

/// Differences below these do not count: dB, and parts of the time.
const SAME_PSNR: f64 = 0.02;
const SAME_TIME: f64 = 0.03;

/// One image of a capture.
struct Truth {
    pose: Pose,
    /// Of the crop around the hand, and of the whole image.
    crop: Camera,
    whole: Camera,
    pixels: Vec<[u8; 4]>,
}

/// Measures all variants on an even selection of a split's images, of which there are at least as many.
///
/// # Errors
/// An error if an image is unusable or the device failed.
pub fn measure(
    gpu: &Gpu,
    variants: &[Variant],
    capture: &Capture,
    split: &str,
    images: usize,
    rounds: usize,
) -> anyhow::Result<Vec<Measured>> {
    let split = capture.split(split)?;
    let views = TrainViews::new(capture, split, MARGIN)?;
    let posed = given_views(capture, split);
    let mut truths = vec![];
    for k in 0..images {
        let index = k * views.len() / images;
        let view = views.get(index, 1)?;
        let whole = capture.cameras[view.camera_index].clone();
        truths.push(Truth { pose: posed[index].pose.clone(), crop: view.camera, whole, pixels: view.pixels });
    }
    let background = capture.background.map(|b| b as f32);
    let largest =
        |size: fn(&Camera) -> u32| truths.iter().flat_map(|t| [size(&t.crop), size(&t.whole)]).max().unwrap_or(1);
    let size = [largest(|camera| camera.width), largest(|camera| camera.height)];
    let mut scenes = vec![];
    let mut measured: Vec<Measured> = vec![];
    for variant in variants {
        let before = allocated(gpu);
        let options =
            SplatOptions { purpose: Purpose::Images, thresholds: variant.thresholds, ..SplatOptions::default() };
        let mut scene = Scene::with_options(gpu, &[variant.avatar.as_ref()], 1, size, options)?;
        let mut all: Vec<ImageSimilarity> = vec![];
        for truth in &truths {
            scene.set_pose(gpu, 0, 0, &truth.pose)?;
            let small = scaled(&truth.crop, variant.image_scale);
            let image = scene.render(gpu, 0, &small, background)?;
            let [width, height] = [truth.crop.width, truth.crop.height];
            let [similarity] = compare([width, height], [&enlarged(&image, width, height)], &truth.pixels);
            all.push(similarity);
        }
        let mean = mean_similarity(&all);
        say!("{}: {:.2} dB", variant.name, mean.psnr);
        measured.push(Measured {
            name: variant.name.clone(),
            knob: variant.knob,
            gaussians: variant.avatar.template.len(),
            bytes: variant.bytes,
            device_bytes: allocated(gpu).zip(before).map(|(after, before)| after.saturating_sub(before)),
            psnr: mean.psnr,
            psnr_hand: mean.psnr_hand,
            ssim: mean.ssim,
            frame_ms: 0.0,
            frame_ms_range: [0.0; 2],
            relative: 1.0,
            best: false,
        });
        scenes.push(scene);
    }
    let mut times: Vec<Vec<f64>> = vec![vec![]; variants.len()];
    for round in 0..rounds {
        for ((variant, scene), times) in variants.iter().zip(&mut scenes).zip(&mut times) {
            times.push(turn(gpu, scene, &truths, variant.image_scale, background, round)?);
        }
    }
    let first = times.first().cloned().unwrap_or_default();
    for (measured, times) in measured.iter_mut().zip(times) {
        measured.relative = median(times.iter().zip(&first).map(|(a, b)| a / b));
        measured.frame_ms = median(times.clone());
        measured.frame_ms_range = [quantile(times.clone(), 0.25), quantile(times, 0.75)];
    }
    mark_best(&mut measured);
    Ok(measured)
}

/// Memory that is taken on the device, bytes.
fn allocated(gpu: &Gpu) -> Option<u64> {
    gpu.device.generate_allocator_report().map(|report| report.total_allocated_bytes)
}

/// The median time of a frame, ms, over some images of whole size.
fn turn(
    gpu: &Gpu,
    scene: &mut Scene,
    truths: &[Truth],
    image_scale: f64,
    background: [f32; 3],
    round: usize,
) -> anyhow::Result<f64> {
    let mut times = vec![];
    for k in 0..=FRAMES {
        let truth = &truths[(round * FRAMES + k) % truths.len()];
        scene.set_view(gpu, &scaled(&truth.whole, image_scale), background)?;
        gpu.wait()?;
        let start = Instant::now();
        scene.set_pose(gpu, 0, 0, &truth.pose)?;
        scene.set_frame(gpu, 0);
        scene.run_frame(gpu, |_, _| {})?;
        times.push(1e3 * start.elapsed().as_secs_f64());
    }
    Ok(median(times.into_iter().skip(1)))
}

/// A camera of a smaller picture.
fn scaled(camera: &Camera, scale: f64) -> Camera {
    let edge = |edge: u32| ((f64::from(edge) * scale).round() as u32).max(1);
    camera.resized(edge(camera.width), edge(camera.height))
}

/// A picture in another size, as 8-bit display values.
fn enlarged(image: &Image, width: u32, height: u32) -> Vec<[u8; 3]> {
    let color = |p: &[f32; 4]| [p[0], p[1], p[2]];
    if [image.width, image.height] == [width, height] {
        return image.rgba.iter().map(|p| quantize(color(p))).collect();
    }
    let small =
        Rgb32FImage::from_fn(image.width, image.height, |x, y| Rgb(color(&image.rgba[(y * image.width + x) as usize])));
    resize(&small, width, height, FilterType::CatmullRom).pixels().map(|p| quantize(p.0)).collect()
}

/// Marks the variants that no other one dominates.
fn mark_best(all: &mut [Measured]) {
    let points: Vec<[f64; 2]> = all.iter().map(|m| [m.psnr, m.relative]).collect();
    let dominates = |a: &[f64; 2], b: &[f64; 2]| {
        let faster = a[1] < (1.0 - SAME_TIME) * b[1] && a[0] > b[0] - SAME_PSNR;
        let better = a[0] > b[0] + SAME_PSNR && a[1] < (1.0 + SAME_TIME) * b[1];
        faster || better
    };
    for (measured, point) in all.iter_mut().zip(&points) {
        measured.best = !points.iter().any(|other| dominates(other, point));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_variants_that_no_other_dominates_are_best() {
        let variant = |psnr: f64, frame_ms: f64| Measured {
            name: String::new(),
            knob: "exact",
            gaussians: 1,
            bytes: 1,
            device_bytes: None,
            psnr,
            psnr_hand: psnr,
            ssim: 1.0,
            frame_ms,
            frame_ms_range: [frame_ms; 2],
            relative: frame_ms / 30.0,
            best: false,
        };
        let at = [(33.0, 30.0), (32.9, 20.0), (32.8, 25.0), (30.0, 20.0), (28.0, 9.0), (28.01, 9.1), (33.01, 32.0)];
        let mut all = at.map(|(psnr, frame_ms)| variant(psnr, frame_ms));
        mark_best(&mut all);
        assert_eq!(all.map(|m| m.best), [true, true, false, false, true, true, false]);
    }
}

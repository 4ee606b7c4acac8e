//! PSNR and SSIM of pictures, and angles between poses.

use ghand_core::Pose;
use ghand_core::rotation::rotation_from_axis_angle;
use ghand_render::image_loss::{ImageLoss, LossWeights};
use ghand_render::{Gpu, RenderError, buffers};
use glam::DVec3;

/// Similarity of a picture to its truth.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct ImageSimilarity {
    /// PSNR over all pixels, dB, on 8-bit values.
    pub psnr: f64,
    /// PSNR over the truth's mask, dB.
    pub psnr_hand: f64,
    /// Mean SSIM over all pixels (11x11 Gaussian window, sigma 1.5, zeros outside the picture).
    pub ssim: f64,
}

/// Compares pictures up to a given size; SSIM runs on the device.
pub struct Comparator {
    image: wgpu::Buffer,
    loss: ImageLoss,
}

/// A picture as 8-bit display values.
pub fn quantize(rgb: [f32; 3]) -> [u8; 3] {
    rgb.map(|v| (v.clamp(0.0, 1.0) * 255.0).round() as u8)
}

fn psnr(sum: f64, values: usize) -> f64 {
    // Equal 8-bit pictures would have infinite PSNR. An error of at least half a grey level in one value keeps the mean
    // over views finite.
    let mean = sum / values.max(1) as f64;
    -10.0 * mean.max((0.5f64 / 255.0).powi(2) / values.max(1) as f64).log10()
}

impl Comparator {
    /// A comparator for pictures of at most `max_pixels`.
    ///
    /// # Errors
    /// [`RenderError`] if the device has too little memory or was lost.
    pub fn new(gpu: &Gpu, max_pixels: usize) -> Result<Comparator, RenderError> {
        let make = |label| buffers::zeroed(gpu, label, 4 * max_pixels);
        let what = format!("comparing images up to {max_pixels} pixels");
        let (image, gradient) = gpu.scoped(&what, || (make("compared image"), make("unused gradient")))?;
        let loss = ImageLoss::new(gpu, &image, &gradient, max_pixels)?;
        Ok(Comparator { image, loss })
    }

    /// Similarity of an 8-bit picture to its truth (red, green, blue, mask).
    ///
    /// # Errors
    /// [`RenderError`] if the sizes do not match or the device failed.
    pub fn compare(
        &mut self,
        gpu: &Gpu,
        size: [u32; 2],
        picture: &[[u8; 3]],
        truth: &[[u8; 4]],
    ) -> Result<ImageSimilarity, RenderError> {
        let (mut sum, mut hand_sum, mut hand) = (0.0, 0.0, 0);
        for (p, t) in picture.iter().zip(truth) {
            let error: f64 = (0..3).map(|c| ((f64::from(p[c]) - f64::from(t[c])) / 255.0).powi(2)).sum();
            sum += error;
            if t[3] >= 128 {
                hand_sum += error;
                hand += 3;
            }
        }
        let values: Vec<[f32; 4]> =
            picture.iter().map(|p| [p[0], p[1], p[2], 255].map(|v| f32::from(v) / 255.0)).collect();
        gpu.queue.write_buffer(&self.image, 0, bytemuck::cast_slice(&values));
        let count = 3.0 * picture.len() as f64;
        self.loss.set_target(gpu, size, truth, LossWeights { l1: 0.8, ssim: 0.2, ..Default::default() }, count)?;
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        self.loss.encode(&mut encoder);
        gpu.queue.submit([encoder.finish()]);
        let ssim = self.loss.value(gpu)?.ssim_sum / count;
        Ok(ImageSimilarity { psnr: psnr(sum, 3 * picture.len()), psnr_hand: psnr(hand_sum, hand), ssim })
    }
}

/// Which joints move. A joint whose rotation is exactly 0 in every pose is fixed in this capture, and refinement does
/// not change it.
pub fn moving_joints(poses: &[Pose]) -> Vec<bool> {
    let joints = poses.first().map_or(0, |p| p.rotations.len());
    (0..joints).map(|k| poses.iter().any(|p| p.rotations.get(k).is_some_and(|r| *r != DVec3::ZERO))).collect()
}

/// Mean angle between the local rotations of two sequences of poses, degrees, over all frames and the joints for which
/// `counts` is true.
pub fn pose_error_degrees(poses: &[Pose], truth: &[Pose], counts: &[bool]) -> f64 {
    let (mut sum, mut n) = (0.0, 0usize);
    for (a, b) in poses.iter().zip(truth) {
        for ((a, b), counts) in a.rotations.iter().zip(&b.rotations).zip(counts) {
            if *counts {
                let between = rotation_from_axis_angle(*a).transpose() * rotation_from_axis_angle(*b);
                sum += glam::DQuat::from_mat3(&between).normalize().angle_between(glam::DQuat::IDENTITY).to_degrees();
                n += 1;
            }
        }
    }
    sum / n.max(1) as f64
}

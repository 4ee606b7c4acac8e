//! The image losses on the device against their f64 twin.
#![allow(clippy::neg_cmp_op_on_partial_ord, reason = "`!(error <= bound)` rejects NaN too")]

use crate::common::{gpu, rng};
use ghand_render::Gpu;
use ghand_render::buffers;
use ghand_render::image_loss::{ImageLoss, LossWeights};
use ghand_render::reference::image_loss::{Picture, image_loss};
use rand::RngExt;

/// Relative L2 error of a gradient with respect to colours.
fn error(got: &[[f32; 4]], expected: &[[f64; 3]]) -> f64 {
    let mut difference = 0.0;
    let mut norm = 0.0;
    for (a, b) in got.iter().flat_map(|d| &d[..3]).zip(expected.as_flattened()) {
        difference += (f64::from(*a) - b).powi(2);
        norm += b * b;
    }
    (difference / norm).sqrt()
}

fn check(gpu: &Gpu, size: [u32; 2], weights: LossWeights) {
    let pixels = (size[0] * size[1]) as usize;
    let mut rng = rng(9);
    let x: Vec<[f32; 4]> = (0..pixels).map(|_| std::array::from_fn(|_| rng.random_range(0.0..1.0))).collect();
    let y: Vec<[u8; 4]> = (0..pixels).map(|_| std::array::from_fn(|_| rng.random_range(0..=255))).collect();
    let image = buffers::filled(gpu, "image", &x);
    let d_image = buffers::zeroed(gpu, "d_image", 4 * pixels);
    let mut loss = ImageLoss::new(gpu, &image, &d_image, pixels).unwrap();
    let count = 3.0 * pixels as f64;
    loss.set_target(gpu, size, &y, weights, count).unwrap();
    let mut encoder = gpu.device.create_command_encoder(&Default::default());
    loss.encode(&mut encoder);
    gpu.queue.submit([encoder.finish()]);
    let value = loss.value(gpu).unwrap();
    let got: Vec<[f32; 4]> = buffers::read(gpu, &d_image, pixels).unwrap();

    assert!(got.iter().all(|d| d[3] == 0.0), "{size:?} {weights:?}: a gradient of the coverage");

    let picture = |rgb: Vec<[f64; 3]>| Picture { width: size[0] as usize, height: size[1] as usize, rgb };
    let x = picture(x.iter().map(|p| [0, 1, 2].map(|c| f64::from(p[c]))).collect());
    let y = picture(y.iter().map(|p| [0, 1, 2].map(|c| f64::from(p[c]) / 255.0)).collect());
    let factors = [weights.l1, weights.ssim].map(f64::from);
    let (expected, gradient) = image_loss(&x, &y, factors, 1.0 / count);
    let parts = [value.l1_sum / count, 1.0 - value.ssim_sum / count];
    let total: f64 = parts.iter().zip(factors).map(|(part, factor)| part * factor).sum();
    assert!((total - expected).abs() <= 1e-6, "{size:?} {weights:?}: {total} against {expected}");
    assert!(error(&got, &gradient) <= 1e-5, "{size:?} {weights:?}: relative L2 error {}", error(&got, &gradient));
    let wrong: Vec<_> = gradient.iter().map(|g| [g[0], g[1] * 1.001, g[2]]).collect();
    assert!(!(error(&got, &wrong) <= 1e-5), "the gradient is not compared");
}

#[test]
fn every_loss_agrees_with_its_twin() {
    // One device: a driver may refuse to open dozens in one process.
    let gpu = gpu();
    for size in [[37, 29], [1, 1], [64, 3], [5, 70], [121, 190]] {
        for [l1, ssim] in [[0.8, 0.2], [1.0, 0.0], [0.3, 0.5]] {
            check(&gpu, size, LossWeights { l1, ssim });
        }
    }
}

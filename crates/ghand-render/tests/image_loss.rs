//! The image losses on the device against their f64 twin.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test fails by panicking")]
#![allow(clippy::neg_cmp_op_on_partial_ord, reason = "`!(error <= bound)` rejects NaN too")]

mod common;

use common::{gpu, rng};
use ghand_render::buffers;
use ghand_render::image_loss::ImageLoss;
use ghand_render::reference::image_loss::{Picture, image_loss};
use rand::RngExt;

#[test]
fn the_image_loss_agrees_with_its_twin() {
    let gpu = gpu();
    for (width, height) in [(37u32, 29u32), (1, 1), (64, 3), (5, 70)] {
        let pixels = (width * height) as usize;
        let mut rng = rng(9);
        let x: Vec<[f32; 4]> = (0..pixels).map(|_| std::array::from_fn(|_| rng.random_range(0.0..1.0))).collect();
        let y: Vec<[u8; 4]> = (0..pixels).map(|_| std::array::from_fn(|_| rng.random_range(0..=255))).collect();
        let image = buffers::filled(&gpu, "image", &x);
        let d_image = buffers::zeroed(&gpu, "d_image", 4 * pixels);
        let mut loss = ImageLoss::new(&gpu, &image, &d_image, pixels);
        let count = 3.0 * pixels as f64;
        loss.set_target(&gpu, [width, height], &y, [0.8, 0.2], count).unwrap();
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        loss.encode(&mut encoder);
        gpu.queue.submit([encoder.finish()]);
        let value = loss.value(&gpu).unwrap();
        let got: Vec<[f32; 4]> = buffers::read(&gpu, &d_image, pixels).unwrap();

        let picture = |rgb: Vec<[f64; 3]>| Picture { width: width as usize, height: height as usize, rgb };
        let x = picture(x.iter().map(|p| [0, 1, 2].map(|c| f64::from(p[c]))).collect());
        let y = picture(y.iter().map(|p| [0, 1, 2].map(|c| f64::from(p[c]) / 255.0)).collect());
        let (expected, gradient) = image_loss(&x, &y, 0.8, 0.2, 1.0 / count);
        let total = 0.8 * value.l1_sum / count + 0.2 * (1.0 - value.ssim_sum / count);
        assert!((total - expected).abs() <= 1e-6, "{total} against {expected}");
        let error = |gradient: &[[f64; 3]]| {
            let (mut difference, mut norm) = (0.0, 0.0);
            for (a, b) in got.iter().zip(gradient) {
                for c in 0..3 {
                    difference += (f64::from(a[c]) - b[c]).powi(2);
                    norm += b[c] * b[c];
                }
            }
            (difference / norm).sqrt()
        };
        assert!(error(&gradient) <= 1e-5, "{width}x{height}: relative L2 error {}", error(&gradient));
        let wrong: Vec<_> = gradient.iter().map(|g| [g[0], g[1] * 1.001, g[2]]).collect();
        assert!(!(error(&wrong) <= 1e-5), "the gradient is not compared");
    }
}

//! The splatter on the device against its f64 twin.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test fails by panicking")]
#![allow(clippy::neg_cmp_op_on_partial_ord, reason = "`!(error <= bound)` rejects NaN too")]

use ghand_core::Camera;
use ghand_render::reference::image_loss::{Picture, image_loss};
use ghand_render::reference::project::Gaussian;
use ghand_render::reference::rasterize::{Cuts, Scene};
use ghand_render::splat::{GAUSSIAN_ROWS, Splatter, View};
use ghand_render::{AdapterChoice, Gpu, buffers, image_loss::ImageLoss};
use glam::{DVec2, DVec3};
use rand::{RngExt, SeedableRng};

fn gpu() -> Gpu {
    Gpu::new(&AdapterChoice::from_env()).unwrap_or_else(|e| panic!("{e}"))
}

fn rng(seed: u64) -> rand_chacha::ChaCha8Rng {
    rand_chacha::ChaCha8Rng::seed_from_u64(seed)
}

/// A camera with unequal focal lengths, an off-centre principal point and a size that is no multiple of a tile.
fn camera(width: u32, height: u32) -> Camera {
    let look = Camera::look_at(DVec3::new(0.2, -0.1, -0.9), DVec3::ZERO, DVec3::Y, 0.5, width, height);
    Camera { focal: look.focal * DVec2::new(1.0, 1.2), principal: look.principal + DVec2::new(3.3, -2.7), ..look }
}

fn random_scene(seed: u64, count: usize, scale: std::ops::Range<f64>) -> Vec<Gaussian> {
    let mut rng = rng(seed);
    let mut unit = || rng.random_range(-1.0..1.0);
    (0..count)
        .map(|_| Gaussian {
            // Rounded to f32, so that both sides start from the same numbers.
            mean: DVec3::new(unit(), unit(), unit()).as_vec3().as_dvec3() * 0.25,
            scale: f64::from((scale.start + (scale.end - scale.start) * (unit() * 0.5 + 0.5)) as f32),
            color: (DVec3::new(unit(), unit(), unit()) * 0.5 + 0.5).as_vec3().as_dvec3(),
        })
        .collect()
}

fn table(gaussians: &[Gaussian]) -> Vec<f32> {
    let mut rows = vec![Vec::new(); GAUSSIAN_ROWS];
    for g in gaussians {
        let values = [g.mean.x, g.mean.y, g.mean.z, g.scale, g.color.x, g.color.y, g.color.z];
        rows.iter_mut().zip(values).for_each(|(row, v)| row.push(v as f32));
    }
    rows.concat()
}

struct Rendered {
    image: Vec<[f32; 4]>,
    gradient: Vec<f32>,
}

fn render(gpu: &Gpu, gaussians: &[Gaussian], camera: &Camera, opacity: f32, d_image: &[[f32; 4]]) -> Rendered {
    let mut splatter = Splatter::new(gpu, gaussians.len(), [camera.width, camera.height]).unwrap();
    gpu.queue.write_buffer(splatter.gaussians(), 0, bytemuck::cast_slice(&table(gaussians)));
    splatter.set_view(gpu, View::new(camera, gaussians.len(), [0.2, 0.3, 0.4], opacity)).unwrap();
    let image = splatter.render(gpu).unwrap().rgba;
    gpu.queue.write_buffer(splatter.d_image(), 0, bytemuck::cast_slice(d_image));
    let mut encoder = gpu.device.create_command_encoder(&Default::default());
    splatter.forward(&mut encoder);
    splatter.backward(&mut encoder);
    gpu.queue.submit([encoder.finish()]);
    let gradient = buffers::read(gpu, splatter.d_gaussians(), GAUSSIAN_ROWS * gaussians.len()).unwrap();
    Rendered { image, gradient }
}

fn random_weights(seed: u64, pixels: usize) -> Vec<[f32; 4]> {
    let mut rng = rng(seed);
    (0..pixels).map(|_| std::array::from_fn(|_| rng.random_range(-1.0f32..1.0))).collect()
}

/// How far two images are apart: the largest difference, leaving out pixels that differ by more than `flip`, and how
/// many those are.
fn compare_images(image: &[[f32; 4]], twin: &[[f64; 4]], flip: f64) -> (f64, usize) {
    let (mut worst, mut flips) = (0.0, 0);
    for (a, b) in image.iter().zip(twin) {
        let difference = (0..4).map(|c| (f64::from(a[c]) - b[c]).abs()).fold(0.0, |m, d| if d <= m { m } else { d });
        if !(difference <= flip) {
            flips += 1;
        } else {
            worst = f64::max(worst, difference);
        }
    }
    (worst, flips)
}

/// Relative L2 error of row `row` of the gradient table.
fn gradient_error(gradient: &[f32], twin: &[Gaussian], rows: std::ops::Range<usize>) -> f64 {
    let count = twin.len();
    let (mut difference, mut norm) = (0.0, 0.0);
    for row in rows {
        for (i, d) in twin.iter().enumerate() {
            let expected = [d.mean.x, d.mean.y, d.mean.z, d.scale, d.color.x, d.color.y, d.color.z][row];
            difference += (f64::from(gradient[row * count + i]) - expected).powi(2);
            norm += expected * expected;
        }
    }
    (difference / norm).sqrt()
}

fn check_against_twin(gaussians: &[Gaussian], camera: &Camera, opacity: f32) {
    let gpu = gpu();
    let weights = random_weights(3, (camera.width * camera.height) as usize);
    let rendered = render(&gpu, gaussians, camera, opacity, &weights);
    let scene = Scene {
        gaussians,
        camera,
        background: DVec3::new(f64::from(0.2f32), f64::from(0.3f32), f64::from(0.4f32)),
        opacity: f64::from(opacity),
        cuts: Cuts::default(),
    };
    let twin = scene.rasterize();
    // A contribution of just 1/255 may be taken on one side and left out on the other.
    let (worst, flips) = compare_images(&rendered.image, &twin, 2e-4);
    assert!(worst <= 1e-4, "image error {worst}");
    assert!(flips * 200 <= twin.len(), "{flips} of {} pixels flipped at a cut-off", twin.len());
    assert!(compare_images(&rendered.image, &twin, 2.0 / 255.0).1 == 0, "a flip larger than the alpha cut");
    let d_image: Vec<[f64; 4]> = weights.iter().map(|w| w.map(f64::from)).collect();
    let gradient = scene.rasterize_vjp(&d_image);
    // Flips at the alpha cut change single contributions by 1/255 of a weight; they, not rounding, set this tolerance.
    for (name, rows) in [("mean", 0..3), ("scale", 3..4), ("color", 4..7)] {
        let error = gradient_error(&rendered.gradient, &gradient, rows.clone());
        assert!(error <= 2e-3, "{name}: relative L2 error {error}");
        let mut wrong = gradient.clone();
        wrong.iter_mut().for_each(|g| {
            g.mean *= 1.02;
            g.scale *= 1.02;
            g.color *= 1.02;
        });
        assert!(!(gradient_error(&rendered.gradient, &wrong, rows) <= 2e-3), "{name} is not compared");
    }
}

#[test]
fn small_gaussians_agree_with_the_twin() {
    check_against_twin(&random_scene(1, 3000, 0.001..0.008), &camera(101, 75), 1.0);
}

#[test]
fn large_translucent_gaussians_agree_with_the_twin() {
    check_against_twin(&random_scene(2, 200, 0.02..0.1), &camera(90, 53), 0.6);
}

#[test]
fn two_runs_give_the_same_bits() {
    let gpu = gpu();
    let (gaussians, camera) = (random_scene(4, 2000, 0.002..0.02), camera(64, 64));
    let weights = random_weights(5, 64 * 64);
    let runs: Vec<_> = (0..3).map(|_| render(&gpu, &gaussians, &camera, 1.0, &weights)).collect();
    for run in &runs[1..] {
        assert!(bytemuck::cast_slice::<_, u32>(&runs[0].image) == bytemuck::cast_slice::<_, u32>(&run.image));
        assert!(bytemuck::cast_slice::<_, u32>(&runs[0].gradient) == bytemuck::cast_slice::<_, u32>(&run.gradient));
    }
}

#[test]
fn a_full_intersection_buffer_grows_instead_of_truncating() {
    let gaussians = random_scene(6, 60, 0.2..0.4);
    let camera = camera(200, 160);
    // Each covers most of the 500 tiles: far more than the first guess of 1024 intersections.
    check_against_twin(&gaussians, &camera, 0.3);
}

#[test]
fn broken_gaussians_are_dropped_and_touch_nobody() {
    let gpu = gpu();
    let camera = camera(48, 40);
    let weights = random_weights(7, 48 * 40);
    let healthy = random_scene(8, 100, 0.01..0.03);
    let mut broken = healthy.clone();
    let plain = Gaussian { mean: DVec3::ZERO, scale: 0.01, color: DVec3::ONE };
    broken.push(Gaussian { mean: DVec3::new(f64::NAN, 0.0, 0.0), ..plain });
    broken.push(Gaussian { scale: f64::INFINITY, mean: DVec3::ZERO, ..plain });
    broken.push(Gaussian { color: DVec3::new(0.0, f64::NAN, 0.0), mean: DVec3::ZERO, ..plain });
    broken.push(Gaussian { mean: DVec3::new(0.2, -0.1, -5.0), ..plain });
    broken.push(Gaussian { mean: DVec3::new(0.0, f64::NEG_INFINITY, 0.0), ..plain });
    let (a, b) = (render(&gpu, &healthy, &camera, 1.0, &weights), render(&gpu, &broken, &camera, 1.0, &weights));
    assert!(bytemuck::cast_slice::<_, u32>(&a.image) == bytemuck::cast_slice::<_, u32>(&b.image));
    for row in 0..GAUSSIAN_ROWS {
        let (from, to) = (row * healthy.len(), row * broken.len());
        assert_eq!(a.gradient[from..from + healthy.len()], b.gradient[to..to + healthy.len()]);
        assert!(b.gradient[to + healthy.len()..to + broken.len()].iter().all(|d| *d == 0.0));
    }
}

#[test]
fn no_gaussian_at_all_gives_the_background() {
    let gpu = gpu();
    let mut splatter = Splatter::new(&gpu, 0, [1, 1]).unwrap();
    splatter.set_view(&gpu, View::new(&camera(1, 1), 0, [0.2, 0.3, 0.4], 1.0)).unwrap();
    assert_eq!(splatter.render(&gpu).unwrap().rgba, vec![[0.2, 0.3, 0.4, 0.0]]);
}

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

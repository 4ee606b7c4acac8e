//! The splatter on the device against its f64 twin.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test fails by panicking")]
#![allow(clippy::neg_cmp_op_on_partial_ord, reason = "`!(error <= bound)` rejects NaN too")]

use ghand_core::Camera;
use ghand_render::reference::image_loss::{Picture, image_loss};
use ghand_render::reference::project::{CameraGradient, Color, Gaussian};
use ghand_render::reference::rasterize::{Cuts, Scene};
use ghand_render::splat::{
    Color as SplatColor, Opacity, Purpose, Shape, SplatModel, SplatOptions, Splatter, Stored, View,
};
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

fn vector(rng: &mut rand_chacha::ChaCha8Rng) -> DVec3 {
    DVec3::from_array(std::array::from_fn(|_| rng.random_range(-1.0..1.0)))
}

/// Rounded to f32, so that both sides start from the same numbers.
fn rounded(v: DVec3) -> DVec3 {
    v.as_vec3().as_dvec3()
}

fn random_scene(seed: u64, count: usize, scale: std::ops::Range<f64>) -> Vec<Gaussian> {
    let mut rng = rng(seed);
    (0..count)
        .map(|_| {
            let mean = rounded(vector(&mut rng)) * 0.25;
            let scale = f64::from(rng.random_range(scale.clone()) as f32);
            Gaussian::round(mean, scale, 1.0, rounded(vector(&mut rng) * 0.5 + 0.5))
        })
        .collect()
}

/// Gaussians of the most general kind.
fn general_scene(seed: u64, count: usize, scale: std::ops::Range<f64>, bases: usize) -> Vec<Gaussian> {
    let mut rng = rng(seed);
    (0..count)
        .map(|_| {
            let size = rng.random_range(scale.clone());
            let length = rng.random_range(0.01..30.0);
            Gaussian {
                mean: rounded(vector(&mut rng)) * 0.25,
                scales: rounded(size * (1.2 + vector(&mut rng))),
                rotation: (vector(&mut rng).extend(rng.random_range(-1.0..1.0)) * length).as_vec4().as_dvec4(),
                opacity: f64::from(rng.random_range(0.05f32..1.0)),
                color: match bases {
                    0 => Color::Rgb(rounded(vector(&mut rng) * 0.5 + 0.5)),
                    _ => Color::SphericalHarmonics((0..bases).map(|_| rounded(vector(&mut rng))).collect()),
                },
            }
        })
        .collect()
}

/// The numbers of a Gaussian in the order of the table's rows.
fn row_values(g: &Gaussian, model: &SplatModel) -> Vec<f64> {
    let mut values = g.mean.to_array().to_vec();
    match model.shape {
        Shape::Isotropic => values.push(g.scales.x),
        Shape::Anisotropic => {
            values.extend(g.scales.to_array());
            values.extend([g.rotation.w, g.rotation.x, g.rotation.y, g.rotation.z]);
        }
    }
    if model.opacity == Opacity::Free {
        values.push(g.opacity);
    }
    values.extend(g.coefficients().iter().flat_map(|c| c.to_array()));
    values
}

/// As stored: `[rows][N]`.
fn table(gaussians: &[Gaussian], model: &SplatModel) -> Vec<f32> {
    let all: Vec<Vec<f64>> = gaussians.iter().map(|g| row_values(g, model)).collect();
    let stored = |row: usize, value: f64| -> f32 {
        let is_scale = (SplatModel::SCALE_ROW..SplatModel::SCALE_ROW + model.scale_rows()).contains(&row);
        match model.stored {
            Stored::Unbounded if is_scale => value.ln() as f32,
            Stored::Unbounded if model.opacity == Opacity::Free && row == model.opacity_row() => {
                (value / (1.0 - value)).ln() as f32
            }
            _ => value as f32,
        }
    };
    (0..model.rows()).flat_map(|row| all.iter().map(move |values| stored(row, values[row]))).collect()
}

/// The twin's gradient as the table has it.
fn gradient_table(gaussians: &[Gaussian], gradient: &[Gaussian], model: &SplatModel) -> Vec<f64> {
    let mut all: Vec<Vec<f64>> = Vec::new();
    for (g, d) in gaussians.iter().zip(gradient) {
        let mut tied = d.clone();
        if model.shape == Shape::Isotropic {
            tied.scales.x = d.scales.element_sum();
        }
        if model.stored == Stored::Unbounded {
            tied.scales *= g.scales;
            tied.opacity *= g.opacity * (1.0 - g.opacity);
        }
        all.push(row_values(&tied, model));
    }
    (0..model.rows()).flat_map(|row| all.iter().map(move |values| values[row])).collect()
}

struct Rendered {
    image: Vec<[f32; 4]>,
    depths: Vec<f32>,
    gradient: Vec<f32>,
    d_camera: Vec<f32>,
    broken: u32,
}

const BACKGROUND: [f32; 3] = [0.2, 0.3, 0.4];

fn render_table(
    gpu: &Gpu,
    model: SplatModel,
    table: &[f32],
    camera: &Camera,
    opacity: f32,
    d_image: &[[f32; 4]],
) -> Rendered {
    let count = table.len() / model.rows();
    let options = SplatOptions { model, purpose: Purpose::CameraGradients, depth: true };
    let mut splatter = Splatter::new(gpu, options, count, [camera.width, camera.height]).unwrap();
    gpu.queue.write_buffer(splatter.gaussians(), 0, bytemuck::cast_slice(table));
    splatter.set_view(gpu, View::new(camera, count, BACKGROUND, opacity)).unwrap();
    let image = splatter.render(gpu).unwrap().rgba;
    gpu.queue.write_buffer(splatter.d_image(), 0, bytemuck::cast_slice(d_image));
    let mut encoder = gpu.device.create_command_encoder(&Default::default());
    splatter.forward(&mut encoder);
    splatter.backward(&mut encoder);
    gpu.queue.submit([encoder.finish()]);
    Rendered {
        depths: buffers::read(gpu, splatter.depths(), image.len()).unwrap(),
        gradient: buffers::read(gpu, splatter.d_gaussians(), table.len()).unwrap(),
        d_camera: buffers::read(gpu, splatter.d_camera(), 6).unwrap(),
        broken: buffers::read::<u32>(gpu, splatter.counters(), 4).unwrap()[3],
        image,
    }
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

/// Relative L2 error of some numbers.
fn relative_error(got: &[f32], expected: &[f64]) -> f64 {
    let difference: f64 = got.iter().zip(expected).map(|(a, b)| (f64::from(*a) - b).powi(2)).sum();
    let norm: f64 = expected.iter().map(|b| b * b).sum();
    if norm == 0.0 { difference.sqrt() } else { (difference / norm).sqrt() }
}

/// Names of the parts of the table, with their rows.
fn parts(model: &SplatModel) -> Vec<(&'static str, std::ops::Range<usize>)> {
    let mut parts = vec![("means", 0..3), ("scales", 3..3 + model.scale_rows())];
    if model.shape == Shape::Anisotropic {
        parts.push(("rotations", model.rotation_row()..model.rotation_row() + 4));
    }
    if model.opacity == Opacity::Free {
        parts.push(("opacities", model.opacity_row()..model.opacity_row() + 1));
    }
    parts.push(("colors", model.color_row()..model.rows()));
    parts
}

fn check_against_twin(model: SplatModel, gaussians: &[Gaussian], camera: &Camera, opacity: f32) {
    let gpu = gpu();
    let weights = random_weights(3, (camera.width * camera.height) as usize);
    let rendered = render_table(&gpu, model, &table(gaussians, &model), camera, opacity, &weights);
    let gaussians: Vec<Gaussian> = gaussians
        .iter()
        .map(|g| match model.opacity {
            Opacity::Shared => Gaussian { opacity: f64::from(opacity), ..g.clone() },
            Opacity::Free => g.clone(),
        })
        .collect();
    let scene = Scene {
        gaussians: &gaussians,
        camera,
        background: DVec3::from(BACKGROUND.map(f64::from)),
        antialias: model.antialias,
        cuts: Cuts::default(),
    };
    let twin = scene.rasterize();
    // A contribution of just 1/255 may be taken on one side and left out on the other.
    let (worst, flips) = compare_images(&rendered.image, &twin, 2e-4);
    println!("{model:?}: image error {worst:.1e}, {flips} of {} pixels flipped at a cut-off", twin.len());
    assert!(worst <= 1e-4, "image error {worst}");
    assert!(flips * 200 <= twin.len(), "{flips} of {} pixels flipped at a cut-off", twin.len());
    assert!(compare_images(&rendered.image, &twin, 2.5 / 255.0).1 == 0, "a flip larger than the alpha cut");
    let depth_error = relative_error(&rendered.depths, &scene.depth());
    assert!(depth_error <= 1e-3, "depth: {depth_error}");
    // Rounding alone stays below 1e-4; a flip changes a contribution by 1/255 of a weight.
    let tolerance = if flips == 0 { 1e-4 } else { 2e-3 };
    let d_image: Vec<[f64; 4]> = weights.iter().map(|w| w.map(f64::from)).collect();
    let (gradient, d_camera) = scene.rasterize_vjp(&d_image);
    let expected = gradient_table(&gaussians, &gradient, &model);
    for (name, rows) in parts(&model) {
        let range = rows.start * gaussians.len()..rows.end * gaussians.len();
        let error = relative_error(&rendered.gradient[range.clone()], &expected[range.clone()]);
        println!("  {name}: relative L2 error {error:.1e}");
        assert!(error <= tolerance, "{model:?} {name}: relative L2 error {error}");
        let wrong: Vec<f64> = expected[range.clone()].iter().map(|d| d * 1.02).collect();
        assert!(!(relative_error(&rendered.gradient[range], &wrong) <= tolerance), "{name} is not compared");
    }
    let turn = turn_gradient(camera, &d_camera);
    let error = relative_error(&rendered.d_camera, &turn);
    println!("  camera: relative L2 error {error:.1e}");
    assert!(error <= tolerance, "{model:?} camera: {:?} against {turn:?}", rendered.d_camera);
}

/// The camera's gradient as the device gives it: to x + w x x + t of the camera coordinates x.
fn turn_gradient(camera: &Camera, d: &CameraGradient) -> [f64; 6] {
    let product = d.rotation * camera.rotation.transpose();
    let vee = DVec3::new(
        product.y_axis.z - product.z_axis.y,
        product.z_axis.x - product.x_axis.z,
        product.x_axis.y - product.y_axis.x,
    );
    let turn = vee + camera.translation.cross(d.translation);
    [turn.x, turn.y, turn.z, d.translation.x, d.translation.y, d.translation.z]
}

#[test]
fn small_gaussians_agree_with_the_twin() {
    check_against_twin(SplatModel::HAND, &random_scene(1, 3000, 0.001..0.008), &camera(101, 75), 1.0);
}

#[test]
fn large_translucent_gaussians_agree_with_the_twin() {
    check_against_twin(SplatModel::HAND, &random_scene(2, 200, 0.02..0.1), &camera(90, 53), 0.6);
}

#[test]
fn every_kind_of_gaussian_agrees_with_the_twin() {
    let camera = camera(90, 53);
    for (k, degree) in [0, 1, 2, 3].into_iter().enumerate() {
        let bases = (degree as usize + 1) * (degree as usize + 1);
        let scene = general_scene(20 + k as u64, 400, 0.005..0.03, bases);
        let trained = SplatModel::trained(degree);
        check_against_twin(trained, &scene, &camera, 1.0);
        check_against_twin(SplatModel { antialias: true, stored: Stored::Plain, ..trained }, &scene, &camera, 1.0);
    }
    let plain = general_scene(30, 400, 0.005..0.03, 0);
    check_against_twin(SplatModel { color: SplatColor::Rgb, ..SplatModel::trained(0) }, &plain, &camera, 1.0);
    let round = random_scene(31, 2000, 0.0005..0.01);
    check_against_twin(SplatModel { antialias: true, ..SplatModel::HAND }, &round, &camera, 0.8);
    let mut free = round;
    free.iter_mut().enumerate().for_each(|(i, g)| g.opacity = f64::from((i % 97) as f32 / 100.0 + 0.01));
    check_against_twin(SplatModel { opacity: Opacity::Free, ..SplatModel::HAND }, &free, &camera, 1.0);
}

/// Little-endian floats of a tensor.
fn floats(file: &safetensors::SafeTensors, name: &str) -> Vec<f32> {
    let bytes = file.tensor(name).unwrap().data().to_vec();
    bytes.as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)).collect()
}

#[test]
fn published_scenes_come_out_as_gsplat_renders_them() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/reference/gsplat");
    let gpu = gpu();
    for name in ["basic_case", "tiny_case"] {
        let Ok(bytes) = std::fs::read(folder.join(name).with_extension("safetensors")) else {
            println!("left out: {} is not there", folder.display());
            return;
        };
        let file = safetensors::SafeTensors::deserialize(&bytes).unwrap();
        let columns = [("means", 3), ("scales", 3), ("quats", 4), ("opacities", 1), ("coeffs", 48)];
        let table: Vec<f32> = columns
            .iter()
            .flat_map(|(name, width)| {
                let values = floats(&file, name);
                (0..*width).flat_map(move |c| values.iter().skip(c).step_by(*width).copied().collect::<Vec<_>>())
            })
            .collect();
        let count = table.len() / 59;
        let camera = Camera {
            id: String::new(),
            width: 123,
            height: 82,
            focal: DVec2::splat(61.5),
            principal: DVec2::new(61.5, 41.0),
            rotation: glam::DMat3::IDENTITY,
            translation: DVec3::new(-0.123, -0.456, 8.0),
        };
        let options = SplatOptions { model: SplatModel::trained(3), purpose: Purpose::Images, depth: false };
        let mut splatter = Splatter::new(&gpu, options, count, [123, 82]).unwrap();
        gpu.queue.write_buffer(splatter.gaussians(), 0, bytemuck::cast_slice(&table));
        splatter.set_view(&gpu, View::new(&camera, count, [0.0; 3], 1.0)).unwrap();
        let image = splatter.render(&gpu).unwrap().rgba;
        let expected: Vec<f64> = floats(&file, "out_img").iter().map(|v| f64::from(*v)).collect();
        let worst =
            image.as_flattened().iter().zip(&expected).map(|(a, b)| (f64::from(*a) - b).abs()).fold(0.0, f64::max);
        println!("{name}: {count} Gaussians, largest difference {worst:.1e}");
        assert!(worst <= 1e-5, "{name}: {worst}");
    }
}

#[test]
fn two_runs_give_the_same_bits() {
    let gpu = gpu();
    let camera = camera(64, 64);
    let weights = random_weights(5, 64 * 64);
    let model = SplatModel { antialias: true, ..SplatModel::trained(3) };
    let table = table(&general_scene(4, 2000, 0.002..0.02, 16), &model);
    let runs: Vec<_> = (0..3).map(|_| render_table(&gpu, model, &table, &camera, 1.0, &weights)).collect();
    for run in &runs[1..] {
        assert!(bytemuck::cast_slice::<_, u32>(&runs[0].image) == bytemuck::cast_slice::<_, u32>(&run.image));
        assert!(bytemuck::cast_slice::<_, u32>(&runs[0].gradient) == bytemuck::cast_slice::<_, u32>(&run.gradient));
        assert!(bytemuck::cast_slice::<_, u32>(&runs[0].d_camera) == bytemuck::cast_slice::<_, u32>(&run.d_camera));
    }
}

#[test]
fn a_full_intersection_buffer_grows_instead_of_truncating() {
    let gaussians = random_scene(6, 60, 0.2..0.4);
    let camera = camera(200, 160);
    // Each covers most of the 500 tiles: far more than the first guess of 1024 intersections.
    check_against_twin(SplatModel::HAND, &gaussians, &camera, 0.3);
}

#[test]
fn a_broken_number_in_any_field_drops_its_gaussian_and_touches_nobody() {
    let gpu = gpu();
    let camera = camera(48, 40);
    let weights = random_weights(7, 48 * 40);
    let model = SplatModel::trained(3);
    let rows = model.rows();
    let healthy = general_scene(8, 60, 0.01..0.03, 16);
    let good = table(&healthy, &model);
    let before = render_table(&gpu, model, &good, &camera, 1.0, &weights);
    assert_eq!(before.broken, 0);
    let plain = row_values(&healthy[0], &model);
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        // One broken Gaussian for each row of the table, after the healthy ones.
        let mut worse = Vec::new();
        let mut expected = 0;
        for row in 0..rows {
            worse.extend(&good[row * healthy.len()..(row + 1) * healthy.len()]);
            worse.extend((0..rows).map(|broken| if broken == row { bad } else { plain[row] as f32 }));
            // A logarithm of a size may be minus infinity, a logit either: no size, no or full opacity.
            let is_number = (model.opacity_row() == row)
                || (bad == f32::NEG_INFINITY && (3..3 + model.scale_rows()).contains(&row));
            expected += u32::from(bad.is_nan() || !is_number);
        }
        let after = render_table(&gpu, model, &worse, &camera, 1.0, &weights);
        assert_eq!(after.broken, expected, "{bad}");
        assert!(after.gradient.iter().all(|d| d.is_finite()));
        if bad.is_nan() {
            assert!(bytemuck::cast_slice::<_, u32>(&before.image) == bytemuck::cast_slice::<_, u32>(&after.image));
            for row in 0..rows {
                let (from, to) = (row * healthy.len(), row * (healthy.len() + rows));
                assert_eq!(before.gradient[from..from + healthy.len()], after.gradient[to..to + healthy.len()]);
                assert!(after.gradient[to + healthy.len()..to + healthy.len() + rows].iter().all(|d| *d == 0.0));
            }
        }
    }
}

#[test]
fn no_gaussian_at_all_gives_the_background() {
    let gpu = gpu();
    let mut splatter = Splatter::new(&gpu, SplatOptions::default(), 0, [1, 1]).unwrap();
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

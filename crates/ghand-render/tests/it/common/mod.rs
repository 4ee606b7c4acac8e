//! Scenes, and the comparison of the device with its twin.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test fails by panicking")]
#![allow(clippy::neg_cmp_op_on_partial_ord, reason = "`!(error <= bound)` rejects NaN too")]
#![allow(dead_code, reason = "no test file uses all of it")]

pub mod meshes;

use ghand_core::Camera;
use ghand_render::reference::project::{CameraGradient, Color, Gaussian};
use ghand_render::reference::rasterize::{Scene, Thresholds};
use ghand_render::splat::{self, FLATNESS, Opacity, Purpose, Shape, SplatModel, SplatOptions, Splatter, Stored, View};
use ghand_render::{AdapterChoice, DeviceError, Gpu, Tier, buffers};
use glam::{DQuat, DVec2, DVec3};
use rand::{RngExt, SeedableRng};

pub fn gpu() -> Gpu {
    Gpu::new(&AdapterChoice::from_env()).unwrap_or_else(|e| panic!("{e}"))
}

/// A device of each supported tier.
pub fn devices() -> Vec<Gpu> {
    let open = |tier: Tier| match Gpu::with_tier(&AdapterChoice::from_env(), tier) {
        Ok(gpu) => Some(gpu),
        Err(e @ DeviceError::NoTier { .. }) => {
            println!("skipped: {e}");
            None
        }
        Err(e) => panic!("{e}"),
    };
    Tier::ALL.into_iter().filter_map(open).collect()
}

pub fn rng(seed: u64) -> rand_chacha::ChaCha8Rng {
    rand_chacha::ChaCha8Rng::seed_from_u64(seed)
}

/// A camera with unequal focal lengths, an off-centre principal point and a size that is not a multiple of a tile.
pub fn camera(width: u32, height: u32) -> Camera {
    let look = Camera::look_at(DVec3::new(0.2, -0.1, -0.9), DVec3::ZERO, DVec3::Y, 0.5, width, height);
    Camera { focal: look.focal * DVec2::new(1.0, 1.2), principal: look.principal + DVec2::new(3.3, -2.7), ..look }
}

/// `count` numbers in -size..size.
pub fn random(seed: u64, count: usize, size: f32) -> Vec<f32> {
    let mut rng = rng(seed);
    (0..count).map(|_| rng.random_range(-size..size)).collect()
}

pub fn widen(values: &[f32]) -> Vec<f64> {
    values.iter().map(|v| f64::from(*v)).collect()
}

/// Fails unless the device's numbers equal those of their twin, and unless a single wrong one would be detected. Both
/// round to f32 once or twice.
pub fn assert_same(name: &str, device: &[f64], twin: &[f64]) {
    assert_eq!(device.len(), twin.len(), "{name}");
    let norm = twin.iter().map(|v| v * v).sum::<f64>().sqrt();
    let same = |twin: &[f64]| {
        let squared: f64 = device.iter().zip(twin).map(|(a, b)| (a - b) * (a - b)).sum();
        squared.sqrt() <= 1e-6 * norm
    };
    assert!(same(twin), "{name}");
    let mut wrong = twin.to_vec();
    wrong[twin.len() / 2] += 1e-4 * norm;
    assert!(!same(&wrong), "{name} is not compared");
}

pub fn vector(rng: &mut rand_chacha::ChaCha8Rng) -> DVec3 {
    DVec3::from_array(std::array::from_fn(|_| rng.random_range(-1.0..1.0)))
}

/// Rounded to f32, so that both sides start from the same numbers.
pub fn rounded(v: DVec3) -> DVec3 {
    v.as_vec3().as_dvec3()
}

pub fn random_scene(seed: u64, count: usize, scale: std::ops::Range<f64>) -> Vec<Gaussian> {
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
pub fn general_scene(seed: u64, count: usize, scale: std::ops::Range<f64>, bases: usize) -> Vec<Gaussian> {
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
pub fn row_values(g: &Gaussian, model: &SplatModel) -> Vec<f64> {
    let mut values = g.mean.to_array().to_vec();
    match model.shape {
        Shape::Isotropic => values.push(g.scales.x),
        Shape::Anisotropic => {
            values.extend(g.scales.to_array());
            values.extend([g.rotation.w, g.rotation.x, g.rotation.y, g.rotation.z]);
        }
        Shape::Flat => {
            values.push(g.scales.x);
            values.extend((DQuat::from_vec4(g.rotation) * DVec3::Z).to_array());
        }
    }
    if model.opacity == Opacity::Free {
        values.push(g.opacity);
    }
    values.extend(g.coefficients().iter().flat_map(|c| c.to_array()));
    values
}

/// The Gaussians as a table.
pub fn table(gaussians: &[Gaussian], model: &SplatModel) -> Vec<f32> {
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
    model.table(all.len(), |row, i| stored(row, all[i][row]))
}

/// The twin's gradient in the layout of the table.
pub fn gradient_table(gaussians: &[Gaussian], gradient: &[Gaussian], model: &SplatModel) -> Vec<f64> {
    let mut all: Vec<Vec<f64>> = Vec::new();
    for (g, d) in gaussians.iter().zip(gradient) {
        let mut tied = d.clone();
        match model.shape {
            Shape::Isotropic => tied.scales.x = d.scales.element_sum(),
            Shape::Anisotropic => {}
            Shape::Flat => tied.scales.x = d.scales.x + d.scales.y + FLATNESS * d.scales.z,
        }
        if model.stored == Stored::Unbounded {
            tied.scales *= g.scales;
            tied.opacity *= g.opacity * (1.0 - g.opacity);
        }
        all.push(row_values(&tied, model));
    }
    let mut table = vec![0.0; model.rows() * all.len()];
    for (i, values) in all.iter().enumerate() {
        values.iter().enumerate().for_each(|(row, value)| table[model.index(row, i, all.len())] = *value);
    }
    table
}

pub struct Rendered {
    pub image: Vec<[f32; 4]>,
    pub depths: Vec<f32>,
    pub largest_weights: Vec<f32>,
    pub gradient: Vec<f32>,
    pub d_camera: Vec<f32>,
    pub broken: u32,
}

pub const BACKGROUND: [f32; 3] = [0.2, 0.3, 0.4];

pub fn render_table(
    gpu: &Gpu,
    model: SplatModel,
    table: &[f32],
    camera: &Camera,
    opacity: f32,
    d_image: &[[f32; 4]],
) -> Rendered {
    render_with(gpu, model, splat::Thresholds::default(), table, camera, opacity, d_image)
}

pub fn render_with(
    gpu: &Gpu,
    model: SplatModel,
    thresholds: splat::Thresholds,
    table: &[f32],
    camera: &Camera,
    opacity: f32,
    d_image: &[[f32; 4]],
) -> Rendered {
    let count = table.len() / model.rows();
    let options =
        SplatOptions { model, purpose: Purpose::CameraGradients, depth: true, largest_weights: true, thresholds };
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
        largest_weights: buffers::read(gpu, splatter.largest_weights(), count).unwrap(),
        gradient: buffers::read(gpu, splatter.d_gaussians(), table.len()).unwrap(),
        d_camera: buffers::read(gpu, splatter.d_camera(), 6).unwrap(),
        broken: splatter.read_counters(gpu).unwrap().broken,
        image,
    }
}

pub fn random_weights(seed: u64, pixels: usize) -> Vec<[f32; 4]> {
    let mut rng = rng(seed);
    (0..pixels).map(|_| std::array::from_fn(|_| rng.random_range(-1.0f32..1.0))).collect()
}

/// The larger of two errors; NaN counts as the largest.
pub fn larger(a: f64, b: f64) -> f64 {
    if a.is_nan() || b <= a { a } else { b }
}

/// The largest difference of two images, without pixels that differ by more than `flip`, and the number of those
/// pixels.
pub fn compare_images(image: &[[f32; 4]], twin: &[[f64; 4]], flip: f64) -> (f64, usize) {
    let mut worst = 0.0;
    let mut flips = 0;
    for (a, b) in image.iter().zip(twin) {
        let difference = (0..4).map(|c| (f64::from(a[c]) - b[c]).abs()).fold(0.0, larger);
        if !(difference <= flip) {
            flips += 1;
        } else {
            worst = f64::max(worst, difference);
        }
    }
    (worst, flips)
}

/// Relative L2 error of some numbers.
pub fn relative_error(got: &[f32], expected: &[f64]) -> f64 {
    let difference: f64 = got.iter().zip(expected).map(|(a, b)| (f64::from(*a) - b).powi(2)).sum();
    let norm: f64 = expected.iter().map(|b| b * b).sum();
    if norm == 0.0 { difference.sqrt() } else { (difference / norm).sqrt() }
}

/// Names and rows of the parts of the table.
pub fn parts(model: &SplatModel) -> Vec<(&'static str, std::ops::Range<usize>)> {
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

/// Cosine of the angle between two gradients.
pub fn cosine(got: &[f32], expected: &[f64]) -> f64 {
    let dot: f64 = got.iter().zip(expected).map(|(a, b)| f64::from(*a) * b).sum();
    let norms: f64 =
        got.iter().map(|a| f64::from(*a).powi(2)).sum::<f64>() * expected.iter().map(|b| b * b).sum::<f64>();
    if norms == 0.0 { 1.0 } else { dot / norms.sqrt() }
}

/// Largest error of a gradient's part, and of the image outside flipped pixels.
pub const TOLERANCE: f64 = 1e-4;
/// Rounding changes a pixel by less than this, unless it decides whether a Gaussian contributes: then by up to 1/255.
pub const FLIP: f64 = 2e-5;

/// Renders on the devices of both tiers and compares images, depths and gradients with the twin.
pub fn check_against_twin(model: SplatModel, gaussians: &[Gaussian], camera: &Camera, opacity: f32) {
    check_with_alpha_cut(model, 1, gaussians, camera, opacity);
}

/// As [`check_against_twin`], where less than `alpha` 255ths are not blended.
pub fn check_with_alpha_cut(model: SplatModel, alpha: u32, gaussians: &[Gaussian], camera: &Camera, opacity: f32) {
    let thresholds = splat::Thresholds { alpha, ..splat::Thresholds::default() };
    let cut = f64::from(alpha) / 255.0;
    let numbers = table(gaussians, &model);
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
        filter: model.filter(),
        thresholds: Thresholds { alpha_min: cut, ..Thresholds::default() },
    };
    let twin = scene.rasterize();
    let depth = scene.depth();
    let largest_weights = scene.largest_weights();
    let mut weights = random_weights(3, twin.len());
    let first = render_with(&devices()[0], model, thresholds, &numbers, camera, opacity, &weights);
    // A contribution of just the cut can be used on one side and skipped on the other, and of two Gaussians at almost the
    // same depth either can be in front. Such pixels are counted, and excluded from the loss.
    let flipped = |image: &[[f32; 4]], pixel: usize| {
        !(compare_images(&image[pixel..=pixel], &twin[pixel..=pixel], 1e9).0 <= FLIP)
    };
    let flips = (0..twin.len()).filter(|pixel| flipped(&first.image, *pixel)).count();
    assert!(flips * 200 <= twin.len(), "{flips} of {} pixels flipped", twin.len());
    weights.iter_mut().enumerate().filter(|(pixel, _)| flipped(&first.image, *pixel)).for_each(|(_, w)| *w = [0.0; 4]);
    let d_image: Vec<[f64; 4]> = weights.iter().map(|w| w.map(f64::from)).collect();
    let (gradient, d_camera) = scene.rasterize_vjp(&d_image);
    let expected = gradient_table(&gaussians, &gradient, &model);
    let turn = turn_gradient(camera, &d_camera);
    for gpu in devices() {
        let rendered = render_with(&gpu, model, thresholds, &numbers, camera, opacity, &weights);
        assert!(rendered.image == first.image, "the tiers' images differ");
        let worst = compare_images(&rendered.image, &twin, FLIP).0;
        let depth_error = relative_error(&rendered.depths, &depth);
        println!(
            "{} on the {} tier: image {worst:.1e}, {flips} of {} pixels flipped, depth {depth_error:.1e}",
            name(&model),
            gpu.tier.name(),
            twin.len()
        );
        assert!(compare_images(&rendered.image, &twin, cut + 1.5 / 255.0).1 == 0, "a flip larger than the alpha cut");
        assert!(depth_error <= 1e-3, "depth: {depth_error}");
        let weights_error = relative_error(&rendered.largest_weights, &largest_weights);
        assert!(weights_error <= 1e-3, "largest weights: {weights_error}");
        let check = |what: &str, got: &[f32], expected: &[f64]| {
            let error = relative_error(got, expected);
            let cosine = cosine(got, expected);
            println!("  {what}: relative L2 error {error:.1e}, 1 - cosine {:.1e}", 1.0 - cosine);
            assert!(error <= TOLERANCE && cosine >= 0.99999, "{what}: relative L2 error {error}, cosine {cosine}");
            let wrong: Vec<f64> = expected.iter().map(|d| d * 1.0002).collect();
            assert!(!(relative_error(got, &wrong) <= TOLERANCE), "{what} is not compared");
        };
        for (what, rows) in parts(&model) {
            let range = rows.start * gaussians.len()..rows.end * gaussians.len();
            check(what, &rendered.gradient[range.clone()], &expected[range]);
        }
        check("camera", &rendered.d_camera, &turn);
    }
}

/// A short description of a model.
pub fn name(model: &SplatModel) -> String {
    let SplatModel { shape, opacity, color, stored, antialias, narrow } = model;
    let [antialias, narrow] =
        [(antialias, ", antialiased"), (narrow, ", narrow blur")].map(|(is, what)| if *is { what } else { "" });
    format!("{shape:?}, {opacity:?} opacity, {color:?}, {stored:?}{antialias}{narrow}")
}

/// The camera's gradient in the form of the device: with respect to w and t in x + w x x + t, for camera coordinates x.
pub fn turn_gradient(camera: &Camera, d: &CameraGradient) -> [f64; 6] {
    let product = d.rotation * camera.rotation.transpose();
    let vee = DVec3::new(
        product.y_axis.z - product.z_axis.y,
        product.z_axis.x - product.x_axis.z,
        product.x_axis.y - product.y_axis.x,
    );
    let turn = vee + camera.translation.cross(d.translation);
    [turn.x, turn.y, turn.z, d.translation.x, d.translation.y, d.translation.z]
}

//! The splatter on the device against its f64 twin.

use crate::common::*;
use ghand_core::Camera;
use ghand_hand_model::surface::sample_surface;
use ghand_render::Gpu;
use ghand_render::reference::project::Gaussian;
use ghand_render::splat::{
    Color as SplatColor, FLATNESS, Opacity, Purpose, Shape, SplatModel, SplatOptions, Splatter, Stored, View,
};
use ghand_test_support::cases;
use ghand_test_support::procedural_hand::ProceduralHand;
use glam::{DVec2, DVec3};

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
    for (k, degree) in [0, 1, 2, 3].into_iter().enumerate().skip(cases(2, 0)) {
        let bases = (degree as usize + 1) * (degree as usize + 1);
        let scene = general_scene(20 + k as u64, 400, 0.005..0.03, bases);
        let trained = SplatModel::trained(degree);
        check_against_twin(trained, &scene, &camera, 1.0);
        for narrow in [false, true] {
            let model = SplatModel { antialias: true, narrow, stored: Stored::Plain, ..trained };
            check_against_twin(model, &scene, &camera, 1.0);
        }
    }
    let plain = general_scene(30, 400, 0.005..0.03, 0);
    check_against_twin(SplatModel { color: SplatColor::Rgb, ..SplatModel::trained(0) }, &plain, &camera, 1.0);
    let round = random_scene(31, 2000, 0.0005..0.01);
    check_against_twin(SplatModel { antialias: true, narrow: true, ..SplatModel::HAND }, &round, &camera, 0.8);
    let mut free = round;
    free.iter_mut().enumerate().for_each(|(i, g)| g.opacity = f64::from((i % 97) as f32 / 100.0 + 0.01));
    check_against_twin(SplatModel { opacity: Opacity::Free, ..SplatModel::HAND }, &free, &camera, 1.0);
}

/// Where a sigmoid is almost 1, its derivative must not be computed from it.
#[test]
fn gradients_of_almost_opaque_gaussians_agree_with_the_twin() {
    let mut scene = general_scene(41, 200, 0.005..0.03, 1);
    scene.iter_mut().for_each(|g| g.opacity = 1.0 - 1e-6);
    check_against_twin(SplatModel::trained(0), &scene, &camera(60, 40), 1.0);
}

#[test]
fn flat_gaussians_agree_with_the_twin() {
    let mut scene = general_scene(40, 400, 0.005..0.03, 0);
    for (i, g) in scene.iter_mut().enumerate() {
        g.rotation = (g.rotation / g.rotation.length()).as_vec4().as_dvec4();
        let size = f64::from(g.scales.x.abs().max(0.002) as f32);
        g.scales = DVec3::new(size, size, size * FLATNESS);
        // Straight towards the camera, and edge-on.
        g.rotation = match i % 5 {
            0 => glam::DVec4::W,
            1 => glam::DVec4::new(0.5f64.sqrt(), 0.0, 0.0, 0.5f64.sqrt()),
            _ => g.rotation,
        };
    }
    let flat = SplatModel { shape: Shape::Flat, ..SplatModel::HAND };
    check_against_twin(flat, &scene, &camera(90, 53), 1.0);
    check_against_twin(SplatModel { antialias: true, narrow: true, ..flat }, &scene, &camera(90, 53), 0.8);
}

/// Little-endian floats of a tensor.
fn floats(file: &safetensors::SafeTensors, name: &str) -> Vec<f32> {
    let bytes = file.tensor(name).unwrap().data().to_vec();
    bytes.as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)).collect()
}

#[test]
fn published_scenes_match_the_pictures_of_gsplat() {
    let Some(folder) = ghand_test_support::shared("reference/gsplat") else { return };
    let gpu = gpu();
    for name in ["basic_case", "tiny_case"] {
        let bytes = std::fs::read(folder.join(name).with_extension("safetensors")).unwrap();
        let file = safetensors::SafeTensors::deserialize(&bytes).unwrap();
        let tensors = [("means", 3), ("scales", 3), ("quats", 4), ("opacities", 1), ("coeffs", 48)];
        let columns: Vec<Vec<f32>> = tensors
            .into_iter()
            .flat_map(|(name, width)| {
                let values = floats(&file, name);
                (0..width).map(move |c| values.iter().skip(c).step_by(width).copied().collect())
            })
            .collect();
        let model = SplatModel::trained(3);
        let count = columns[0].len();
        let table = model.table(count, |row, i| columns[row][i]);
        let camera = Camera {
            id: String::new(),
            width: 123,
            height: 82,
            focal: DVec2::splat(61.5),
            principal: DVec2::new(61.5, 41.0),
            rotation: glam::DMat3::IDENTITY,
            translation: DVec3::new(-0.123, -0.456, 8.0),
        };
        let options = SplatOptions { model, purpose: Purpose::Images, ..SplatOptions::default() };
        let mut splatter = Splatter::new(&gpu, options, count, [123, 82]).unwrap();
        gpu.queue.write_buffer(splatter.gaussians(), 0, bytemuck::cast_slice(&table));
        splatter.set_view(&gpu, View::new(&camera, count, [0.0; 3], 1.0)).unwrap();
        let image = splatter.render(&gpu).unwrap().rgba;
        let expected: Vec<f64> = floats(&file, "out_img").iter().map(|v| f64::from(*v)).collect();
        let worst =
            image.as_flattened().iter().zip(&expected).map(|(a, b)| (f64::from(*a) - b).abs()).fold(0.0, larger);
        println!("{name}: {count} Gaussians, largest difference {worst:.1e}");
        assert!(worst <= 1e-5, "{name}: {worst}");
    }
}

#[test]
fn a_hand_agrees_with_the_twin() {
    let hand = ProceduralHand::default().build().unwrap();
    let surface = sample_surface(&hand, 421).unwrap();
    let color = |p: DVec3| DVec3::from((p * 300.0).to_array().map(|v| 0.5 + 0.4 * v.sin()));
    let gaussians: Vec<Gaussian> = (surface.positions.iter().zip(&surface.spacings))
        .map(|(p, spacing)| Gaussian::round(rounded(*p), f64::from((0.6 * spacing) as f32), 1.0, rounded(color(*p))))
        .collect();
    println!("{} Gaussians", gaussians.len());
    let center = gaussians.iter().map(|g| g.mean).sum::<DVec3>() / gaussians.len() as f64;
    let camera = Camera::look_at(center + DVec3::new(0.05, 0.45, 0.1), center, DVec3::Z, 0.45, 334, 512);
    check_against_twin(SplatModel::HAND, &gaussians, &camera, 1.0);
}

#[test]
fn two_runs_give_the_same_bits() {
    for gpu in devices() {
        two_runs_of_one_device(&gpu);
    }
}

fn two_runs_of_one_device(gpu: &Gpu) {
    let camera = camera(64, 64);
    let weights = random_weights(5, 64 * 64);
    let model = SplatModel { antialias: true, ..SplatModel::trained(3) };
    let table = table(&general_scene(4, 2000, 0.002..0.02, 16), &model);
    let runs: Vec<_> = (0..3).map(|_| render_table(gpu, model, &table, &camera, 1.0, &weights)).collect();
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
    // Each covers most of the 500 tiles: far more than the initial capacity of 1024 intersections.
    check_against_twin(SplatModel::HAND, &gaussians, &camera, 0.3);
}

#[test]
fn a_broken_number_in_any_field_drops_its_gaussian_and_no_other() {
    for gpu in devices() {
        broken_numbers(&gpu);
    }
}

fn broken_numbers(gpu: &Gpu) {
    let camera = camera(48, 40);
    let weights = random_weights(7, 48 * 40);
    let model = SplatModel::trained(3);
    let rows = model.rows();
    let healthy = general_scene(8, 60, 0.01..0.03, 16);
    let good = table(&healthy, &model);
    let before = render_table(gpu, model, &good, &camera, 1.0, &weights);
    assert_eq!(before.broken, 0);
    let plain = row_values(&healthy[0], &model);
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        // One broken Gaussian per row of the table, after the valid ones.
        let worse = model.table(healthy.len() + rows, |row, i| match i.checked_sub(healthy.len()) {
            None => good[model.index(row, i, healthy.len())],
            Some(broken) if broken == row => bad,
            Some(_) => plain[row] as f32,
        });
        let mut expected = 0;
        for row in 0..rows {
            // The logarithm of a size can be minus infinity (size 0), a logit either infinity (opacity 0 or 1).
            let is_number = (model.opacity_row() == row)
                || (bad == f32::NEG_INFINITY && (3..3 + model.scale_rows()).contains(&row));
            expected += u32::from(bad.is_nan() || !is_number);
        }
        let after = render_table(gpu, model, &worse, &camera, 1.0, &weights);
        assert_eq!(after.broken, expected, "{bad}");
        assert!(after.gradient.iter().all(|d| d.is_finite()));
        if bad.is_nan() {
            assert!(bytemuck::cast_slice::<_, u32>(&before.image) == bytemuck::cast_slice::<_, u32>(&after.image));
            let all = healthy.len() + rows;
            for (row, i) in (0..rows).flat_map(|row| (0..all).map(move |i| (row, i))) {
                let expected =
                    if i < healthy.len() { before.gradient[model.index(row, i, healthy.len())] } else { 0.0 };
                assert_eq!(after.gradient[model.index(row, i, all)], expected);
            }
        }
    }
}

#[test]
fn a_scene_without_gaussians_gives_the_background() {
    let gpu = gpu();
    let mut splatter = Splatter::new(&gpu, SplatOptions::default(), 0, [1, 1]).unwrap();
    splatter.set_view(&gpu, View::new(&camera(1, 1), 0, [0.2, 0.3, 0.4], 1.0)).unwrap();
    assert_eq!(splatter.render(&gpu).unwrap().rgba, vec![[0.2, 0.3, 0.4, 0.0]]);
}

/// Mesa's software rasteriser chooses the width once in a process, and subgroups of sixteen have their own rasteriser.
#[test]
fn the_other_tests_pass_with_the_other_width_of_vectors() {
    const WIDTH: &str = "LP_NATIVE_VECTOR_WIDTH";
    if !cases(false, true) {
        println!("left to `make test-long`: without its cache the driver compiles for three minutes");
        return;
    }
    #[cfg(target_arch = "x86_64")]
    let has_512 = is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512vl");
    #[cfg(not(target_arch = "x86_64"))]
    let has_512 = false;
    if !has_512 || !gpu().info.name.contains("llvmpipe") {
        println!("skipped: vectors of 512 bits need AVX-512 and Mesa's software rasteriser");
        return;
    }
    let other = if gpu().info.subgroup_min_size == 16 { "256" } else { "512" };
    let output = std::process::Command::new(std::env::current_exe().unwrap())
        .args(["splat::", "--skip", "with_the_other_width_of_vectors"])
        .env(WIDTH, other)
        // It would keep stages compiled for this width.
        .env("MESA_SHADER_CACHE_DISABLE", "true")
        .output()
        .unwrap();
    assert!(output.status.success(), "{other} bits:\n{}", String::from_utf8_lossy(&output.stdout));
}

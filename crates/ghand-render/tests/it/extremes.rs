//! The splatter with extreme inputs, against its f64 twin.
#![allow(clippy::neg_cmp_op_on_partial_ord, reason = "`!(error <= bound)` rejects NaN too")]

use crate::common::*;
use ghand_core::Camera;
use ghand_render::reference::project::{Color, Gaussian};
use ghand_render::reference::rasterize::{Scene, Thresholds};
use ghand_render::splat::{Opacity, Purpose, SplatModel, SplatOptions, Splatter, Stored, View};
use ghand_test_support::cases;
use glam::{DMat3, DVec2, DVec3, DVec4};
use rand::RngExt;

/// Sizes and opacities are stored without logarithms, so that twin and device get the same numbers.
const GENERAL: SplatModel = SplatModel {
    stored: Stored::Plain,
    color: ghand_render::splat::Color::Rgb,
    shape: ghand_render::splat::Shape::Anisotropic,
    opacity: Opacity::Free,
    antialias: false,
    narrow: false,
};

/// A camera at the origin that looks along z; 1 m at a distance of 1 m is `focal` pixels.
fn at_origin(size: u32, focal: f64) -> Camera {
    Camera {
        id: String::new(),
        width: size,
        height: size,
        focal: DVec2::splat(focal),
        principal: DVec2::splat(f64::from(size) / 2.0),
        rotation: DMat3::IDENTITY,
        translation: DVec3::ZERO,
    }
}

fn plain(mean: DVec3, scales: DVec3, opacity: f64) -> Gaussian {
    let color = Color::Rgb(rounded(DVec3::new(0.9, 0.5, 0.2)));
    let rotation = DVec4::new(0.5, -0.25, 0.125, 0.75);
    Gaussian { mean: rounded(mean), scales: rounded(scales), rotation, opacity: f64::from(opacity as f32), color }
}

/// Largest difference of the images of the devices of both tiers and of the twin, each with its Gaussians, and the
/// worst relative L2 error of the gradient's parts. Panics if a value is not finite.
fn errors(model: SplatModel, device: &[Gaussian], gaussians: &[Gaussian], camera: &Camera) -> (f64, f64) {
    let pixels = (camera.width * camera.height) as usize;
    let weights = random_weights(11, pixels);
    let background = DVec3::from(BACKGROUND.map(f64::from));
    let scene = Scene { gaussians, camera, background, filter: model.filter(), thresholds: Thresholds::default() };
    let twin = scene.rasterize();
    let d_image: Vec<[f64; 4]> = weights.iter().map(|w| w.map(f64::from)).collect();
    let gradient = scene.rasterize_vjp(&d_image).0;
    let expected = gradient_table(gaussians, &gradient, &model);
    // Rotating an isotropic Gaussian changes nothing: the terms of the rotation's gradient cancel, but are as large as
    // those of relative changes of the sizes.
    let of_sizes =
        gaussians.iter().zip(&gradient).map(|(g, d)| (g.scales * d.scales).length_squared()).sum::<f64>().sqrt();
    let mut worst = (0.0, 0.0);
    for gpu in devices() {
        let rendered = render_table(&gpu, model, &table(device, &model), camera, 1.0, &weights);
        assert_eq!(rendered.broken, 0);
        let finite = |values: &[f32]| values.iter().all(|v| v.is_finite());
        assert!(finite(rendered.image.as_flattened()) && finite(&rendered.gradient) && finite(&rendered.d_camera));
        let (image_error, flips) = compare_images(&rendered.image, &twin, 2e-3);
        assert!(flips * 100 <= pixels, "{flips} of {pixels} pixels flipped at a threshold");
        let gradient_error = gradient_error(model, &expected, &rendered.gradient, of_sizes);
        worst = (larger(worst.0, image_error), larger(worst.1, gradient_error));
    }
    worst
}

/// Worst relative L2 error of a gradient's parts. `of_sizes` is the norm of the gradient with respect to
/// relative changes of the sizes.
fn gradient_error(model: SplatModel, expected: &[f64], gradient: &[f32], of_sizes: f64) -> f64 {
    let count = expected.len() / model.rows();
    parts(&model)
        .into_iter()
        .map(|(name, rows)| {
            let range = rows.start * count..rows.end * count;
            let got = &gradient[range.clone()];
            let norm = expected[range.clone()].iter().map(|d| d * d).sum::<f64>().sqrt();
            let scale = if name == "rotations" { norm.max(of_sizes) / norm } else { 1.0 };
            if norm == 0.0 { 0.0 } else { relative_error(got, &expected[range]) / scale }
        })
        .fold(0.0, larger)
}

/// Checks both errors and prints them for the table in `docs/numerics.md`.
fn check(what: &str, model: SplatModel, gaussians: &[Gaussian], camera: &Camera, image: f64, gradient: f64) {
    let (image_error, gradient_error) = errors(model, gaussians, gaussians, camera);
    println!("{what}: image {image_error:.1e}, gradients {gradient_error:.1e}");
    assert!(image_error <= image, "{what}: image error {image_error}");
    assert!(gradient_error <= gradient, "{what}: gradient error {gradient_error}");
}

#[test]
fn the_comparison_rejects_other_gaussians_and_nan() {
    let camera = at_origin(40, 50.0);
    let mut rng = rng(1);
    let scene: Vec<Gaussian> =
        (0..20).map(|_| plain(vector(&mut rng) * 0.3 + DVec3::Z, DVec3::new(0.1, 0.05, 0.02), 0.5)).collect();
    let mut other = scene.clone();
    other.iter_mut().for_each(|g| g.scales.x *= 1.002);
    let (image, gradient) = errors(GENERAL, &scene, &other, &camera);
    assert!(image > 1e-4 && gradient > 2e-3, "image {image}, gradients {gradient}");
    assert!([0.0, f64::NAN, 1.0].into_iter().fold(0.0, larger).is_nan());
}

#[test]
fn sizes_from_ten_nanometres_to_ten_metres() {
    let camera = at_origin(40, 50.0);
    let mut rng = rng(1);
    for exponent in (-8..=1).step_by(cases(3, 1)) {
        let size = 10f64.powi(exponent);
        let scene: Vec<Gaussian> = (0..20)
            .map(|_| {
                plain(vector(&mut rng) * 0.3 + DVec3::Z, size * (1.2 + vector(&mut rng)), rng.random_range(0.1..0.9))
            })
            .collect();
        // A Gaussian hundreds of times larger than the image is nearly constant in it: its gradient is a small
        // difference.
        let tolerance = if size >= 1.0 { 2e-4 } else { 1e-4 };
        check(&format!("sizes about {size:e} m"), GENERAL, &scene, &camera, 1e-4, tolerance);
        let antialiased = SplatModel { antialias: true, narrow: true, ..GENERAL };
        check(&format!("sizes about {size:e} m, antialiased"), antialiased, &scene, &camera, 1e-4, tolerance);
    }
}

#[test]
fn gaussians_ten_thousand_times_longer_than_wide() {
    let camera = at_origin(64, 80.0);
    let mut rng = rng(2);
    for scales in [DVec3::new(1.0, 1e-4, 1e-4), DVec3::new(1.0, 1.0, 1e-4), DVec3::new(10.0, 1e-3, 0.1)] {
        let scene: Vec<Gaussian> = (0..30)
            .map(|_| {
                let rotation = vector(&mut rng).extend(rng.random_range(-1.0..1.0)).as_vec4().as_dvec4();
                Gaussian { rotation, ..plain(vector(&mut rng) * 0.2 + DVec3::Z, scales, 0.3) }
            })
            .collect();
        // Up to 800 pixels long and one wide: the exponent is a difference of numbers 1e5 times as large.
        check(&format!("scales {scales}"), GENERAL, &scene, &camera, 1e-4, 2e-3);
    }
}

#[test]
fn the_near_plane_is_sharp_and_nothing_nearer_is_drawn() {
    let camera = at_origin(24, 10.0);
    let near = 0.01f32;
    let at = |z: f32| vec![plain(DVec3::new(0.0, 0.0, f64::from(z)), DVec3::splat(0.002), 0.8)];
    check("on the near plane", GENERAL, &at(near), &camera, 1e-4, 1e-4);
    check("just behind the near plane", GENERAL, &at(near.next_up()), &camera, 1e-4, 1e-4);
    for z in [near.next_down(), 1e-30, 0.0, -1e-30, -1.0, -1e4] {
        let gpu = gpu();
        let rendered = render_table(&gpu, GENERAL, &table(&at(z), &GENERAL), &camera, 1.0, &random_weights(1, 576));
        assert!(rendered.image.iter().all(|p| *p == [BACKGROUND[0], BACKGROUND[1], BACKGROUND[2], 0.0]), "z {z}");
        assert!(rendered.gradient.iter().all(|d| *d == 0.0) && rendered.broken == 0, "z {z}");
    }
}

#[test]
fn gaussians_at_and_beyond_the_edge_of_the_field_of_view() {
    // Slopes are clamped at 15 % of the image beyond its edge: at 0.65 of the size from the middle.
    let camera = at_origin(40, 40.0);
    for slope in [0.499, 0.5, 0.501, 0.649, 0.651, 2.0, 100.0] {
        let scene = vec![
            plain(DVec3::new(slope, 0.1, 1.0), DVec3::splat(0.2 * slope), 0.9),
            plain(DVec3::new(-0.2, -slope, 1.0), DVec3::new(0.3, 0.2, 0.1) * slope, 0.5),
        ];
        check(&format!("at slope {slope}"), GENERAL, &scene, &camera, 1e-4, 1e-3);
    }
}

#[test]
fn one_gaussian_over_the_whole_image_and_one_pixel_images() {
    check(
        "over the whole image",
        GENERAL,
        &[plain(DVec3::Z, DVec3::splat(5.0), 0.7)],
        &at_origin(200, 150.0),
        1e-4,
        1e-4,
    );
    for (width, height) in [(1, 1), (1, 33), (17, 1), (9, 8)] {
        let camera = Camera { width, height, ..at_origin(1, 3.0) };
        let scene =
            vec![plain(DVec3::Z, DVec3::splat(0.3), 0.7), plain(DVec3::new(0.1, 0.0, 1.5), DVec3::splat(0.5), 0.4)];
        check(&format!("{width} x {height} pixels"), GENERAL, &scene, &camera, 1e-4, 1e-4);
    }
}

#[test]
fn a_hundred_thousand_on_one_pixel_blend_in_order_and_more_are_drawn_or_rejected() {
    let camera = at_origin(8, 20.0);
    let mut rng = rng(3);
    let mut on_one_pixel = |count: u32| -> Vec<Gaussian> {
        let gaussian = |i: u32| Gaussian {
            color: Color::Rgb(rounded(vector(&mut rng) * 0.5 + 0.5)),
            ..plain(DVec3::new(0.0, 0.0, 1.0 + f64::from(i % 1000) * 1e-4), DVec3::splat(0.05), 0.006)
        };
        (0..count).map(gaussian).collect()
    };
    check("100,000 on one pixel", GENERAL, &on_one_pixel(100_000), &camera, 1e-4, 1e-3);
    // A software rasteriser cannot process this many where they leave a pixel uncovered, and reports it.
    for gpu in devices() {
        let count = if gpu.tier.has_subgroups() { 540_000 } else { 140_000 };
        let scene = on_one_pixel(count);
        let options = SplatOptions { model: GENERAL, purpose: Purpose::Images, ..SplatOptions::default() };
        let mut splatter = Splatter::new(&gpu, options, scene.len(), [8, 8]).unwrap();
        gpu.queue.write_buffer(splatter.gaussians(), 0, bytemuck::cast_slice(&table(&scene, &GENERAL)));
        splatter.set_view(&gpu, View::new(&camera, scene.len(), BACKGROUND, 1.0)).unwrap();
        match splatter.render(&gpu) {
            Err(error) => {
                let expected = format!("{count} Gaussians are on one tile");
                assert!(gpu.is_cpu() && error.to_string().contains(&expected), "{error}")
            }
            Ok(_) => assert!(!gpu.is_cpu(), "{count} on one pixel: the driver's loop limit was not detected"),
        }
    }
}

#[test]
fn a_gaussian_on_more_tiles_than_a_driver_can_process_is_drawn_or_rejected() {
    let camera = at_origin(2056, 1500.0);
    let scene = [plain(DVec3::Z, DVec3::splat(5.0), 0.7)];
    for gpu in devices() {
        let options = SplatOptions { model: GENERAL, purpose: Purpose::Images, ..SplatOptions::default() };
        let mut splatter = Splatter::new(&gpu, options, 1, [2056, 2056]).unwrap();
        gpu.queue.write_buffer(splatter.gaussians(), 0, bytemuck::cast_slice(&table(&scene, &GENERAL)));
        splatter.set_view(&gpu, View::new(&camera, 1, BACKGROUND, 1.0)).unwrap();
        match splatter.render(&gpu) {
            Err(error) => assert!(gpu.is_cpu() && error.to_string().contains("covers 66049 tiles"), "{error}"),
            Ok(image) => assert!(!gpu.is_cpu() && image.rgba.iter().all(|p| p[3] > 0.5)),
        }
    }
}

#[test]
fn equal_depths_are_drawn_in_the_order_of_the_table() {
    let camera = at_origin(16, 20.0);
    let colors = [DVec3::X, DVec3::Y, DVec3::Z];
    let scene: Vec<Gaussian> =
        colors.iter().map(|c| Gaussian { color: Color::Rgb(*c), ..plain(DVec3::Z, DVec3::splat(0.2), 0.6) }).collect();
    check("equal depths", GENERAL, &scene, &camera, 1e-4, 1e-4);
    let gpu = gpu();
    let middle =
        render_table(&gpu, GENERAL, &table(&scene, &GENERAL), &camera, 1.0, &random_weights(1, 256)).image[8 * 16 + 8];
    assert!(middle[0] > middle[1] && middle[1] > middle[2], "{middle:?}");
}

#[test]
fn opacities_near_the_cut_and_at_both_ends() {
    let camera = at_origin(16, 20.0);
    let cut = 1.0f32 / 255.0;
    // The Gaussian's centre is at a pixel's centre, where alpha equals the opacity.
    let seen = |opacity: f32| {
        let gaussian = plain(DVec3::new(0.025, 0.025, 1.0), DVec3::splat(0.1), f64::from(opacity));
        let gpu = gpu();
        let rendered =
            render_table(&gpu, GENERAL, &table(&[gaussian], &GENERAL), &camera, 1.0, &random_weights(1, 256));
        assert!(rendered.gradient.iter().all(|d| d.is_finite()));
        rendered.image.iter().filter(|p| p[3] > 0.0).count()
    };
    assert_eq!([0.0, cut.next_down()].map(seen), [0, 0]);
    // Projected in f32, the centre can miss the pixel's centre by a rounding error, and alpha the cut with it.
    assert!(seen(cut) <= 1 && seen(cut.next_up()) <= 1);
    assert!(seen(cut * 1.001) >= 1);
    assert!(seen(1.0) > 40);
    let opaque = vec![plain(DVec3::Z, DVec3::splat(0.2), 1.0); 3];
    check("opacity 1", GENERAL, &opaque, &camera, 1e-4, 1e-4);
}

#[test]
fn quaternions_of_any_norm_rotate_equally_and_zero_is_dropped() {
    let camera = at_origin(24, 30.0);
    let gaussian = plain(DVec3::Z, DVec3::new(0.2, 0.05, 0.01), 0.8);
    let gpu = gpu();
    let image = |factor: f64| {
        let scaled = Gaussian { rotation: gaussian.rotation * factor, ..gaussian.clone() };
        render_table(&gpu, GENERAL, &table(&[scaled], &GENERAL), &camera, 1.0, &random_weights(1, 576))
    };
    let unit = image(1.0);
    // Powers of two, so that rounding is the same. Gradients are inversely proportional to the norm.
    for exponent in [-100, -60, -20, 20, 60, 100] {
        let other = image(2f64.powi(exponent));
        assert_eq!(unit.image, other.image, "2^{exponent}");
        let row = GENERAL.rotation_row();
        for (a, b) in unit.gradient[row..row + 4].iter().zip(&other.gradient[row..row + 4]) {
            assert_eq!(f64::from(*a), f64::from(*b) * 2f64.powi(exponent), "2^{exponent}");
        }
    }
    let dropped = image(0.0);
    assert_eq!(dropped.broken, 1);
    assert!(dropped.image.iter().all(|p| p[3] == 0.0) && dropped.gradient.iter().all(|d| *d == 0.0));
}

#[test]
fn ten_kilometres_away() {
    // A scene at this distance, through a lens that magnifies it to the size of a hand at arm's length.
    let camera = at_origin(40, 40.0);
    let mut rng = rng(4);
    let scene: Vec<Gaussian> = (0..50)
        .map(|_| plain(1e4 * (vector(&mut rng) * 0.3 + DVec3::Z), 1e4 * 0.05 * (1.2 + vector(&mut rng)), 0.5))
        .collect();
    check("10 km away", GENERAL, &scene, &camera, 1e-4, 1e-4);
    // A hand this far from the origin, with the camera next to it: f32 coordinates are 1 mm apart there.
    let offset = DVec3::new(1e4, 0.0, 0.0);
    let near: Vec<Gaussian> = (0..50)
        .map(|_| plain(offset + vector(&mut rng) * 0.3 + DVec3::Z, 0.05 * (1.2 + vector(&mut rng)), 0.5))
        .collect();
    check("10 km from the origin", GENERAL, &near, &Camera { translation: -offset, ..camera }, 1e-4, 1e-3);
}

#[test]
fn subnormal_numbers_count_as_zero_or_as_themselves() {
    let camera = at_origin(16, 20.0);
    let denormal = f32::MIN_POSITIVE / 1024.0;
    let good = vec![plain(DVec3::Z, DVec3::splat(0.1), 0.8), plain(DVec3::new(0.1, 0.1, 1.2), DVec3::splat(0.2), 0.6)];
    let gpu = gpu();
    let weights = random_weights(1, 256);
    let before = table(&good, &GENERAL);
    for row in 0..GENERAL.rows() {
        let with = |value: f32| {
            let mut numbers = before.clone();
            numbers[row * 2] = value;
            render_table(&gpu, GENERAL, &numbers, &camera, 1.0, &weights)
        };
        let tiny = with(denormal);
        let zero = with(0.0);
        assert!(tiny.image.as_flattened().iter().chain(&tiny.gradient).all(|v| v.is_finite()), "row {row}");
        assert_eq!(tiny.image, zero.image, "row {row}");
        // The second Gaussian is unaffected.
        let of_second = |r: &Rendered| r.gradient.iter().skip(1).step_by(2).copied().collect::<Vec<_>>();
        assert_eq!(of_second(&tiny), of_second(&zero), "row {row}");
    }
}

#[test]
fn a_million_gaussians() {
    let count = 1_000_000;
    let camera = at_origin(96, 100.0);
    let gaussians: Vec<Gaussian> = random_scene(5, count, 0.0005..0.002)
        .into_iter()
        .map(|g| Gaussian { mean: rounded(g.mean + DVec3::Z), ..g })
        .collect();
    let gpu = gpu();
    let model = SplatModel::HAND;
    let numbers = table(&gaussians, &SplatModel::HAND);
    let background = DVec3::from(BACKGROUND.map(f64::from));
    let scene = Scene {
        gaussians: &gaussians,
        camera: &camera,
        background,
        filter: model.filter(),
        thresholds: Thresholds::default(),
    };
    let twin = scene.rasterize();
    let mut weights = random_weights(7, twin.len());
    let image = render_table(&gpu, model, &numbers, &camera, 1.0, &weights).image;
    let (error, flips) = compare_images(&image, &twin, 2e-3);
    println!("1,000,000 Gaussians: image {error:.1e}, {flips} of {} pixels flipped", image.len());
    assert!(error <= 1e-3 && flips * 20 <= image.len(), "{error}, {flips} flips");

    // Without the pixels that rounding has decided otherwise.
    for (pixel, weight) in weights.iter_mut().enumerate() {
        if compare_images(&image[pixel..=pixel], &twin[pixel..=pixel], FLIP).1 > 0 {
            *weight = [0.0; 4];
        }
    }
    let gradient = render_table(&gpu, model, &numbers, &camera, 1.0, &weights).gradient;
    let d_image: Vec<[f64; 4]> = weights.iter().map(|w| w.map(f64::from)).collect();
    let expected = gradient_table(&gaussians, &scene.rasterize_vjp(&d_image).0, &model);
    let error = gradient_error(model, &expected, &gradient, 0.0);
    println!("1,000,000 Gaussians: gradients {error:.1e}");
    assert!(error <= 1e-3, "{error}");
}

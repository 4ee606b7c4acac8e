//! The mesh rasteriser's lines: compared with their twin, and tests of their properties.

use std::sync::LazyLock;

use crate::common::gpu;
use crate::common::meshes::{Model, at_pixel, camera, camera_inside, compare, covered, lights, lines, torus};
use ghand_core::Camera;
use ghand_render::mesh::{MeshImage, MeshRenderer, MeshStyle, Shading, Wireframe};
use ghand_render::reference::mesh::render;
use glam::{DVec2, DVec3};

#[test]
fn the_device_draws_the_lines_that_the_twin_draws() {
    let torus = torus(16, 10);
    let renderer = MeshRenderer::new(&gpu()).unwrap();
    for width in [0.5, 1.0, 2.3, 8.0] {
        for (k, shading) in
            [(1, Shading::Transparent), (2, Shading::Transparent), (2, lights()), (3, Shading::Unlit), (4, lights())]
        {
            let style = lines(k, shading, width);
            for (camera, flips) in [(camera(), 10), (camera_inside(), 16)] {
                let expected = render(&torus.colored(), &camera, &style).unwrap();
                let image = renderer.render(&torus.colored(), &camera, &style).unwrap();
                compare(&image, &expected, flips).unwrap_or_else(|e| panic!("{style:?}: {e}"));
                assert!(covered(&image) > 700);
            }
        }
    }
}

#[test]
fn the_comparator_rejects_wrong_lines() {
    let good_torus = torus(16, 10);
    let camera = camera();
    let style = lines(2, lights(), 2.0);
    let wireframe = style.wireframe.unwrap();
    let good = render(&good_torus.colored(), &camera, &style).unwrap();
    let with = |wireframe: Wireframe| MeshStyle { wireframe: Some(wireframe), ..style.clone() };
    let draw = |torus: &Model, style: &MeshStyle| render(&torus.colored(), &camera, style).unwrap();
    for (wrong, what) in [
        (with(Wireframe { width: 2.02, ..wireframe }), "a hundredth wider"),
        (with(Wireframe { color: wireframe.color + DVec3::X * 0.002, ..wireframe }), "another red"),
        (MeshStyle { wireframe: None, ..style.clone() }, "no lines"),
        (MeshStyle { shading: Shading::Transparent, ..style.clone() }, "no faces"),
    ] {
        assert!(compare(&draw(&good_torus, &wrong), &good, 16).is_err(), "{what}");
    }
    // Mirrored diagonals.
    let mut other = good_torus.clone();
    for pair in other.triangles.chunks_exact_mut(2) {
        let [a, b, c, d] = [pair[0][0], pair[0][1], pair[0][2], pair[1][2]];
        pair.copy_from_slice(&[[a, b, d], [b, c, d]]);
    }
    assert!(compare(&draw(&other, &style), &good, 16).is_err(), "other edges");
}

/// The images of device and twin.
fn draw(model: &Model, camera: &Camera, style: &MeshStyle) -> [MeshImage; 2] {
    static RENDERER: LazyLock<MeshRenderer> = LazyLock::new(|| MeshRenderer::new(&gpu()).unwrap());
    let device = RENDERER.render(&model.textured(), camera, style).unwrap();
    [device, render(&model.textured(), camera, style).unwrap()]
}

/// 64 x 64 pixels; 1 m at a distance of 1 m is 100 pixels.
fn straight_camera() -> Camera {
    let camera = Camera::look_at(DVec3::ZERO, DVec3::Z, DVec3::NEG_Y, 1.0, 64, 64);
    Camera { focal: DVec2::splat(100.0), principal: DVec2::splat(32.0), ..camera }
}

/// Line coverage in row `y` from `x0` to `x1`, pixels: a colour channel's difference from `background`, relative to
/// `ink`.
fn ink(image: &MeshImage, channel: usize, background: f32, ink: f32, y: u32, [x0, x1]: [u32; 2]) -> f64 {
    let at =
        |x: u32| f64::from((image.rgba[(y * image.width + x) as usize][channel] - background) / (ink - background));
    (x0..x1).map(at).sum()
}

#[test]
fn a_line_has_the_set_width_between_faces_on_ridges_in_valleys_and_on_outlines() {
    let camera = straight_camera();
    let at = |x: f64, y: f64, z: f64| at_pixel(&camera, x, y, z);
    // A vertical edge at x = 30.3 that two faces share, whose other sides are far outside: depth of the edge, depths of
    // the sides, and x of the sides.
    let shapes = [
        ("flat", 1.0, [1.0, 1.0], [-200.0, 260.0]),
        ("ridge", 0.5, [2.0, 2.0], [-200.0, 260.0]),
        ("steep ridge", 0.3, [9.0, 9.0], [28.0, 33.0]),
        ("valley", 2.0, [0.5, 0.5], [-200.0, 260.0]),
        ("steep valley", 9.0, [0.3, 0.3], [-4.0, 68.0]),
        ("a steep side", 1.0, [1.0, 9.0], [-200.0, 260.0]),
        ("outline", 0.5, [1.0, 2.0], [-200.0, -200.0]),
        ("steep outline", 0.5, [3.0, 9.0], [27.0, 26.0]),
    ];
    for (name, depth, [left, right], [x0, x1]) in shapes {
        let positions = [
            at(30.3, -300.0, depth),
            at(30.3, 364.0, depth),
            at(x0, -300.0, left),
            at(x1, 364.0, right),
            at(x0, 364.0, left),
            at(x1, -300.0, right),
        ];
        let both: &[[u32; 3]] = &[[0, 1, 2], [4, 1, 2], [0, 1, 3], [5, 0, 3]];
        for (triangles, shared) in [(both, true), (&both[..2], false)] {
            let model = Model::plain(&positions, triangles);
            for width in [0.5, 1.0, 1.7, 3.0, 8.0] {
                for k in [1, 2, 4] {
                    let transparent = lines(k, Shading::Transparent, width);
                    let narrow = (x0 - 30.3).abs().min((x1 - 30.3).abs()) < 10.0;
                    for image in draw(&model, &camera, &transparent) {
                        for y in [1, 20, 31, 62] {
                            // Other lines nearby only add: the pixel in the middle must have at least its part.
                            let (found, right) = if narrow {
                                let share = f64::min(31.0, 30.3 + width / 2.0) - f64::max(30.0, 30.3 - width / 2.0);
                                let found = ink(&image, 3, 0.0, 1.0, y, [30, 31]);
                                (found, found >= share - 0.07)
                            } else {
                                let found = ink(&image, 3, 0.0, 1.0, y, [24, 38]);
                                (found, (found - width).abs() <= 2e-3)
                            };
                            assert!(right, "{name}, shared {shared}, {width} px, {k} samples, row {y}: {found}");
                        }
                    }
                    if name == "outline" || !shared || narrow {
                        continue;
                    }
                    // On white faces, lines reduce blue.
                    let style = MeshStyle { shading: Shading::Unlit, ..transparent };
                    for image in draw(&model, &camera, &style) {
                        let found = ink(&image, 2, 1.0, 0.1, 31, [24, 38]);
                        assert!((found - width).abs() <= 2e-3, "{name} on faces: {found}, not {width}");
                    }
                }
            }
        }
    }
}

#[test]
fn a_slanted_line_has_the_set_width_and_round_ends() {
    let camera = straight_camera();
    let at = |x: f64, y: f64| at_pixel(&camera, x, y, 1.0);
    // One line: a triangle without area.
    let (a, b) = (DVec2::new(14.2, 11.7), DVec2::new(50.1, 40.4));
    let model = Model::plain(&[at(a.x, a.y), at(b.x, b.y)], &[[0, 1, 1]]);
    for width in [0.5, 1.0, 2.5, 8.0] {
        for k in [1, 2, 4] {
            for image in draw(&model, &camera, &lines(k, Shading::Transparent, width)) {
                let area: f64 = image.rgba.iter().map(|p| f64::from(p[3])).sum();
                // The filter is one sample wide along the distance: it rounds ends and corners by a fraction of a
                // sample.
                let expected = a.distance(b) * width + std::f64::consts::PI * width * width / 4.0;
                assert!((area - expected).abs() <= 0.01 * expected + 0.5, "{width}, {k}: {area}, not {expected}");
            }
        }
    }
}

#[test]
fn a_face_hides_the_lines_behind_it() {
    let camera = straight_camera();
    let at = |x: f64, y: f64, z: f64| at_pixel(&camera, x, y, z);
    // A large face in front of a small one, which extends beyond it to the right.
    let positions = [
        at(10.0, 10.0, 1.0),
        at(40.0, 10.0, 1.0),
        at(10.0, 60.0, 1.0),
        at(40.0, 60.0, 1.0),
        at(20.5, 30.0, 1.5),
        at(56.5, 28.0, 1.5),
        at(56.5, 44.0, 1.5),
    ];
    let model = Model::plain(&positions, &[[0, 1, 2], [1, 2, 3], [4, 5, 6]]);
    let alpha = |image: &MeshImage, x: usize, y: usize| image.rgba[y * 64 + x];
    for k in [1, 3] {
        for image in draw(&model, &camera, &lines(k, Shading::Transparent, 1.0)) {
            assert_eq!(alpha(&image, 36, 29)[3], 0.0, "the line behind is not drawn");
            assert!((alpha(&image, 56, 36)[3] - 1.0).abs() < 1e-3, "beside the face it is drawn");
        }
    }
}

#[test]
fn nothing_hidden_shows_through_a_closed_surface() {
    // The near half of a torus hides the far half: the lines equal those of only the near triangles, as far as these
    // reach.
    let full = torus(20, 12);
    let camera = camera();
    let facing = |t: &&[u32; 3]| {
        let [a, b, c] = t.map(|i| full.positions[i as usize]);
        (b - a).cross(c - a).dot(camera.center() - a) > 0.0
    };
    let near = Model { triangles: full.triangles.iter().filter(facing).copied().collect(), ..full.clone() };
    let far = Model { triangles: full.triangles.iter().filter(|t| !facing(t)).copied().collect(), ..full.clone() };
    for k in [1, 3] {
        let style = lines(k, Shading::Transparent, 1.0);
        let [all, _] = draw(&full, &camera, &style);
        let [front, _] = draw(&near, &camera, &style);
        let ink = |image: &MeshImage| image.rgba.iter().map(|p| f64::from(p[3])).sum::<f64>();
        let more = ink(&all) / ink(&front) - 1.0;
        // A line continues for up to a sample after it passes behind a face.
        assert!(more.abs() < 0.02, "{k}: {more} more ink with the triangles that face away");
        let [behind, _] = draw(&far, &camera, &style);
        assert!(ink(&behind) > 0.3 * ink(&all), "there are lines to hide");
    }
}

#[test]
fn one_sample_per_pixel_gives_nearly_the_image_of_sixteen() {
    let torus = torus(16, 10);
    let camera = camera();
    for width in [0.5, 1.0, 3.0] {
        let [coarse, _] = draw(&torus, &camera, &lines(1, Shading::Transparent, width));
        let [fine, _] = draw(&torus, &camera, &lines(4, Shading::Transparent, width));
        let pairs = coarse.rgba.iter().zip(&fine.rgba);
        let mean = pairs.map(|(a, b)| f64::from((a[3] - b[3]).abs())).sum::<f64>() / coarse.rgba.len() as f64;
        assert!(mean < 0.03, "{width}: {mean}");
    }
}

#[test]
fn the_order_of_triangles_does_not_matter() {
    let torus = torus(16, 10);
    let camera = camera();
    let renderer = MeshRenderer::new(&gpu()).unwrap();
    let mut reversed = torus.clone();
    reversed.triangles.reverse();
    reversed.triangles.extend_from_slice(&torus.triangles);
    let style = lines(2, Shading::Transparent, 1.5);
    let draw = |model: &Model| renderer.render(&model.textured(), &camera, &style).unwrap();
    assert_eq!(draw(&torus), draw(&reversed));
}

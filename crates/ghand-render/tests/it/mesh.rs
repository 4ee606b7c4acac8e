//! The mesh rasteriser's faces on the device against their twin; lines are in `wireframe.rs`.

use crate::common::gpu;
use crate::common::meshes::{Model, at_pixel, camera, camera_inside, compare, covered, faces, lights, lines, torus};
use ghand_core::Camera;
use ghand_core::mesh::Texture;
use ghand_render::mesh::weights::{joint_mix, weight_color};
use ghand_render::mesh::{MeshInstance, MeshRenderer, MeshStyle, Shading, Surface, Wireframe};
use ghand_render::reference::mesh::render;
use glam::{DVec2, DVec3};

#[test]
fn the_device_draws_what_the_twin_draws() {
    let torus = torus(40, 24);
    let camera = camera();
    let renderer = MeshRenderer::new(&gpu()).unwrap();
    let styles = [1, 2, 3, 4].map(|k| faces(k, lights()));
    for style in styles.into_iter().chain([faces(1, Shading::Unlit), faces(2, Shading::Transparent)]) {
        for mesh in [torus.textured(), torus.colored(), torus.with(Surface::Color(DVec3::new(0.2, 0.5, 0.9)))] {
            let expected = render(&mesh, &camera, &style).unwrap();
            let image = renderer.render(&mesh, &camera, &style).unwrap();
            compare(&image, &expected, 2).unwrap();
            let transparent = style.shading == Shading::Transparent;
            assert!(if transparent { covered(&image) == 0 } else { covered(&image) > 1500 });
        }
    }
}

#[test]
fn weight_colours_are_drawn_as_by_the_twin() {
    let torus = torus(40, 24);
    let camera = camera();
    let renderer = MeshRenderer::new(&gpu()).unwrap();
    // Three joints around the ring; a third of it does not follow the second.
    let row = |uv: &DVec2| {
        let second = (uv.x - 1.0 / 3.0).max(0.0);
        [uv.y * (1.0 - second), second, (1.0 - uv.y) * (1.0 - second)]
    };
    let weights: Vec<f64> = torus.uvs.iter().flat_map(row).collect();
    let second = weights.iter().skip(1).step_by(3).map(|weight| weight_color(*weight)).collect();
    for colors in [second, joint_mix(&weights, 3).unwrap()] {
        let mesh = torus.with(Surface::VertexColors(&colors));
        for shading in [Shading::Unlit, lights()] {
            let expected = render(&mesh, &camera, &faces(2, shading.clone())).unwrap();
            compare(&renderer.render(&mesh, &camera, &faces(2, shading)).unwrap(), &expected, 2).unwrap();
        }
    }
}

#[test]
fn triangles_through_the_near_plane_are_clipped_as_by_the_twin() {
    let torus = torus(40, 24);
    let camera = camera_inside();
    let renderer = MeshRenderer::new(&gpu()).unwrap();
    for mesh in [torus.textured(), torus.colored()] {
        let expected = render(&mesh, &camera, &faces(2, lights())).unwrap();
        compare(&renderer.render(&mesh, &camera, &faces(2, lights())).unwrap(), &expected, 4).unwrap();
    }
}

#[test]
fn the_comparator_rejects_wrong_images() {
    let good_torus = torus(40, 24);
    let good_camera = camera();
    let style = faces(2, lights());
    let good = render(&good_torus.textured(), &good_camera, &style).unwrap();
    compare(&good, &good, 0).unwrap();
    let draw = |torus: &Model, camera: &Camera, style| render(&torus.textured(), camera, &style).unwrap();
    let shifted = Camera { principal: good_camera.principal + DVec2::new(0.1, 0.0), ..good_camera.clone() };
    assert!(compare(&draw(&good_torus, &shifted, style.clone()), &good, 4).is_err(), "a tenth of a pixel");
    let nearer = Camera { translation: good_camera.translation - DVec3::Z * 1e-5, ..good_camera.clone() };
    assert!(compare(&draw(&good_torus, &nearer, style.clone()), &good, 4).is_err(), "ten micrometres");
    let mut inside_out = good_torus.clone();
    inside_out.normals.iter_mut().for_each(|n| *n = -*n);
    assert!(compare(&draw(&inside_out, &good_camera, style.clone()), &good, 4).is_err(), "other normals");
    assert!(compare(&render(&good_torus.colored(), &good_camera, &style).unwrap(), &good, 4).is_err(), "other colours");
    assert!(compare(&draw(&good_torus, &good_camera, faces(1, lights())), &good, 4).is_err(), "aliased");
    for change in [|p: &mut [f32; 4], _: &mut f32| *p = [f32::NAN; 4], |_: &mut [f32; 4], z: &mut f32| *z = f32::NAN] {
        let mut broken = good.clone();
        change(&mut broken.rgba[30 * 75 + 8], &mut broken.depth[30 * 75 + 8]);
        assert!(compare(&broken, &good, 0).is_err(), "not a number");
    }
    let mut short = good.clone();
    short.depth.pop();
    assert!(compare(&short, &good, 4).is_err(), "a pixel is missing");
}

#[test]
fn pixel_centres_are_where_the_camera_projects_them() {
    // A square whose projection is exactly the pixels 3..7 x 2..5.
    let camera = Camera { focal: DVec2::new(20.0, 30.0), principal: DVec2::new(1.25, 9.0), ..camera() };
    let world = |x: f64, y: f64| at_pixel(&camera, x, y, 0.4);
    let square =
        Model::plain(&[world(3.0, 2.0), world(7.0, 2.0), world(3.0, 5.0), world(7.0, 5.0)], &[[0, 1, 2], [2, 1, 3]]);
    let style = faces(1, Shading::Unlit);
    let renderer = MeshRenderer::new(&gpu()).unwrap();
    let mesh = square.textured();
    for image in [render(&mesh, &camera, &style).unwrap(), renderer.render(&mesh, &camera, &style).unwrap()] {
        for y in 0..camera.height {
            for x in 0..camera.width {
                let i = (y * camera.width + x) as usize;
                let covered = (3..7).contains(&x) && (2..5).contains(&y);
                assert_eq!(image.rgba[i][3], if covered { 1.0 } else { 0.0 }, "({x}, {y})");
                assert!(if covered { (image.depth[i] - 0.4).abs() < 1e-6 } else { image.depth[i] == f32::INFINITY });
            }
        }
    }
}

/// Extreme meshes, with their camera, the number of allowed flips, and whether anything is visible with faces and
/// lines.
fn extremes() -> Vec<(&'static str, Model, Camera, usize, [bool; 2])> {
    let camera = camera();
    let at = |x: f64, y: f64, depth: f64| at_pixel(&camera, x, y, depth);
    let torus = torus(40, 24);
    let behind: Vec<DVec3> = torus.positions.iter().map(|p| *p + 2.0 * camera.center()).collect();
    // A vertex inside the outline is at a pixel's centre, so that some sample hits the surface.
    let center = at(30.5, 20.5, 0.4) - torus.positions[106] * 5e-3;
    let fine: Vec<DVec3> = torus.positions.iter().map(|p| *p * 5e-3 + center).collect();
    let wide = [at(-1e4, -2e4, 0.3), at(3e4, -1e4, 0.5), at(0.0, 3e4, 0.7)];
    let tiny = camera.cropped(53, 36, 1, 1);
    let inside = camera_inside();
    let point = at(30.2, 20.7, 0.4);
    let line = [at(10.0, 10.0, 0.4), at(50.0, 30.0, 0.4), at(30.0, 20.0, 0.4)];
    vec![
        ("no triangles", Model::plain(&[], &[]), camera.clone(), 0, [false; 2]),
        ("vertices alone", Model::plain(&wide, &[]), camera.clone(), 0, [false; 2]),
        ("behind the camera", Model { positions: behind, ..torus.clone() }, camera.clone(), 0, [false; 2]),
        // Samples of the surface flip between triangles smaller than a sample, and between its colours.
        ("smaller than a pixel", Model { positions: fine, ..torus.clone() }, camera.clone(), 4, [true; 2]),
        ("all over the image", Model::plain(&wide, &[[0, 1, 2]]), camera.clone(), 0, [true, false]),
        ("one pixel", torus.clone(), tiny, 0, [true; 2]),
        ("through the near plane", torus, inside, 16, [true; 2]),
        ("a point", Model::plain(&[point; 3], &[[0, 1, 2]]), camera.clone(), 0, [false, true]),
        ("one vertex", Model::plain(&[point], &[[0, 0, 0]]), camera.clone(), 0, [false, true]),
        // The area is zero except for rounding, which may or may not give it a sample.
        ("a line", Model::plain(&line, &[[0, 1, 2]]), camera, 8, [false, true]),
    ]
}

#[test]
fn extreme_meshes_are_drawn_as_the_twin_draws_them_in_every_style() {
    let renderer = MeshRenderer::new(&gpu()).unwrap();
    for (name, model, camera, flips, [faces_seen, lines_seen]) in extremes() {
        let styles = [faces(1, Shading::Unlit), faces(3, lights())].map(|s| (s, faces_seen));
        let line_styles = [(1, 0.5), (2, 1.5), (2, 8.0)].map(|(k, width)| lines(k, Shading::Transparent, width));
        let over_faces = lines(3, lights(), 1.0);
        let line_styles = line_styles.map(|s| (s, lines_seen)).into_iter();
        for (style, seen) in styles.into_iter().chain(line_styles).chain([(over_faces, faces_seen || lines_seen)]) {
            for mesh in [model.textured(), model.colored()] {
                let expected = render(&mesh, &camera, &style).unwrap();
                let image = renderer.render(&mesh, &camera, &style).unwrap();
                compare(&image, &expected, flips).unwrap_or_else(|e| panic!("{name}, {style:?}: {e}"));
                assert_eq!(covered(&image) > 0, seen, "{name}, {style:?}");
            }
        }
    }
}

#[test]
fn unusable_input_is_named() {
    let torus = torus(8, 6);
    let camera = camera();
    let style = faces(1, lights());
    let renderer = MeshRenderer::new(&gpu()).unwrap();
    let says = |mesh: MeshInstance, camera: &Camera, style: &MeshStyle, text: &str| {
        let errors = [render(&mesh, camera, style).unwrap_err(), renderer.render(&mesh, camera, style).unwrap_err()];
        for error in errors.map(|e| e.to_string()) {
            assert!(error.contains(text), "{error:?} does not name {text:?}");
        }
    };
    let mesh = torus.textured();
    says(MeshInstance { normals: &[], ..mesh }, &camera, &style, "vertices");
    says(MeshInstance { light_visibility: Some(&[]), ..mesh }, &camera, &style, "light_visibility");
    says(MeshInstance { triangles: &[[0, 1, 99_999]], ..mesh }, &camera, &style, "triangles");
    says(torus.with(Surface::Texture { uvs: &[], texture: &torus.texture }), &camera, &style, "uvs");
    let broken = Texture { width: 2, height: 2, rgb: vec![] };
    says(torus.with(Surface::Texture { uvs: &torus.uvs, texture: &broken }), &camera, &style, "texture");
    says(torus.with(Surface::VertexColors(&[])), &camera, &style, "vertex colors");
    says(torus.with(Surface::Color(DVec3::splat(1.1))), &camera, &style, "color");

    // NaN, or a number far out of range, at vertex 5.
    let bad = |change: fn(&mut Model)| {
        let mut model = torus.clone();
        change(&mut model);
        model
    };
    let model = bad(|m| m.positions[5].y = f64::NAN);
    says(model.textured(), &camera, &style, "positions: vertex 5");
    let model = bad(|m| m.positions[5].y = 1e30);
    says(model.textured(), &camera, &style, "positions: vertex 5 is");
    let model = bad(|m| m.normals[5].x = f64::INFINITY);
    says(model.textured(), &camera, &style, "normals: the normal of vertex 5");
    let model = bad(|m| m.light_visibility[5] = f64::NAN);
    says(model.textured(), &camera, &style, "light_visibility: vertex 5");
    let model = bad(|m| m.uvs[5].x = f64::NAN);
    says(model.textured(), &camera, &style, "uvs: the UV of vertex 5");
    let model = bad(|m| m.colors[5].x = f64::NAN);
    says(model.colored(), &camera, &style, "vertex colors: the color of vertex 5");

    for camera in [
        Camera { width: 0, ..camera.clone() },
        Camera { focal: DVec2::new(0.0, 1.0), ..camera.clone() },
        Camera { principal: DVec2::NAN, ..camera.clone() },
        Camera { translation: DVec3::NAN, ..camera.clone() },
    ] {
        says(mesh, &camera, &style, "camera");
    }
    says(mesh, &camera, &faces(5, lights()), "supersample");
    for width in [0.0, -1.0, 17.0, f64::NAN] {
        says(mesh, &camera, &lines(1, lights(), width), "line width");
    }
    let no_color = Some(Wireframe { width: 1.0, color: DVec3::NAN });
    says(mesh, &camera, &MeshStyle { wireframe: no_color, ..style.clone() }, "line color");
    for wrap in [-0.1, 1.1, f64::NAN] {
        let Shading::Lit { ambient, lights, .. } = lights() else { panic!("not lit") };
        says(mesh, &camera, &faces(1, Shading::Lit { ambient, lights, wrap }), "wrap");
    }
    let huge = Camera { width: 100_000, ..camera };
    let error = renderer.render(&mesh, &huge, &style).unwrap_err().to_string();
    assert!(error.contains("size: 100000 x 61"), "{error}");
}

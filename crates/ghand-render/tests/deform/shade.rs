//! `shade.wgsl` against `ghand_core::light::lit`.

use ghand_core::light::lit;
use ghand_render::deform::{CoefficientLayout, DeformTemplate, Deformation, DeformationBackward, LitSurface};
use ghand_render::{RenderError, buffers};

use crate::hand::{COUNT, Flat, PLACE, gpu, norm, random, widen};

const VERTICES: usize = 50;

/// Colours in the splatter's table, `[3][N]`.
fn colors_of(table: &[f64]) -> Vec<f64> {
    (4..7).flat_map(|row| table[row * PLACE.columns + PLACE.first..][..COUNT].to_vec()).collect()
}

fn difference(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    let difference: Vec<f64> = a.iter().zip(b).map(|(a, b)| a - b).collect();
    norm(&difference[..]) / norm(b)
}

#[test]
fn lit_colours_and_their_gradients_are_those_of_the_twin() {
    let gpu = gpu();
    let corners: Vec<[u32; 3]> = (0..COUNT).map(|p| [3, 7, 11].map(|k| ((p * k + k) % VERTICES) as u32)).collect();
    let barycentric: Vec<[f32; 3]> = (random(1, 2 * COUNT, 0.5).chunks_exact(2))
        .map(|b| [b[0].abs(), b[1].abs(), 1.0 - b[0].abs() - b[1].abs()])
        .collect();
    let template = DeformTemplate {
        rest: &random(2, 3 * COUNT, 0.1),
        weights: &[1.0; 2 * COUNT],
        normals: None,
        joints: &[0.0; 6],
        parents: &[-1, 0],
        basis_count: 1,
        coefficients: CoefficientLayout::PerBasis,
        frames: 3,
        anchored: true,
        zero_sum: false,
        lit_surface: Some(LitSurface { vertex_count: VERTICES, corners: &corners, barycentric: &barycentric }),
    };
    let table = buffers::zeroed(&gpu, "gaussians", 7 * PLACE.columns);
    let d_table = random(3, 7 * PLACE.columns, 1.0);
    let d_gaussians = buffers::filled(&gpu, "d_gaussians", &d_table);
    let mut deformation = Deformation::new(&gpu, &template, &table, PLACE);
    let backward = DeformationBackward::new(&gpu, &deformation, &d_gaussians, &[1.0; 2]);
    let color = random(4, 3 * COUNT, 1.0);
    gpu.queue.write_buffer(&deformation.properties().color, 0, bytemuck::cast_slice(&color));
    let shades: Vec<[f32; 3]> = random(5, 3 * VERTICES, 2.0).chunks_exact(3).map(|s| [s[0], s[1], s[2]]).collect();
    deformation.set_shades(&gpu, 1, &shades).unwrap();

    let corner_weights: Vec<[f64; 3]> = barycentric.iter().map(|b| b.map(f64::from)).collect();
    let wide: Vec<[f64; 3]> = shades.iter().map(|s| s.map(f64::from)).collect();
    let light = |colors: &[f64]| lit(colors, &corners, &corner_weights, &wide);
    let mut run = |frame: usize| {
        deformation.set_frame(&gpu, frame);
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        deformation.encode_skeleton(&mut encoder);
        deformation.encode_skin(&mut encoder);
        backward.encode_point_gradients(&mut encoder);
        gpu.queue.submit([encoder.finish()]);
        let read = |buffer: &wgpu::Buffer, count| widen(&buffers::read::<f32>(&gpu, buffer, count).unwrap());
        (colors_of(&read(&table, 7 * PLACE.columns)), read(&backward.gradients().color, 3 * COUNT))
    };
    let (lit, d_color) = run(1);
    let (wanted, d_wanted) = (light(&widen(&color)), light(&colors_of(&widen(&d_table))));
    assert!(difference(&lit, &wanted) <= 3e-6, "{}", difference(&lit, &wanted));
    assert!(difference(&d_color, &d_wanted) <= 3e-6, "{}", difference(&d_color, &d_wanted));
    let mut wrong = wanted.flat();
    wrong[COUNT] += 0.01;
    assert!(difference(&lit, &wrong) > 3e-6);
    // A frame whose shades were not set is unlit.
    let (plain, d_plain) = run(2);
    assert!(difference(&plain, &widen(&color)) <= 3e-6 && difference(&lit, &plain) > 0.1);
    assert!(difference(&d_plain, &colors_of(&widen(&d_table))) <= 3e-6);

    for (frame, count) in [(3, VERTICES), (0, VERTICES - 1)] {
        let error = deformation.set_shades(&gpu, frame, &shades[..count]).unwrap_err();
        assert!(matches!(&error, RenderError::Invalid(text) if text.contains("shades for 50 vertices")), "{error}");
    }
}

//! `shade.wgsl` against `ghand_core::light::lit` and `lit_vjp`.

use ghand_avatar::deform::{CoefficientLayout, DeformTemplate, Deformation, DeformationBackward, LitSurface};
use ghand_core::light::{self, lit, lit_vjp};
use ghand_render::{RenderError, buffers};

use crate::deform::hand::{COUNT, PLACE, gpu, norm, random, widen};

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

/// The stage on random Gaussians, and what its twin says.
struct Case {
    glossy: bool,
    corners: Vec<[u32; 3]>,
    barycentric: Vec<[f32; 3]>,
    /// From 0 to 1, as skin is.
    color: Vec<f32>,
    shades: Vec<[f32; 3]>,
    gloss: Vec<[f32; 3]>,
    d_table: Vec<f32>,
}

/// Lit colours and the gradient of the unlit ones, `[3][N]` each.
type Results = [Vec<f64>; 2];

impl Case {
    fn new(glossy: bool) -> Case {
        let vertices = |seed, scale: f32| -> Vec<[f32; 3]> {
            random(seed, 3 * VERTICES, scale).as_chunks::<3>().0.iter().map(|rgb| rgb.map(f32::abs)).collect()
        };
        let mut gloss = vertices(6, 0.3);
        // Some Gaussians have none.
        gloss[..VERTICES / 2].fill([0.0; 3]);
        Case {
            glossy,
            corners: (0..COUNT).map(|p| [3, 7, 11].map(|k| ((p * k + k) % VERTICES) as u32)).collect(),
            barycentric: (random(1, 2 * COUNT, 0.5).chunks_exact(2))
                .map(|b| [b[0].abs(), b[1].abs(), 1.0 - b[0].abs() - b[1].abs()])
                .collect(),
            color: random(4, 3 * COUNT, 1.0).iter().map(|c| c.abs()).collect(),
            shades: vertices(5, 2.0),
            gloss,
            d_table: random(3, 7 * PLACE.columns, 1.0),
        }
    }

    fn on_device(&self, gpu: &ghand_render::Gpu) -> (Deformation, DeformationBackward, wgpu::Buffer) {
        let template = DeformTemplate {
            rest: &random(2, 3 * COUNT, 0.1),
            weights: &[1.0; 2 * COUNT],
            normals: None,
            neighbors: &(0..COUNT as u32).collect::<Vec<_>>(),
            joints: &[0.0; 6],
            parents: &[-1, 0],
            basis_count: 1,
            coefficients: CoefficientLayout::PerBasis,
            frames: 3,
            plain_skinning: false,
            anchored: true,
            zero_sum: false,
            lit_surface: Some(LitSurface {
                vertex_count: VERTICES,
                corners: &self.corners,
                barycentric: &self.barycentric,
                glossy: self.glossy,
            }),
        };
        let table = buffers::zeroed(gpu, "gaussians", 7 * PLACE.columns);
        let d_gaussians = buffers::filled(gpu, "d_gaussians", &self.d_table);
        let deformation = Deformation::new(gpu, &template, &table, PLACE);
        let backward = DeformationBackward::new(gpu, &deformation, &d_gaussians, &[1.0; 2]);
        gpu.queue.write_buffer(&deformation.properties().color, 0, bytemuck::cast_slice(&self.color));
        deformation.set_shades(gpu, 1, &self.shades).unwrap();
        (deformation, backward, table)
    }

    fn twin(&self) -> Results {
        let wide = |values: &[[f32; 3]]| -> Vec<[f64; 3]> { values.iter().map(|v| v.map(f64::from)).collect() };
        let barycentric = wide(&self.barycentric);
        let shades = wide(&self.shades);
        let gloss = wide(&self.gloss);
        let surface = light::SurfaceLight {
            corners: &self.corners,
            barycentric: &barycentric,
            shades: &shades,
            gloss: if self.glossy { &gloss } else { &[] },
        };
        let color = widen(&self.color);
        [lit(&color, &surface), lit_vjp(&color, &surface, &colors_of(&widen(&self.d_table)))]
    }
}

#[test]
fn lit_colours_and_their_gradients_are_those_of_the_twin() {
    let gpu = gpu();
    for glossy in [false, true] {
        let case = Case::new(glossy);
        let (mut deformation, backward, table) = case.on_device(&gpu);
        if glossy {
            deformation.set_gloss(&gpu, &case.gloss).unwrap();
        }
        let mut run = |frame: usize| -> Results {
            deformation.set_frame(&gpu, frame);
            let mut encoder = gpu.device.create_command_encoder(&Default::default());
            deformation.encode_skeleton(&mut encoder);
            deformation.encode_skin(&mut encoder);
            backward.encode_point_gradients(&mut encoder);
            gpu.queue.submit([encoder.finish()]);
            let read = |buffer: &wgpu::Buffer, count| widen(&buffers::read::<f32>(&gpu, buffer, count).unwrap());
            [colors_of(&read(&table, 7 * PLACE.columns)), read(&backward.gradients().color, 3 * COUNT)]
        };
        // The powers of a device's f32 are less exact than products.
        let tolerance = if glossy { 3e-5 } else { 3e-6 };
        let (found, wanted) = (run(1), case.twin());
        for (found, wanted) in found.iter().zip(&wanted) {
            assert!(difference(found, wanted) <= tolerance, "{}", difference(found, wanted));
            let mut wrong = wanted.clone();
            wrong[COUNT] += 0.01;
            assert!(difference(found, &wrong) > tolerance);
        }
        if !glossy {
            // A frame whose shades were not set is unlit.
            let [plain, d_plain] = run(2);
            assert!(difference(&plain, &widen(&case.color)) <= 3e-6 && difference(&found[0], &plain) > 0.1);
            assert!(difference(&d_plain, &colors_of(&widen(&case.d_table))) <= 3e-6);
        }
    }
    let [plain, glossy] = [false, true].map(|glossy| Case::new(glossy).twin());
    assert!(difference(&plain[0], &glossy[0]) > 0.01 && difference(&plain[1], &glossy[1]) > 0.01);
}

#[test]
fn shades_and_gloss_that_do_not_fit_the_hand_are_refused() {
    let gpu = gpu();
    let case = Case::new(true);
    let plain = Case::new(false);
    let (deformation, ..) = case.on_device(&gpu);
    for (frame, count) in [(3, VERTICES), (0, VERTICES - 1)] {
        let error = deformation.set_shades(&gpu, frame, &case.shades[..count]).unwrap_err();
        assert!(matches!(&error, RenderError::Invalid(text) if text.contains("shades for 50 vertices")), "{error}");
    }
    let error = deformation.set_gloss(&gpu, &case.gloss[1..]).unwrap_err().to_string();
    assert!(error.contains("gloss of 49 for 50 vertices"), "{error}");
    let error = plain.on_device(&gpu).0.set_gloss(&gpu, &case.gloss).unwrap_err().to_string();
    assert!(error.contains("without gloss"), "{error}");
}

//! The penalty on the curvature of the offsets over the surface.

use ghand_avatar::Template;
use ghand_render::roughness::Roughness;
use ghand_render::{Gpu, buffers};

use crate::smooth_gradients::{is_fine, spacing};

/// Weight of the mean squared Laplacian of the offsets, square metres, times the number of training images: the fewer, the
/// less they say where a Gaussian is. Without, small Gaussians scatter about those around them, which in other poses frays
/// the outline into flakes.
const WEIGHT: f64 = 8e-9;
/// The weight of fine Gaussians, whose gradients are smoothed, is as many times that.
const FINE_FACTOR: f64 = 10.0;
/// All differences, metres, count quadratically.
const WIDTH: f32 = 1e4;

/// Adds the gradient of `weight / 2 |L offsets|^2`, where L sums the differences from the neighbours: by the squared distance
/// of Gaussians it is about the Laplacian. Unlike with a penalty on the differences themselves, what is smooth over many
/// Gaussians, such as a knuckle, hardly counts.
pub(crate) struct OffsetCurvature {
    laplacian: wgpu::Buffer,
    of_offsets: Roughness,
    of_laplacian: Roughness,
    on: bool,
}

impl OffsetCurvature {
    /// For the Gaussians of `template`, trained on `images` images. `offsets` is `[3][N]`, as `gradients`; `neighbors` is
    /// [`ghand_avatar::neighbors::neighbors`]. It is off at first.
    pub(crate) fn new(
        gpu: &Gpu,
        offsets: &wgpu::Buffer,
        gradients: &wgpu::Buffer,
        template: &Template,
        neighbors: &[u32],
        images: usize,
    ) -> OffsetCurvature {
        let count = template.len();
        let laplacian = buffers::zeroed(gpu, "laplacian of the offsets", 3 * count);
        let mut of_offsets = Roughness::new(gpu, offsets, &laplacian, 3, neighbors, count);
        of_offsets.set_weight(gpu, 1.0, WIDTH);
        let mut of_laplacian = Roughness::new(gpu, &laplacian, gradients, 3, neighbors, count);
        let factor = if is_fine(template) { FINE_FACTOR } else { 1.0 };
        // Gradient of the mean.
        let weight = 2.0 * factor * WEIGHT / (count * images.max(1)) as f64 / spacing(template).powi(4);
        of_laplacian.set_weight(gpu, weight as f32, WIDTH);
        OffsetCurvature { laplacian, of_offsets, of_laplacian, on: false }
    }

    /// Whether later submissions have the penalty.
    pub(crate) fn set_on(&mut self, on: bool) {
        self.on = on;
    }

    /// Encodes the penalty, unless it is off.
    pub(crate) fn encode(&self, encoder: &mut wgpu::CommandEncoder) {
        if self.on {
            encoder.clear_buffer(&self.laplacian, 0, None);
            self.of_offsets.encode(encoder);
            self.of_laplacian.encode(encoder);
        }
    }
}

#[cfg(test)]
mod tests {
    use ghand_avatar::neighbors::neighbors;
    use ghand_core::Side;
    use ghand_hand_model::builtin::builtin_hand;
    use ghand_render::AdapterChoice;
    use ghand_render::reference::roughness::add_roughness;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    fn hand(resolution: u32) -> Template {
        Template::sample(&builtin_hand(Side::Right).unwrap(), resolution).unwrap()
    }

    fn scatter(template: &Template, metres: f64) -> Vec<f64> {
        let mut random = ChaCha8Rng::seed_from_u64(3);
        (0..3 * template.len()).map(|_| random.random_range(-metres..metres)).collect()
    }

    fn laplacian(values: &[f64], neighbors: &[u32], count: usize) -> Vec<f64> {
        let mut out = vec![0.0; values.len()];
        add_roughness(values, &mut out, neighbors, count, 1.0, WIDTH.into());
        out
    }

    /// Half the squared length of the Laplacian.
    fn penalty(values: &[f64], neighbors: &[u32], count: usize) -> f64 {
        laplacian(values, neighbors, count).iter().map(|l| l * l / 2.0).sum()
    }

    /// `before` with the gradient added.
    fn gradient(gpu: &Gpu, template: &Template, values: &[f64], before: &[f32], images: usize, on: bool) -> Vec<f32> {
        let narrow: Vec<f32> = values.iter().map(|v| *v as f32).collect();
        let [offsets, gradients] = [&narrow[..], before].map(|v| buffers::filled(gpu, "test", v));
        let mut penalty = OffsetCurvature::new(gpu, &offsets, &gradients, template, &neighbors(template), images);
        penalty.set_on(on);
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        penalty.encode(&mut encoder);
        gpu.queue.submit([encoder.finish()]);
        buffers::read::<f32>(gpu, &gradients, values.len()).unwrap()
    }

    #[test]
    fn the_gradient_is_that_of_the_squared_laplacian_by_the_number_of_images() {
        let gpu = Gpu::new(&AdapterChoice::from_env()).unwrap_or_else(|e| panic!("{e}"));
        let template = hand(32);
        let (count, neighbors) = (template.len(), neighbors(&template));
        let values = scatter(&template, 1e-3);
        // About as large as what is added.
        let before = vec![1e-5f32; values.len()];
        let gradient = |images: usize, on: bool| gradient(&gpu, &template, &values, &before, images, on);
        assert_eq!(gradient(9, false), before, "off, it adds nothing");
        let weight = 2.0 * WEIGHT / (count * 9) as f64 / spacing(&template).powi(4);
        let (got, few) = (gradient(9, true), gradient(3, true));
        let largest = got.iter().map(|g| (f64::from(*g) - 1e-5).abs()).fold(0.0, f64::max);
        for i in (0..values.len()).step_by(31) {
            let at = |step: f64| {
                let mut moved = values.clone();
                moved[i] += step;
                penalty(&moved, &neighbors, count)
            };
            let slope = weight * (at(1e-6) - at(-1e-6)) / 2e-6;
            let added = f64::from(got[i]) - 1e-5;
            assert!((added - slope).abs() < 1e-3 * largest, "{i}: {added}, {slope}");
            let added_few = f64::from(few[i]) - 1e-5;
            assert!((added_few - 3.0 * added).abs() < 1e-3 * largest, "{i}: {added_few}, {added}");
        }
    }

    #[test]
    fn it_counts_more_for_fine_gaussians() {
        let gpu = Gpu::new(&AdapterChoice::from_env()).unwrap_or_else(|e| panic!("{e}"));
        let template = hand(400);
        let (count, neighbors) = (template.len(), neighbors(&template));
        let values = scatter(&template, 1e-4);
        let got = gradient(&gpu, &template, &values, &vec![0.0; values.len()], 9, true);
        let weight = 2.0 * FINE_FACTOR * WEIGHT / (count * 9) as f64 / spacing(&template).powi(4);
        let expected = laplacian(&laplacian(&values, &neighbors, count), &neighbors, count);
        let largest = expected.iter().map(|e| e.abs()).fold(0.0, f64::max);
        for (got, expected) in got.iter().zip(&expected) {
            assert!((f64::from(*got) / weight - expected).abs() < 1e-4 * largest, "{got}, {}", weight * expected);
        }
    }

    #[test]
    fn scatter_counts_much_more_than_a_knuckle() {
        let gpu = Gpu::new(&AdapterChoice::from_env()).unwrap_or_else(|e| panic!("{e}"));
        let template = hand(32);
        let count = template.len();
        let noise = scatter(&template, 1e-3);
        let spacing = spacing(&template);
        // A bump as wide as four Gaussians, on the first one.
        let at = |p: usize| [0, 1, 2].map(|axis| f64::from(template.rest[axis * count + p]));
        let bump = |p: usize| {
            let squared: f64 = at(p).iter().zip(at(0)).map(|(a, b)| (a - b) * (a - b)).sum();
            1e-3 * (-squared / (2.0 * (4.0 * spacing).powi(2))).exp()
        };
        let knuckle: Vec<f64> = (0..3 * count).map(|i| bump(i % count)).collect();
        let per_square = |values: &[f64]| {
            let gradients = gradient(&gpu, &template, values, &vec![0.0; values.len()], 9, true);
            let penalty: f64 = values.iter().zip(&gradients).map(|(v, g)| v * f64::from(*g)).sum();
            penalty / values.iter().map(|v| v * v).sum::<f64>()
        };
        let ratio = per_square(&noise) / per_square(&knuckle);
        // Differences themselves give 63.
        assert!(ratio > 200.0, "{ratio}");
    }
}

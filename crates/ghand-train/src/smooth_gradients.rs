//! Gradients of the offsets of fine Gaussians, smoothed over the surface.

use ghand_avatar::Template;
use ghand_core::statistics::median;
use ghand_render::roughness::Roughness;
use ghand_render::{Gpu, buffers};

/// Gaussians nearer to each other than this, metres, are fine.
const FINE: f64 = 1.1e-3;
/// Standard deviation of the smoothing along the surface, metres.
const REACH: f64 = 1.1e-3;
/// No more passes than this: finer Gaussians are smoothed less far.
const MOST_PASSES: f64 = 32.0;
/// What a pass takes off a gradient, as a part of the summed differences from its six neighbours: the gradient becomes the
/// mean of all seven.
const STEP: f64 = 1.0 / 7.0;
/// All differences count alike.
const WIDTH: f32 = 1e4;

/// Median distance of Gaussians next to each other, metres.
pub(crate) fn spacing(template: &Template) -> f64 {
    median(template.spacings.iter().map(|s| f64::from(*s)))
}

/// Whether Gaussians are so near to each other that the gradients of their offsets are smoothed.
pub(crate) fn is_fine(template: &Template) -> bool {
    spacing(template) < FINE
}

/// Smooths the gradients of the offsets if Gaussians are fine. Without, the error near the outline grows with the number of
/// Gaussians.
pub(crate) struct SmoothGradients {
    gradients: wgpu::Buffer,
    before: wgpu::Buffer,
    pass: Roughness,
    passes: usize,
    on: bool,
}

impl SmoothGradients {
    /// For the Gaussians of `template`. `gradients` is `[3][N]`; `neighbors` is [`ghand_avatar::neighbors::neighbors`]. It is
    /// off at first.
    pub(crate) fn new(gpu: &Gpu, gradients: &wgpu::Buffer, template: &Template, neighbors: &[u32]) -> SmoothGradients {
        let count = template.len();
        let before = buffers::zeroed(gpu, "gradients of the offsets", 3 * count);
        let mut pass = Roughness::new(gpu, &before, gradients, 3, neighbors, count);
        pass.set_weight(gpu, -STEP as f32, WIDTH);
        SmoothGradients { gradients: gradients.clone(), before, pass, passes: passes(template), on: false }
    }

    /// Whether later submissions smooth.
    pub(crate) fn set_on(&mut self, on: bool) {
        self.on = on;
    }

    /// Encodes the smoothing, unless it is off.
    pub(crate) fn encode(&self, encoder: &mut wgpu::CommandEncoder) {
        if self.on {
            for _ in 0..self.passes {
                encoder.copy_buffer_to_buffer(&self.gradients, 0, &self.before, 0, self.before.size());
                self.pass.encode(encoder);
            }
        }
    }
}

/// Passes for the whole reach: with six neighbours at a distance d, each adds 3 STEP d^2 to the variance along each axis.
fn passes(template: &Template) -> usize {
    let variance = 3.0 * STEP * spacing(template).powi(2);
    if is_fine(template) { (REACH * REACH / variance).round().min(MOST_PASSES) as usize } else { 0 }
}

#[cfg(test)]
mod tests {
    use ghand_avatar::neighbors::neighbors;
    use ghand_core::Side;
    use ghand_hand_model::builtin::builtin_hand;
    use ghand_render::AdapterChoice;

    use super::*;

    fn hand(resolution: u32) -> Template {
        Template::sample(&builtin_hand(Side::Right).unwrap(), resolution).unwrap()
    }

    fn smoothed(gpu: &Gpu, template: &Template, values: &[f32], on: bool) -> Vec<f32> {
        let gradients = buffers::filled(gpu, "test", values);
        let mut smooth = SmoothGradients::new(gpu, &gradients, template, &neighbors(template));
        smooth.set_on(on);
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        smooth.encode(&mut encoder);
        gpu.queue.submit([encoder.finish()]);
        buffers::read::<f32>(gpu, &gradients, values.len()).unwrap()
    }

    #[test]
    fn fine_gaussians_alone_share_their_gradients() {
        let gpu = Gpu::new(&AdapterChoice::from_env()).unwrap_or_else(|e| panic!("{e}"));
        let (coarse, fine) = (hand(96), hand(400));
        assert!(!is_fine(&coarse) && is_fine(&fine), "{}, {}", spacing(&coarse), spacing(&fine));
        let values: Vec<f32> = (0..3 * coarse.len()).map(|i| (i % 7) as f32).collect();
        assert_eq!(smoothed(&gpu, &coarse, &values, true), values);
        let values: Vec<f32> = (0..3 * fine.len()).map(|i| (i % 7) as f32).collect();
        assert_eq!(smoothed(&gpu, &fine, &values, false), values);
        assert_ne!(smoothed(&gpu, &fine, &values, true), values);
    }

    #[test]
    fn one_gradient_is_spread_as_far_whatever_the_distance_of_gaussians() {
        let gpu = Gpu::new(&AdapterChoice::from_env()).unwrap_or_else(|e| panic!("{e}"));
        for resolution in [448, 640] {
            let template = hand(resolution);
            let count = template.len();
            let at = |p: usize| [0, 1, 2].map(|axis| f64::from(template.rest[axis * count + p]));
            let squared = |p: usize, q: usize| at(p).iter().zip(at(q)).map(|(a, b)| (a - b) * (a - b)).sum::<f64>();
            // Single gradients, far from each other and from where the surface ends.
            let wrist = (0..count).map(|p| at(p)[2]).fold(f64::INFINITY, f64::min);
            let middle: Vec<usize> = (0..count).filter(|p| at(*p)[2] > wrist + 0.02).step_by(count / 6).collect();
            let mut reach = Vec::new();
            for p in middle {
                let mut values = vec![0.0; 3 * count];
                values[p] = 1.0;
                let got = smoothed(&gpu, &template, &values, true);
                let sum: f64 = got[..count].iter().map(|g| f64::from(*g)).sum();
                assert!((sum - 1.0).abs() < 0.3, "{resolution}: {p}: {sum}");
                assert!(got[count..].iter().all(|g| *g == 0.0), "other axes");
                let variance: f64 = (0..count).map(|q| f64::from(got[q]) * squared(p, q)).sum::<f64>() / sum / 2.0;
                reach.push(variance.sqrt());
            }
            let reach = median(reach);
            assert!((reach - REACH).abs() < 0.3 * REACH, "{resolution}: {reach}");
        }
    }
}

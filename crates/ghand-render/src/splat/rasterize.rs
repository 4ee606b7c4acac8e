//! Host part of `rasterize.wgsl` and `rasterize_backward.wgsl`.

use super::SplatOptions;
use super::frame_buffers::FrameBuffers;
use crate::pipeline::{Bound, Module, Stage};
use crate::stages::{Rasterize, RasterizeBackward, RasterizeBackwardBindings, RasterizeBindings};
use crate::{Gpu, Tier};

/// Invocations per tile forward, each for 2x2 pixels, as in the stages' shaders.
const INVOCATIONS_PER_TILE: u32 = 16;
/// Invocations per tile backward: `CELLS` of `rasterize_backward.wgsl`, `LANES` of the one with subgroups.
pub(super) fn backward_invocations(tier: Tier) -> u32 {
    tier.choose(4, 8)
}

/// Maximum number of entries of a tile in the backward pass on Mesa's software rasteriser, which ends shader loops
/// after 65,535 iterations of one or eight entries each.
fn software_entries(tier: Tier) -> u32 {
    tier.choose(1, 8) * 65_535
}

pub struct Pipelines {
    rasterize: Stage<Rasterize>,
    rasterize_backward: Option<Stage<RasterizeBackward>>,
}

impl Pipelines {
    pub fn new(gpu: &Gpu, options: &SplatOptions) -> Pipelines {
        let SplatOptions { model, purpose, depth, largest_weights, thresholds } = options;
        let forward = Module::new(gpu, gpu.tier.choose("rasterize", "subgroups/rasterize"));
        let limited = gpu.is_cpu() && purpose.has_gradients();
        let entries = if limited { software_entries(gpu.tier) } else { u32::MAX };
        let constants = [
            ("DEPTH", f64::from(u8::from(*depth))),
            ("LARGEST_WEIGHTS", f64::from(u8::from(*largest_weights))),
            ("BACKWARD_ENTRIES", f64::from(entries)),
            thresholds.alpha_min(),
        ];
        Pipelines {
            rasterize: forward.stage(gpu, &constants),
            rasterize_backward: purpose.has_gradients().then(|| {
                let module = Module::new(gpu, gpu.tier.choose("rasterize_backward", "subgroups/rasterize_backward"));
                let constants = [("SLOT_OPACITY", f64::from(u8::from(model.slot_opacity()))), thresholds.alpha_min()];
                module.stage(gpu, &constants)
            }),
        }
    }
}

pub struct Stages {
    rasterize: Bound,
    rasterize_backward: Option<Bound>,
    slot_marks: wgpu::Buffer,
    backward_invocations: u32,
}

impl Stages {
    pub fn new(gpu: &Gpu, pipelines: &Pipelines, b: &FrameBuffers, entries: &wgpu::Buffer) -> Stages {
        let s = &b.shared;
        Stages {
            rasterize: pipelines.rasterize.bind(
                gpu,
                &RasterizeBindings {
                    view: &s.view,
                    splats: &b.splats,
                    entries,
                    tile_ranges: &b.tile_ranges,
                    image: &s.image,
                    pixel_states: &b.pixel_states,
                    depths: &s.depths,
                    counters: &s.counters,
                    largest_weights: &s.largest_weights,
                },
            ),
            rasterize_backward: pipelines.rasterize_backward.as_ref().map(|stage| {
                stage.bind(
                    gpu,
                    &RasterizeBackwardBindings {
                        view: &s.view,
                        splats: &b.splats,
                        entries,
                        tile_ranges: &b.tile_ranges,
                        pixel_states: &b.pixel_states,
                        d_image: &s.d_image,
                        slot_gradients: &b.slot_gradients,
                        slot_marks: &b.slot_marks,
                    },
                )
            }),
            slot_marks: b.slot_marks.clone(),
            backward_invocations: backward_invocations(gpu.tier),
        }
    }

    /// Encodes clearing the marks: slots that the backward pass does not mark have no gradient.
    pub fn clear(&self, encoder: &mut wgpu::CommandEncoder) {
        encoder.clear_buffer(&self.slot_marks, 0, None);
    }

    pub fn forward(&self, pass: &mut wgpu::ComputePass<'_>, tiles: [u32; 2]) {
        self.rasterize.dispatch_invocations(pass, INVOCATIONS_PER_TILE * tiles[0] * tiles[1]);
    }

    pub fn backward(&self, pass: &mut wgpu::ComputePass<'_>, tiles: [u32; 2]) {
        if let Some(stage) = &self.rasterize_backward {
            stage.dispatch_invocations(pass, self.backward_invocations * tiles[0] * tiles[1]);
        }
    }
}

//! Host part of `rasterize.wgsl` and `rasterize_backward.wgsl`.

use super::frame::FrameBuffers;
use super::{Purpose, SplatModel, sort};
use crate::pipeline::{Bound, Module, Stage};
use crate::{Gpu, Tier};

/// Number of places for the gradients of an intersection: one per cell of 4x4 pixels, or a single one if invocations
/// sum their gradients.
pub fn places(tier: Tier) -> u32 {
    match tier {
        Tier::Baseline => 4,
        Tier::Fast => 1,
    }
}

/// Number of tiles per workgroup, forward and backward, as in the shaders.
fn tiles_a_group(tier: Tier) -> [u32; 2] {
    match tier {
        Tier::Baseline => [1, 8],
        Tier::Fast => [2, 4],
    }
}

/// Maximum number of entries of a tile in the backward pass on Mesa's software rasteriser, which ends shader loops
/// after 65,535 iterations of one or eight entries each.
fn software_entries(tier: Tier) -> u32 {
    match tier {
        Tier::Baseline => 65_535,
        Tier::Fast => 8 * 65_535,
    }
}

pub struct Pipelines {
    rasterize: Stage,
    rasterize_backward: Option<Stage>,
}

impl Pipelines {
    pub fn new(gpu: &Gpu, model: &SplatModel, purpose: Purpose, depth: bool) -> Pipelines {
        let forward = Module::new(gpu, gpu.tier.choose("rasterize", "fast/rasterize"));
        let limited = gpu.is_cpu() && purpose.has_gradients();
        let entries = if limited { software_entries(gpu.tier) } else { u32::MAX };
        let constants = [("DEPTH", f64::from(u8::from(depth))), ("BACKWARD_ENTRIES", f64::from(entries))];
        Pipelines {
            rasterize: forward.stage(gpu, "rasterize", &constants),
            rasterize_backward: purpose.has_gradients().then(|| {
                let module = Module::new(gpu, gpu.tier.choose("rasterize_backward", "fast/rasterize_backward"));
                let constants = [("SLOT_OPACITY", f64::from(u8::from(model.slot_opacity())))];
                module.stage(gpu, "rasterize_backward", &constants)
            }),
        }
    }
}

pub struct Stages {
    rasterize: Bound,
    rasterize_backward: Option<Bound>,
    slot_marks: wgpu::Buffer,
    tiles_a_group: [u32; 2],
}

impl Stages {
    pub fn new(gpu: &Gpu, pipelines: &Pipelines, b: &FrameBuffers, tile_sort: &sort::Stages) -> Stages {
        let s = &b.shared;
        let entries = &b.slots[tile_sort.sorted()];
        Stages {
            rasterize: pipelines.rasterize.bind(
                gpu,
                &[
                    ("view", &s.view),
                    ("splats", &b.splats),
                    ("entries", entries),
                    ("slot_gaussians", &b.slot_gaussians),
                    ("tile_ranges", &b.tile_ranges),
                    ("image", &s.image),
                    ("pixel_states", &b.pixel_states),
                    ("depths", &s.depths),
                    ("counters", &s.counters),
                ],
            ),
            rasterize_backward: pipelines.rasterize_backward.as_ref().map(|stage| {
                stage.bind(
                    gpu,
                    &[
                        ("view", &s.view),
                        ("splats", &b.splats),
                        ("entries", entries),
                        ("slot_gaussians", &b.slot_gaussians),
                        ("tile_ranges", &b.tile_ranges),
                        ("pixel_states", &b.pixel_states),
                        ("d_image", &s.d_image),
                        ("slot_gradients", &b.slot_gradients),
                        ("slot_marks", &b.slot_marks),
                    ],
                )
            }),
            slot_marks: b.slot_marks.clone(),
            tiles_a_group: tiles_a_group(gpu.tier),
        }
    }

    /// Encodes clearing the marks: slots that the backward pass does not mark have no gradient.
    pub fn clear(&self, encoder: &mut wgpu::CommandEncoder) {
        encoder.clear_buffer(&self.slot_marks, 0, None);
    }

    pub fn forward(&self, pass: &mut wgpu::ComputePass<'_>, tiles: [u32; 2]) {
        self.rasterize.dispatch(pass, (tiles[0] * tiles[1]).div_ceil(self.tiles_a_group[0]));
    }

    pub fn backward(&self, pass: &mut wgpu::ComputePass<'_>, tiles: [u32; 2]) {
        if let Some(stage) = &self.rasterize_backward {
            stage.dispatch(pass, (tiles[0] * tiles[1]).div_ceil(self.tiles_a_group[1]));
        }
    }
}

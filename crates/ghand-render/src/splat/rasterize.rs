//! Host part of `rasterize.wgsl` and `rasterize_backward.wgsl`.

use super::frame::FrameBuffers;
use super::{Purpose, SplatModel};
use crate::pipeline::{Bound, Module, Stage};
use crate::{Gpu, shader_sources};

/// 4x4 cells of a tile, as in `rasterize_backward.wgsl`: each has gradients of its own for an intersection.
pub const CELLS: usize = 4;

/// Mesa's software rasteriser ends the loops of a shader after so many rounds; the backward pass takes one for an entry.
const SOFTWARE_ROUNDS: u32 = 65_535;

pub struct Pipelines {
    rasterize: Stage,
    rasterize_backward: Option<Stage>,
}

impl Pipelines {
    pub fn new(gpu: &Gpu, model: &SplatModel, purpose: Purpose, depth: bool) -> Pipelines {
        let forward = Module::new(gpu, "rasterize", &shader_sources::rasterize());
        let limited = gpu.is_cpu() && purpose.has_gradients();
        let entries = if limited { SOFTWARE_ROUNDS } else { u32::MAX };
        let constants = [("DEPTH", f64::from(u8::from(depth))), ("BACKWARD_ENTRIES", f64::from(entries))];
        Pipelines {
            rasterize: forward.stage(gpu, "rasterize", &constants),
            rasterize_backward: purpose.has_gradients().then(|| {
                let module = Module::new(gpu, "rasterize_backward", &shader_sources::rasterize_backward());
                module.stage(gpu, "rasterize_backward", &[("SLOT_VECTORS", model.slot_vectors() as f64)])
            }),
        }
    }
}

pub struct Stages {
    rasterize: Bound,
    rasterize_backward: Option<Bound>,
    slot_gradients: wgpu::Buffer,
}

impl Stages {
    pub fn new(gpu: &Gpu, pipelines: &Pipelines, b: &FrameBuffers) -> Stages {
        let s = &b.shared;
        Stages {
            rasterize: pipelines.rasterize.bind(
                gpu,
                &[
                    (0, &s.view),
                    (1, &b.splats),
                    (2, &b.entries),
                    (3, &b.tile_ranges),
                    (4, &s.image),
                    (5, &b.transmittances),
                    (6, &b.ends),
                    (7, &s.depths),
                    (8, &s.counters),
                ],
            ),
            rasterize_backward: pipelines.rasterize_backward.as_ref().map(|stage| {
                stage.bind(
                    gpu,
                    &[
                        (0, &s.view),
                        (1, &b.splats),
                        (2, &b.entries),
                        (3, &b.tile_ranges),
                        (4, &b.transmittances),
                        (5, &b.ends),
                        (6, &s.d_image),
                        (7, &b.slot_gradients),
                    ],
                )
            }),
            slot_gradients: b.slot_gradients.clone(),
        }
    }

    /// What the backward pass does not touch has no gradient.
    pub fn clear(&self, encoder: &mut wgpu::CommandEncoder) {
        encoder.clear_buffer(&self.slot_gradients, 0, None);
    }

    /// A workgroup a tile.
    pub fn forward(&self, pass: &mut wgpu::ComputePass<'_>, tiles: [u32; 2]) {
        self.rasterize.dispatch(pass, tiles[0] * tiles[1]);
    }

    /// Eight tiles of four cells to a workgroup.
    pub fn backward(&self, pass: &mut wgpu::ComputePass<'_>, tiles: [u32; 2]) {
        if let Some(stage) = &self.rasterize_backward {
            stage.dispatch(pass, (tiles[0] * tiles[1]).div_ceil(8));
        }
    }
}

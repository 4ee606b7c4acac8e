//! Host part of `rasterize.wgsl` and `rasterize_backward.wgsl`.

use super::frame::FrameBuffers;
use crate::pipeline::{Bound, Module, Stage};
use crate::{Gpu, shader_sources};

/// Bytes of gradient kept for one intersection: four cells, two vectors each.
pub const GRADIENT_BYTES_PER_SLOT: u64 = 4 * 2 * 16;

pub struct Pipelines {
    rasterize: Stage,
    rasterize_backward: Stage,
}

impl Pipelines {
    pub fn new(gpu: &Gpu) -> Pipelines {
        let (forward, backward) = (shader_sources::rasterize(), shader_sources::rasterize_backward());
        Pipelines {
            rasterize: Module::new(gpu, "rasterize", &forward).stage(gpu, "rasterize", &[]),
            rasterize_backward: Module::new(gpu, "rasterize_backward", &backward).stage(gpu, "rasterize_backward", &[]),
        }
    }
}

pub struct Stages {
    rasterize: Bound,
    rasterize_backward: Bound,
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
                ],
            ),
            rasterize_backward: pipelines.rasterize_backward.bind(
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
            ),
            slot_gradients: b.slot_gradients.clone(),
        }
    }

    /// A workgroup a tile.
    pub fn forward(&self, pass: &mut wgpu::ComputePass<'_>, tiles: [u32; 2]) {
        self.rasterize.dispatch(pass, tiles[0] * tiles[1]);
    }

    /// What the backward pass does not touch has no gradient.
    pub fn clear(&self, encoder: &mut wgpu::CommandEncoder) {
        encoder.clear_buffer(&self.slot_gradients, 0, None);
    }

    /// Eight tiles of four cells to a workgroup.
    pub fn backward(&self, pass: &mut wgpu::ComputePass<'_>, tiles: [u32; 2]) {
        self.rasterize_backward.dispatch(pass, (tiles[0] * tiles[1]).div_ceil(8));
    }
}

//! The stages of a frame, bound to its buffers.

use super::frame_buffers::FrameBuffers;
use super::{Counters, SplatOptions, bin, project, rasterize, sort};
use crate::Gpu;

/// Most bits of a depth key, as in `project.wgsl`.
pub const DEPTH_BITS: u32 = 30;

/// The compiled stages, which are kept when the buffers grow.
pub struct Pipelines {
    pub project: project::Pipelines,
    pub sort: sort::Pipelines,
    pub bin: bin::Pipelines,
    pub rasterize: rasterize::Pipelines,
}

impl Pipelines {
    pub fn new(gpu: &Gpu, options: &SplatOptions) -> Pipelines {
        let SplatOptions { model, purpose, depth, cut_offs } = options;
        Pipelines {
            project: project::Pipelines::new(gpu, model, *purpose, cut_offs),
            sort: sort::Pipelines::new(gpu),
            bin: bin::Pipelines::new(gpu),
            rasterize: rasterize::Pipelines::new(gpu, model, *purpose, *depth, cut_offs),
        }
    }
}

/// The stages of a frame, bound.
pub struct Frame {
    pub project: project::Stages,
    pub depth_sort: sort::Stages,
    pub bin: bin::Stages,
    pub tile_sort: sort::Stages,
    pub rasterize: rasterize::Stages,
}

impl Frame {
    pub fn new(gpu: &Gpu, pipelines: &Pipelines, b: &FrameBuffers, depth_bits: u32) -> Frame {
        let counters = &b.shared.counters;
        let depth_sort = sort::Stages::new(
            gpu,
            &pipelines.sort,
            counters,
            Counters::GAUSSIANS,
            depth_bits,
            &b.depth_keys,
            &b.depth_order,
        );
        let tile_sort = sort::Stages::new(
            gpu,
            &pipelines.sort,
            counters,
            Counters::INTERSECTIONS,
            b.tile_bits,
            &b.tile_keys,
            &b.slots,
        );
        Frame {
            project: project::Stages::new(gpu, &pipelines.project, b),
            bin: bin::Stages::new(gpu, &pipelines.bin, &pipelines.sort, b, &depth_sort, &tile_sort),
            rasterize: rasterize::Stages::new(gpu, &pipelines.rasterize, b, &tile_sort),
            depth_sort,
            tile_sort,
        }
    }
}

//! The stages of a frame, bound to its buffers.

use super::frame_buffers::FrameBuffers;
use super::sort::Order;
use super::{Counters, SplatOptions, bin, project, rasterize, slots, sort};
use crate::Gpu;

/// Most bits of a depth key, as in `project.wgsl`.
pub const DEPTH_BITS: u32 = 30;

/// The compiled stages, which are kept when the buffers grow.
pub struct Pipelines {
    pub project: project::Pipelines,
    pub sort: sort::Pipelines,
    pub bin: bin::Pipelines,
    pub rasterize: rasterize::Pipelines,
    /// If there are gradients.
    pub slots: Option<slots::Pipelines>,
}

impl Pipelines {
    pub fn new(gpu: &Gpu, options: &SplatOptions) -> Pipelines {
        let SplatOptions { model, purpose, thresholds, .. } = options;
        Pipelines {
            project: project::Pipelines::new(gpu, model, *purpose, thresholds),
            sort: sort::Pipelines::new(gpu),
            bin: bin::Pipelines::new(gpu),
            rasterize: rasterize::Pipelines::new(gpu, options),
            slots: purpose.has_gradients().then(|| slots::Pipelines::new(gpu)),
        }
    }
}

/// The stages of a frame, bound.
pub struct Frame {
    pub project: project::Stages,
    pub depth_sort: sort::Stages,
    pub bin: bin::Stages,
    pub rasterize: rasterize::Stages,
    pub slots: Option<slots::Stages>,
}

impl Frame {
    pub fn new(gpu: &Gpu, pipelines: &Pipelines, b: &FrameBuffers, depth_bits: u32) -> Frame {
        let counters = &b.shared.counters;
        let order = Order { counter: Counters::GAUSSIANS, bits: depth_bits, numbered: true };
        let depth_sort = sort::Stages::new(gpu, &pipelines.sort, counters, order, &b.depth_keys, &b.depth_order);
        let bin = bin::Stages::new(gpu, &pipelines.bin, &pipelines.sort, b, &b.depth_order[depth_sort.sorted()]);
        Frame {
            project: project::Stages::new(gpu, &pipelines.project, b),
            rasterize: rasterize::Stages::new(gpu, &pipelines.rasterize, b, bin.entries()),
            slots: pipelines.slots.as_ref().map(|p| slots::Stages::new(gpu, p, &pipelines.sort, b)),
            depth_sort,
            bin,
        }
    }
}

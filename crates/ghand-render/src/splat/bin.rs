//! Host part of `bin.wgsl`: lists the Gaussians of each tile, in order.

use super::frame_buffers::FrameBuffers;
use super::{Counters, sort};
use crate::Gpu;
use crate::pipeline::{Bound, Module, Stage};

/// Maximum number of tiles per Gaussian on Mesa's software rasteriser, which ends shader loops after 65,535 iterations;
/// rows of tiles are iterations, too.
const SOFTWARE_TILES: u32 = 60_000;

pub struct Pipelines {
    count_tiles: Stage,
    limit_intersections: Stage,
    emit_intersections: Stage,
    find_tile_ranges: Stage,
}

impl Pipelines {
    pub fn new(gpu: &Gpu) -> Pipelines {
        let most_tiles = if gpu.is_cpu() { SOFTWARE_TILES } else { u32::MAX };
        let bin = Module::new(gpu, "bin");
        Pipelines {
            count_tiles: bin.stage(gpu, "count_tiles", &[("MOST_TILES", f64::from(most_tiles))]),
            limit_intersections: bin.stage(gpu, "limit_intersections", &[]),
            emit_intersections: bin.stage(gpu, "emit_intersections", &[]),
            find_tile_ranges: bin.stage(gpu, "find_tile_ranges", &[]),
        }
    }
}

pub struct Stages {
    count_tiles: Bound,
    scan: sort::Scan,
    limit_intersections: Bound,
    emit_intersections: Bound,
    find_tile_ranges: Bound,
    count: u32,
}

impl Stages {
    pub fn new(
        gpu: &Gpu,
        pipelines: &Pipelines,
        sort: &sort::Pipelines,
        b: &FrameBuffers,
        depth_sort: &sort::Stages,
        tile_sort: &sort::Stages,
    ) -> Stages {
        let (view, counters) = (&b.shared.view, &b.shared.counters);
        let depth_order = &b.depth_order[depth_sort.sorted()];
        let sorted = tile_sort.sorted();
        Stages {
            count_tiles: pipelines.count_tiles.bind(
                gpu,
                &[
                    ("view", view),
                    ("tile_rects", &b.tile_rects),
                    ("depth_order", depth_order),
                    ("slot_offsets", &b.slot_offsets),
                    ("counters", counters),
                ],
            ),
            scan: sort.scan(gpu, &b.slot_offsets, b.count as u32, counters, Counters::INTERSECTIONS_WANTED),
            limit_intersections: pipelines.limit_intersections.bind(gpu, &[("view", view), ("counters", counters)]),
            emit_intersections: pipelines.emit_intersections.bind(
                gpu,
                &[
                    ("view", view),
                    ("tile_rects", &b.tile_rects),
                    ("depth_order", depth_order),
                    ("slot_offsets", &b.slot_offsets),
                    ("slot_ranges", &b.slot_ranges),
                    ("tile_keys", &b.tile_keys[0]),
                    ("slot_gaussians", &b.slot_gaussians),
                ],
            ),
            find_tile_ranges: pipelines.find_tile_ranges.bind(
                gpu,
                &[
                    ("view", view),
                    ("counters", counters),
                    ("tile_keys", &b.tile_keys[sorted]),
                    ("tile_ranges", &b.tile_ranges),
                ],
            ),
            count: b.count as u32,
        }
    }

    /// Encodes the emission of unsorted intersections, after the depth sort.
    pub fn emit(&self, pass: &mut wgpu::ComputePass<'_>) {
        self.count_tiles.dispatch_invocations(pass, self.count);
        self.scan.encode(pass);
        self.limit_intersections.dispatch(pass, 1);
        self.emit_intersections.dispatch_invocations(pass, self.count);
    }

    /// Encodes the search for the range of each tile, after the tile sort.
    pub fn find_ranges(&self, pass: &mut wgpu::ComputePass<'_>, tiles: [u32; 2]) {
        self.find_tile_ranges.dispatch_invocations(pass, tiles[0] * tiles[1]);
    }
}

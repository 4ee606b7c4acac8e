//! Host part of `bin.wgsl` and `bin_by_strands.wgsl`: lists the Gaussians of each tile, in order.

use bytemuck::{Pod, Zeroable};

use super::frame_buffers::FrameBuffers;
use super::sort::{Order, Scan};
use super::{Counters, Shared, sort};
use crate::pipeline::{Bound, Module, Stage};
use crate::stages::{
    CountByTile, CountByTileBindings, CountTiles, CountTilesBindings, EmitIntersections, EmitIntersectionsBindings,
    FindTileRanges, FindTileRangesBindings, LimitIntersections, LimitIntersectionsBindings, PlaceByTile,
    PlaceByTileBindings, ReadTileRanges, ReadTileRangesBindings,
};
use crate::{Gpu, buffers};

/// Maximum number of tiles per Gaussian on Mesa's software rasteriser, which ends shader loops after 65,535 iterations;
/// rows of tiles are iterations, too.
const SOFTWARE_TILES: u32 = 60_000;
/// Maximum number of counters of the strands: half of what the iterations of a prefix sum allow there.
const MOST_COUNTERS: u64 = 1 << 25;

/// See `shaders/bin_by_strands.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct StrandUniforms {
    /// Number of strands into which the intersections are divided.
    pub strands: u32,
    /// Unused.
    pub padding_1: u32,
    /// Unused.
    pub padding_2: u32,
    /// Unused.
    pub padding_3: u32,
}

pub struct Pipelines {
    count_tiles: Stage<CountTiles>,
    limit_intersections: Stage<LimitIntersections>,
    emit_intersections: Stage<EmitIntersections>,
    find_tile_ranges: Stage<FindTileRanges>,
    by_strands: Option<StrandPipelines>,
}

struct StrandPipelines {
    count_by_tile: Stage<CountByTile>,
    place_by_tile: Stage<PlaceByTile>,
    read_tile_ranges: Stage<ReadTileRanges>,
}

impl Pipelines {
    pub fn new(gpu: &Gpu) -> Pipelines {
        Pipelines::of_kind(gpu, gpu.tier.has_strands())
    }

    /// Pipelines that count by strands where that needs few enough counters, or always sort. A software rasteriser has
    /// few cores, so that few strands keep it busy.
    pub(super) fn of_kind(gpu: &Gpu, by_strands: bool) -> Pipelines {
        let most_tiles = if gpu.is_cpu() { SOFTWARE_TILES } else { u32::MAX };
        let bin = Module::new(gpu, "bin");
        Pipelines {
            count_tiles: bin.stage(gpu, &[("MOST_TILES", f64::from(most_tiles))]),
            limit_intersections: bin.stage(gpu, &[]),
            emit_intersections: bin.stage(gpu, &[]),
            find_tile_ranges: bin.stage(gpu, &[]),
            by_strands: by_strands.then(|| {
                let module = Module::new(gpu, "bin_by_strands");
                StrandPipelines {
                    count_by_tile: module.stage(gpu, &[]),
                    place_by_tile: module.stage(gpu, &[]),
                    read_tile_ranges: module.stage(gpu, &[]),
                }
            }),
        }
    }
}

/// How the lists are made from the intersections.
enum Lists {
    /// Every intersection is written with its tile, and they are sorted by tile.
    BySort { emit: Bound, sort: sort::Stages, find_ranges: Bound },
    /// The intersections of each tile are counted, and every Gaussian is written to its places.
    ByStrands { counts: wgpu::Buffer, strands: u32, count: Bound, scan: Scan, place: Bound, read_ranges: Bound },
}

pub struct Stages {
    count_tiles: Bound,
    scan: Scan,
    limit_intersections: Bound,
    lists: Lists,
    entries: wgpu::Buffer,
    count: u32,
}

impl Stages {
    pub fn new(
        gpu: &Gpu,
        pipelines: &Pipelines,
        sort: &sort::Pipelines,
        b: &FrameBuffers,
        depth_order: &wgpu::Buffer,
    ) -> Stages {
        let FrameBuffers { shared: Shared { view, counters, .. }, tile_rects, tile_ranges, .. } = b;
        let first_intersections = &buffers::zeroed(gpu, "first intersections", b.count);
        let strands = sort.pieces(u64::from(b.capacity));
        let counter_count = u64::from(strands) * u64::from(b.tiles);
        let by_strands = pipelines.by_strands.as_ref().filter(|_| counter_count <= MOST_COUNTERS);
        let (lists, entries) = match by_strands {
            Some(p) => {
                let uniforms = StrandUniforms { strands, ..StrandUniforms::zeroed() };
                let uniforms = &buffers::uniform(gpu, "strands", &uniforms);
                let tile_counts = &buffers::zeroed(gpu, "tile counts", counter_count as usize);
                let total = buffers::zeroed(gpu, "tile count total", 1);
                let entries = buffers::zeroed(gpu, "entries", b.capacity as usize);
                let lists = Lists::ByStrands {
                    strands: p.count_by_tile.groups(strands),
                    count: p.count_by_tile.bind(
                        gpu,
                        &CountByTileBindings {
                            view,
                            uniforms,
                            tile_rects,
                            depth_order,
                            first_intersections,
                            counters,
                            tile_counts,
                        },
                    ),
                    scan: sort.scan(gpu, tile_counts, counter_count as u32, &total, sort::FIRST_WORD),
                    place: p.place_by_tile.bind(
                        gpu,
                        &PlaceByTileBindings {
                            view,
                            uniforms,
                            tile_rects,
                            depth_order,
                            first_intersections,
                            counters,
                            tile_counts,
                            entries: &entries,
                        },
                    ),
                    read_ranges: p
                        .read_tile_ranges
                        .bind(gpu, &ReadTileRangesBindings { view, uniforms, tile_counts, tile_ranges }),
                    counts: tile_counts.clone(),
                };
                (lists, entries)
            }
            None => {
                let pair = |label: &str| [0, 1].map(|_| buffers::zeroed(gpu, label, b.capacity as usize));
                let keys = pair("tile keys");
                let entries = pair("entries");
                // The number of bits of the largest tile index, at least one.
                let bits = (u32::BITS - (b.tiles - 1).leading_zeros()).max(1);
                let order = Order { counter: Counters::INTERSECTIONS, bits, numbered: false };
                let sort = sort::Stages::new(gpu, sort, counters, order, &keys, &entries);
                let sorted = sort.sorted();
                let lists = Lists::BySort {
                    emit: pipelines.emit_intersections.bind(
                        gpu,
                        &EmitIntersectionsBindings {
                            view,
                            tile_rects,
                            depth_order,
                            first_intersections,
                            tile_keys: &keys[0],
                            entries: &entries[0],
                        },
                    ),
                    find_ranges: pipelines
                        .find_tile_ranges
                        .bind(gpu, &FindTileRangesBindings { view, counters, tile_keys: &keys[sorted], tile_ranges }),
                    sort,
                };
                (lists, entries[sorted].clone())
            }
        };
        Stages {
            count_tiles: pipelines
                .count_tiles
                .bind(gpu, &CountTilesBindings { view, tile_rects, depth_order, first_intersections, counters }),
            scan: sort.scan(gpu, first_intersections, b.count as u32, counters, Counters::INTERSECTIONS_WANTED),
            limit_intersections: pipelines
                .limit_intersections
                .bind(gpu, &LimitIntersectionsBindings { view, counters }),
            lists,
            entries,
            count: b.count as u32,
        }
    }

    /// The Gaussians of the tiles, tile after tile, each tile's front to back.
    pub fn entries(&self) -> &wgpu::Buffer {
        &self.entries
    }

    /// Encodes clearing the counters, before the frame.
    pub fn clear(&self, encoder: &mut wgpu::CommandEncoder) {
        if let Lists::ByStrands { counts, .. } = &self.lists {
            encoder.clear_buffer(counts, 0, None);
        }
    }

    /// Encodes counting the intersections, and writing them if they are sorted, after the depth sort.
    pub fn count(&self, pass: &mut wgpu::ComputePass<'_>) {
        self.count_tiles.dispatch_invocations(pass, self.count);
        self.scan.encode(pass);
        self.limit_intersections.dispatch(pass, 1);
        if let Lists::BySort { emit, .. } = &self.lists {
            emit.dispatch_invocations(pass, self.count);
        }
    }

    /// Encodes ordering the intersections by tile.
    pub fn order(&self, pass: &mut wgpu::ComputePass<'_>) {
        match &self.lists {
            Lists::BySort { sort, .. } => sort.encode(pass),
            Lists::ByStrands { strands, count, scan, place, .. } => {
                count.dispatch(pass, *strands);
                scan.encode(pass);
                place.dispatch(pass, *strands);
            }
        }
    }

    /// Encodes the search for the range of each tile among the entries.
    pub fn find_ranges(&self, pass: &mut wgpu::ComputePass<'_>, tiles: [u32; 2]) {
        let (Lists::BySort { find_ranges, .. } | Lists::ByStrands { read_ranges: find_ranges, .. }) = &self.lists;
        find_ranges.dispatch_invocations(pass, tiles[0] * tiles[1]);
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

    use rand::{RngExt, SeedableRng};

    use super::super::{Counters, SplatModel, SplatOptions, Splatter, View};
    use super::*;
    use crate::AdapterChoice;

    const SIZE: [u32; 2] = [203, 150];

    /// The image, its gradient and the counters with one kind of lists.
    fn frame(gpu: &Gpu, by_strands: bool, table: &[f32], d_image: &[f32]) -> (Vec<u32>, Vec<u32>, Counters) {
        let count = table.len() / SplatModel::HAND.rows();
        let mut splatter = Splatter::new(gpu, SplatOptions::default(), count, SIZE).unwrap();
        splatter.pipelines.bin = Pipelines::of_kind(gpu, by_strands);
        // A capacity that is too small, so that an incomplete frame comes first.
        splatter.capacity = 64;
        let b = FrameBuffers::new(gpu, &splatter.options, &splatter.shared, count, SIZE, splatter.capacity);
        splatter.frame = super::super::Frame::new(gpu, &splatter.pipelines, &b, 30);
        assert_eq!(matches!(splatter.frame.bin.lists, Lists::ByStrands { .. }), by_strands);
        let view = View {
            row_x: [1.0, 0.0, 0.0, 0.0],
            row_y: [0.0, 1.0, 0.0, 0.0],
            row_z: [0.0, 0.0, 1.0, 0.0],
            focal: [200.0; 2],
            principal: [100.0, 70.0],
            size: SIZE,
            tiles: SIZE.map(|edge| edge.div_ceil(super::super::TILE_SIZE)),
            slope_min: [-1.0; 2],
            slope_max: [1.0; 2],
            near: 0.01,
            opacity: 0.5,
            ..View::zeroed()
        };
        splatter.set_view(gpu, view).unwrap();
        gpu.queue.write_buffer(splatter.gaussians(), 0, bytemuck::cast_slice(table));
        gpu.queue.write_buffer(splatter.d_image(), 0, bytemuck::cast_slice(d_image));
        let counters = splatter.run_frame(gpu, |splatter, encoder| {
            splatter.forward(encoder);
            splatter.backward(encoder);
            Ok(())
        });
        let read = |buffer, words| buffers::read(gpu, buffer, words).unwrap();
        (read(splatter.image(), d_image.len()), read(splatter.d_gaussians(), table.len()), counters.unwrap())
    }

    #[test]
    fn both_kinds_of_lists_give_the_same_bits() {
        let gpu = Gpu::new(&AdapterChoice::from_env()).unwrap();
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        for count in [1, 9, 6000, 70_000] {
            // Some are behind the camera, some beside the picture, and many at the same depth.
            let mut rows = vec![Vec::new(); SplatModel::HAND.rows()];
            for _ in 0..count {
                let depth: f32 = rng.random_range(-0.3..1.0);
                let depth = if rng.random_bool(0.3) { (depth * 20.0).round() / 20.0 } else { depth };
                let scale = if rng.random_bool(0.01) { 0.3 } else { rng.random_range(0.0003..0.01) };
                let values = [rng.random_range(-0.8..0.8), rng.random_range(-0.6..0.6), depth, scale];
                let color = [(); 3].map(|()| rng.random_range(0.0..1.0));
                rows.iter_mut().zip([&values[..], &color].concat()).for_each(|(row, value)| row.push(value));
            }
            let d_image: Vec<f32> = (0..4 * SIZE[0] * SIZE[1]).map(|_| rng.random_range(-1.0..1.0)).collect();
            let [sorted, counted] = [false, true].map(|kind| frame(&gpu, kind, &rows.concat(), &d_image));
            assert_eq!(sorted.2, counted.2);
            assert!(sorted.0 == counted.0, "{count} Gaussians: the images differ");
            assert!(sorted.1 == counted.1, "{count} Gaussians: the gradients differ");
            assert!(count < 1000 || sorted.2.intersections > 64, "no incomplete frame was tested");
        }
    }
}

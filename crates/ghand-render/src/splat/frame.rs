//! The buffers of a frame and the stages bound to them.

use super::{Counters, Purpose, Shared, SplatOptions, TILE_SIZE, bin, project, rasterize, sort};
use crate::{Gpu, buffers};

/// Bits of a depth key, as in `project.wgsl`.
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
        let SplatOptions { model, purpose, depth } = options;
        Pipelines {
            project: project::Pipelines::new(gpu, model, *purpose),
            sort: sort::Pipelines::new(gpu),
            bin: bin::Pipelines::new(gpu),
            rasterize: rasterize::Pipelines::new(gpu, model, *purpose, *depth),
        }
    }
}

/// The buffers passed between the stages of a frame. Sizes: N Gaussians, `capacity` intersections, the tiles and pixels
/// of the largest image.
pub struct FrameBuffers {
    pub shared: Shared,
    pub splats: wgpu::Buffer,
    pub tile_rects: wgpu::Buffer,
    /// Keys and values of the depth sort, before and after.
    pub depth_keys: [wgpu::Buffer; 2],
    pub depth_order: [wgpu::Buffer; 2],
    pub slot_offsets: wgpu::Buffer,
    pub slot_ranges: wgpu::Buffer,
    pub slot_gaussians: wgpu::Buffer,
    /// Keys and values of the tile sort, before and after.
    pub tile_keys: [wgpu::Buffer; 2],
    pub slots: [wgpu::Buffer; 2],
    pub tile_bits: u32,
    pub tile_ranges: wgpu::Buffer,
    pub pixel_states: wgpu::Buffer,
    /// Empty without gradients, like the marks.
    pub slot_gradients: wgpu::Buffer,
    pub slot_marks: wgpu::Buffer,
    /// Empty without the camera's gradient.
    pub camera_rows: wgpu::Buffer,
    pub camera_strands: wgpu::Buffer,
    pub count: usize,
}

impl FrameBuffers {
    pub fn new(
        gpu: &Gpu,
        options: &SplatOptions,
        shared: &Shared,
        count: usize,
        max_size: [u32; 2],
        capacity: u32,
    ) -> FrameBuffers {
        let [width, height] = max_size;
        let pixels = width as usize * height as usize;
        let tiles = width.div_ceil(TILE_SIZE) as usize * height.div_ceil(TILE_SIZE) as usize;
        let capacity = capacity as usize;
        let places = if options.purpose.has_gradients() { capacity * rasterize::places(gpu.tier) as usize } else { 0 };
        let make = |label: &str, words: usize| buffers::zeroed(gpu, label, words);
        FrameBuffers {
            shared: shared.clone(),
            splats: make("splats", count * size_of::<super::Splat>() / 4),
            tile_rects: make("tile rects", 2 * count),
            depth_keys: [make("depth keys", count), make("depth keys sorted", count)],
            depth_order: [make("depth order", count), make("depth order sorted", count)],
            slot_offsets: make("slot offsets", count),
            slot_ranges: make("slot ranges", 2 * count),
            slot_gaussians: make("slot gaussians", capacity),
            tile_keys: [make("tile keys", capacity), make("tile keys sorted", capacity)],
            slots: [make("slots", capacity), make("slots sorted", capacity)],
            // The number of bits of the largest tile index, at least one.
            tile_bits: (usize::BITS - (tiles - 1).leading_zeros()).max(1),
            tile_ranges: make("tile ranges", 2 * tiles),
            pixel_states: make("pixel states", 2 * pixels),
            slot_gradients: make("slot gradients", 8 * places),
            slot_marks: make("slot marks", places * if options.model.slot_opacity() { 2 } else { 1 }),
            camera_rows: make(
                "camera rows",
                if options.purpose == Purpose::CameraGradients { project::CAMERA_ROWS * count } else { 0 },
            ),
            camera_strands: make("camera strands", project::CAMERA_ROWS * project::CAMERA_STRANDS),
            count,
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
    pub fn new(gpu: &Gpu, pipelines: &Pipelines, b: &FrameBuffers) -> Frame {
        let counters = &b.shared.counters;
        let depth_sort = sort::Stages::new(
            gpu,
            &pipelines.sort,
            counters,
            Counters::GAUSSIANS,
            DEPTH_BITS,
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

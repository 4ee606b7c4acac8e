//! The buffers of a frame.

use super::{Purpose, Shared, SplatOptions, TILE_SIZE};
use crate::{Gpu, Tier, buffers};

/// Rows of the camera's gradient: rotation and translation.
pub const CAMERA_ROWS: usize = 6;
/// Strands (partial sums) of its sum, as in `camera_gradient.wgsl`.
pub const CAMERA_STRANDS: usize = 64;

/// Cells of an intersection's gradients: one per 4x4 pixels of the tile, or one in all where the invocations of a tile add
/// up their gradients.
pub fn gradient_cells(tier: Tier) -> u32 {
    tier.choose(4, 1)
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
    pub tile_ranges: wgpu::Buffer,
    pub pixel_states: wgpu::Buffer,
    /// Empty without gradients, like the marks.
    pub slot_gradients: wgpu::Buffer,
    pub slot_marks: wgpu::Buffer,
    /// Empty without the camera's gradient.
    pub camera_rows: wgpu::Buffer,
    pub camera_strands: wgpu::Buffer,
    pub count: usize,
    pub capacity: u32,
    pub tiles: u32,
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
        let tiles = width.div_ceil(TILE_SIZE) * height.div_ceil(TILE_SIZE);
        let cells =
            if options.purpose.has_gradients() { capacity as usize * gradient_cells(gpu.tier) as usize } else { 0 };
        let make = |label: &str, words: usize| buffers::zeroed(gpu, label, words);
        FrameBuffers {
            shared: shared.clone(),
            splats: make("splats", count * size_of::<super::Splat>() / 4),
            tile_rects: make("tile rects", 2 * count),
            depth_keys: [make("depth keys", count), make("depth keys sorted", count)],
            depth_order: [make("depth order", count), make("depth order sorted", count)],
            tile_ranges: make("tile ranges", 2 * tiles as usize),
            pixel_states: make("pixel states", 2 * pixels),
            slot_gradients: make("slot gradients", 8 * cells),
            slot_marks: make("slot marks", cells * if options.model.slot_opacity() { 2 } else { 1 }),
            camera_rows: make(
                "camera rows",
                if options.purpose == Purpose::CameraGradients { CAMERA_ROWS * count } else { 0 },
            ),
            camera_strands: make("camera strands", CAMERA_ROWS * CAMERA_STRANDS),
            count,
            capacity,
            tiles,
        }
    }
}

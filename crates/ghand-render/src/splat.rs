//! The splatter: renders Gaussians to an image, and computes gradients.
//!
//! project + cull -> sort by depth -> count tiles -> prefix sum -> order by tile -> tile ranges -> rasterise; backwards:
//! number slots -> rasterise_backward -> project_backward. Nothing is read back in between: the intersection
//! buffer has a capacity, a counter holds the required number, and the caller grows the buffers and repeats the frame.

mod bands;
mod bin;
mod counters;
mod frame;
mod frame_buffers;
mod growth;
mod model;
mod project;
mod rasterize;
mod slots;
mod sort;

use bytemuck::{Pod, Zeroable};
use ghand_core::Camera;
use serde::Serialize;

use crate::pipeline::compute_pass;
use crate::{Gpu, RenderError, Tier, buffers, timing};
pub use bands::band_rows;
pub use bin::StrandUniforms;
pub use counters::Counters;
use frame::{Frame, Pipelines};
use frame_buffers::FrameBuffers;
use growth::Growth;
pub use model::{Color, FLATNESS, Opacity, Shape, SplatModel, Stored};
pub use sort::{ScanUniforms, SortUniforms};

/// Edge of a tile in pixels, as in `shaders/shared/camera.wgsl`.
pub const TILE_SIZE: u32 = 8;
/// Near plane, metres.
pub const NEAR: f32 = 0.01;

/// The outputs of a splatter. Fewer outputs take less memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Purpose {
    /// Images.
    Images,
    /// Images and gradients of the Gaussians.
    #[default]
    Gradients,
    /// Images, gradients of the Gaussians, and the camera's gradient.
    CameraGradients,
}

impl Purpose {
    fn has_gradients(self) -> bool {
        self != Purpose::Images
    }
}

/// Options of a splatter. The default is for training hands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct SplatOptions {
    /// The kind of the Gaussians.
    pub model: SplatModel,
    /// Images only, or also gradients.
    pub purpose: Purpose,
    /// Whether the expected depth is rendered along with the image.
    pub depth: bool,
    /// Whether each Gaussian's largest weight in a pixel is found along with the image.
    pub largest_weights: bool,
    /// Which contributions are skipped.
    pub thresholds: Thresholds,
}

/// Contributions below these are skipped. The default is for training: it skips only what no display shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Thresholds {
    /// A Gaussian is not blended into pixels that it covers by less than this, 255ths; 1 to 254.
    pub alpha: u32,
    /// Bits of the depths by which Gaussians are sorted, 1 to 30: the highest of a float's bits. With 20 of them, depths
    /// that differ by a part of 1.2e-4 may count as the same, with 10 by a part of 0.125; those are in the order of
    /// the Gaussians.
    pub depth_bits: u32,
}

impl Default for Thresholds {
    fn default() -> Thresholds {
        Thresholds { alpha: 1, depth_bits: frame::DEPTH_BITS }
    }
}

impl Thresholds {
    fn alpha_min(&self) -> (&'static str, f64) {
        ("ALPHA_MIN", f64::from(self.alpha.clamp(1, 254)) / 255.0)
    }

    fn depth_bits(&self) -> u32 {
        self.depth_bits.clamp(1, frame::DEPTH_BITS)
    }
}

impl SplatOptions {
    /// Largest buffer entry of one intersection, bytes, which limits the number of intersections.
    fn bytes_per_intersection(&self, tier: Tier) -> u64 {
        if self.purpose.has_gradients() { 32 * u64::from(frame_buffers::gradient_cells(tier)) } else { 4 }
    }
}

/// A part of a frame that can be timed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FrameStage {
    /// Project and cull.
    Project,
    /// Sort by depth.
    SortDepth,
    /// Count tiles, prefix sum; emit intersections if they are sorted.
    Bin,
    /// Order by tile: sort, or count and place.
    SortTiles,
    /// Range of each tile.
    FindRanges,
    /// Blend.
    Rasterize,
    /// Number the slots.
    NumberSlots,
    /// Gradients of the splats, by slot.
    RasterizeBackward,
    /// Gradients of the Gaussians.
    ProjectBackward,
}

impl FrameStage {
    /// The stages of an image, in order.
    pub const FORWARD: [FrameStage; 6] = [
        FrameStage::Project,
        FrameStage::SortDepth,
        FrameStage::Bin,
        FrameStage::SortTiles,
        FrameStage::FindRanges,
        FrameStage::Rasterize,
    ];
    /// The stages of its gradient, in order.
    pub const BACKWARD: [FrameStage; 3] =
        [FrameStage::NumberSlots, FrameStage::RasterizeBackward, FrameStage::ProjectBackward];

    /// Name for display and JSON.
    pub fn name(self) -> &'static str {
        match self {
            FrameStage::Project => "project",
            FrameStage::SortDepth => "sort_depth",
            FrameStage::Bin => "bin",
            FrameStage::SortTiles => "sort_tiles",
            FrameStage::FindRanges => "find_ranges",
            FrameStage::Rasterize => "rasterize",
            FrameStage::NumberSlots => "number_slots",
            FrameStage::RasterizeBackward => "rasterize_backward",
            FrameStage::ProjectBackward => "project_backward",
        }
    }
}

/// Constants shared by the splatter's shaders and host code: stage, name in the WGSL, value here. A test compares them.
pub fn shared_constants() -> Vec<(&'static str, &'static str, u32)> {
    let others = [
        ("project", "TILE_SIZE", TILE_SIZE),
        ("project", "DEPTH_KEY_MAX", (1 << frame::DEPTH_BITS) - 1),
        ("camera_gradient", "STRANDS", frame_buffers::CAMERA_STRANDS as u32),
        ("rasterize_backward", "CELLS", rasterize::backward_invocations(Tier::Gpu)),
        ("subgroups/rasterize_backward", "LANES", rasterize::backward_invocations(Tier::GpuSubgroups)),
    ];
    [&sort::SHARED_CONSTANTS[..], &others].concat()
}

/// Shader-side view, see `shaders/shared/camera.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct View {
    /// First row of `camera_from_world` and its translation.
    pub row_x: [f32; 4],
    /// Second row.
    pub row_y: [f32; 4],
    /// Third row.
    pub row_z: [f32; 4],
    /// Focal lengths, pixels.
    pub focal: [f32; 2],
    /// Principal point, pixels.
    pub principal: [f32; 2],
    /// Background colour.
    pub background: [f32; 4],
    /// Image size, pixels.
    pub size: [u32; 2],
    /// Image size, tiles.
    pub tiles: [u32; 2],
    /// Lower bounds of x/z, y/z in the Jacobian.
    pub slope_min: [f32; 2],
    /// Upper bounds.
    pub slope_max: [f32; 2],
    /// N.
    pub gaussian_count: u32,
    /// Capacity of the intersection buffers.
    pub intersection_capacity: u32,
    /// Near plane, metres.
    pub near: f32,
    /// Opacity of all Gaussians.
    pub opacity: f32,
    /// First row of the frame in the image to which the principal point refers; see [`View::band`].
    pub first_row: u32,
    /// Unused.
    pub padding_1: u32,
    /// Unused.
    pub padding_2: u32,
    /// Unused.
    pub padding_3: u32,
}

/// Shader-side splat, see `shaders/shared/gaussian.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct Splat {
    /// Centre, pixels.
    pub mean: [f32; 2],
    /// Camera z, metres.
    pub depth: f32,
    /// Opacity.
    pub opacity: f32,
    /// Inverse covariance xx, xy, yy, pixels^-2.
    pub conic: [f32; 3],
    /// Number of its slot for tile (0, 0), modulo 2^32, in the backward pass.
    pub slot_origin: u32,
    /// Colour.
    pub color: [f32; 3],
    /// Number of its slots in a row of tiles, in the backward pass.
    pub slot_columns: u32,
}

impl View {
    /// The view of a camera for `count` Gaussians over a background.
    pub fn new(camera: &Camera, count: usize, background: [f32; 3], opacity: f32) -> View {
        let row = |i: usize| {
            let r = camera.rotation.row(i);
            [r.x as f32, r.y as f32, r.z as f32, camera.translation[i] as f32]
        };
        let size = glam::DVec2::new(f64::from(camera.width), f64::from(camera.height));
        // The field of view plus 15 % of the image on every side, as slopes.
        let margin = 0.15 * size;
        let slope_min = -(camera.principal + margin) / camera.focal;
        let slope_max = (size - camera.principal + margin) / camera.focal;
        let pair = |v: glam::DVec2| [v.x as f32, v.y as f32];
        View {
            row_x: row(0),
            row_y: row(1),
            row_z: row(2),
            focal: pair(camera.focal),
            principal: pair(camera.principal),
            background: [background[0], background[1], background[2], 1.0],
            size: [camera.width, camera.height],
            tiles: [camera.width.div_ceil(TILE_SIZE), camera.height.div_ceil(TILE_SIZE)],
            slope_min: pair(slope_min),
            slope_max: pair(slope_max),
            gaussian_count: count as u32,
            intersection_capacity: 0,
            near: NEAR,
            opacity,
            ..View::zeroed()
        }
    }
}

/// A rendered image on the host.
#[derive(Debug, Clone, PartialEq)]
pub struct Image {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Row-major colour over the background and coverage, each in 0..1.
    pub rgba: Vec<[f32; 4]>,
}

/// A splatter for a fixed number of Gaussians and images up to a size. See `examples/splat_a_scene.rs`.
pub struct Splatter {
    pipelines: Pipelines,
    shared: Shared,
    frame: Frame,
    count: usize,
    max_size: [u32; 2],
    capacity: u32,
    current: View,
    options: SplatOptions,
    growth: Option<Growth>,
}

/// Description of a splatter in errors.
fn description(count: usize, [width, height]: [u32; 2]) -> String {
    format!("a splatter of {count} Gaussians and images up to {width} x {height} pixels")
}

/// Buffers visible to callers, which live as long as the splatter.
#[derive(Debug, Clone)]
struct Shared {
    view: wgpu::Buffer,
    gaussians: wgpu::Buffer,
    d_gaussians: wgpu::Buffer,
    counters: wgpu::Buffer,
    image: wgpu::Buffer,
    depths: wgpu::Buffer,
    largest_weights: wgpu::Buffer,
    d_image: wgpu::Buffer,
    d_camera: wgpu::Buffer,
}

impl Splatter {
    /// A splatter for `count` Gaussians of the kind in `options`, and images of at most `max_size` pixels.
    ///
    /// # Errors
    /// [`RenderError::Invalid`] for images larger than any splatter supports, [`RenderError::OutOfMemory`] if this
    /// device has too little memory, [`RenderError::Lost`] if the device is lost.
    pub fn new(gpu: &Gpu, options: SplatOptions, count: usize, max_size: [u32; 2]) -> Result<Splatter, RenderError> {
        let [width, height] = max_size;
        // The loss keeps 48 bytes per pixel in one buffer; this bound keeps every buffer of the frame below that.
        if width == 0 || height == 0 || width > 16_384 || height > 16_384 {
            return Err(RenderError::Invalid(format!(
                "an image of {width} x {height} pixels; both must be between 1 and 16384"
            )));
        }
        gpu.scoped(&description(count, max_size), || Splatter::make(gpu, options, count, max_size))
    }

    fn make(gpu: &Gpu, options: SplatOptions, count: usize, max_size: [u32; 2]) -> Splatter {
        let pixels = max_size[0] as usize * max_size[1] as usize;
        let pipelines = Pipelines::new(gpu, &options);
        let current = View::zeroed();
        let rows = options.model.rows();
        let if_gradients = |words: usize| if options.purpose.has_gradients() { words } else { 0 };
        let shared = Shared {
            view: buffers::uniform(gpu, "view", &current),
            gaussians: buffers::zeroed(gpu, "gaussians", rows * count),
            d_gaussians: buffers::zeroed(gpu, "d_gaussians", if_gradients(rows * count)),
            counters: buffers::filled(gpu, "counters", &[Counters { gaussians: count as u32, ..Counters::default() }]),
            image: buffers::zeroed(gpu, "image", 4 * pixels),
            depths: buffers::zeroed(gpu, "depths", if options.depth { pixels } else { 0 }),
            largest_weights: buffers::zeroed(gpu, "largest weights", if options.largest_weights { count } else { 0 }),
            d_image: buffers::zeroed(gpu, "d_image", if_gradients(4 * pixels)),
            d_camera: buffers::zeroed(gpu, "d_camera", frame_buffers::CAMERA_ROWS),
        };
        // Each Gaussian of a hand touches three to four tiles; the buffer grows for views that need more.
        let capacity = (4 * count as u32).max(1024);
        let buffers = FrameBuffers::new(gpu, &options, &shared, count, max_size, capacity);
        let frame = Frame::new(gpu, &pipelines, &buffers, options.thresholds.depth_bits());
        Splatter { pipelines, shared, frame, count, max_size, capacity, current, options, growth: None }
    }

    /// The options of the splatter.
    pub fn options(&self) -> &SplatOptions {
        &self.options
    }

    /// The table of Gaussians, [`SplatModel::rows`] numbers for each of N, ordered by [`SplatModel::index`].
    pub fn gaussians(&self) -> &wgpu::Buffer {
        &self.shared.gaussians
    }

    /// dL/d(table of Gaussians), same shape.
    pub fn d_gaussians(&self) -> &wgpu::Buffer {
        &self.shared.d_gaussians
    }

    /// The image: one `vec4` per pixel, colour over the background and coverage.
    pub fn image(&self) -> &wgpu::Buffer {
        &self.shared.image
    }

    /// dL/d(image), to be filled before [`Splatter::backward`].
    pub fn d_image(&self) -> &wgpu::Buffer {
        &self.shared.d_image
    }

    /// Expected camera z of each pixel, metres, 0 in pixels without coverage; empty if it was not requested.
    pub fn depths(&self) -> &wgpu::Buffer {
        &self.shared.depths
    }

    /// The largest weight with which a pixel of the image takes each Gaussian, N numbers of 0 to 1; empty if they were not
    /// requested.
    pub fn largest_weights(&self) -> &wgpu::Buffer {
        &self.shared.largest_weights
    }

    /// dL/d(rotation, translation): the gradient with respect to a small rotation w and translation t that take the
    /// camera coordinates x to x + w x x + t. Zero if it was not requested.
    pub fn d_camera(&self) -> &wgpu::Buffer {
        &self.shared.d_camera
    }

    /// The frame's [`Counters`].
    pub fn counters(&self) -> &wgpu::Buffer {
        &self.shared.counters
    }

    /// Number of Gaussians.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Capacity of the intersection buffers.
    pub fn capacity(&self) -> u32 {
        self.capacity
    }

    /// Sets the view of later frames.
    ///
    /// # Errors
    /// [`RenderError::Invalid`] if the image is larger than the splatter was made for.
    pub fn set_view(&mut self, gpu: &Gpu, view: View) -> Result<(), RenderError> {
        let [w, h] = view.size;
        if w == 0 || h == 0 || w > self.max_size[0] || h > self.max_size[1] {
            let [max_w, max_h] = self.max_size;
            return Err(RenderError::Invalid(format!(
                "an image of {w} x {h} pixels, but the splatter is for {max_w} x {max_h}"
            )));
        }
        self.current = View { intersection_capacity: self.capacity, gaussian_count: self.count as u32, ..view };
        gpu.queue.write_buffer(&self.shared.view, 0, bytemuck::bytes_of(&self.current));
        Ok(())
    }

    /// Encodes the forward pass: table of Gaussians to image.
    pub fn forward(&self, encoder: &mut wgpu::CommandEncoder) {
        self.clear(encoder);
        let mut pass = compute_pass(encoder, "splat");
        FrameStage::FORWARD.iter().for_each(|stage| self.encode_stage(*stage, &mut pass));
    }

    /// As [`Splatter::forward`], but with a pass for each stage, which writes these timestamps.
    pub fn forward_timed<'a>(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        timestamps: impl Fn(FrameStage) -> Option<wgpu::ComputePassTimestampWrites<'a>>,
    ) {
        self.clear(encoder);
        for stage in FrameStage::FORWARD {
            let descriptor =
                wgpu::ComputePassDescriptor { label: Some(stage.name()), timestamp_writes: timestamps(stage) };
            self.encode_stage(stage, &mut encoder.begin_compute_pass(&descriptor));
        }
    }

    /// Encodes clearing the buffers that the forward pass accumulates into.
    fn clear(&self, encoder: &mut wgpu::CommandEncoder) {
        encoder.clear_buffer(&self.shared.counters, Counters::CLEARED_FROM, None);
        if self.options.largest_weights {
            encoder.clear_buffer(&self.shared.largest_weights, 0, None);
        }
        self.frame.bin.clear(encoder);
    }

    fn encode_stage(&self, stage: FrameStage, pass: &mut wgpu::ComputePass<'_>) {
        let frame = &self.frame;
        let tiles = self.current.tiles;
        match stage {
            FrameStage::Project => frame.project.forward(pass),
            FrameStage::SortDepth => frame.depth_sort.encode(pass),
            FrameStage::Bin => frame.bin.count(pass),
            FrameStage::SortTiles => frame.bin.order(pass),
            FrameStage::FindRanges => frame.bin.find_ranges(pass, tiles),
            FrameStage::Rasterize => frame.rasterize.forward(pass, tiles),
            FrameStage::NumberSlots => frame.slots.iter().for_each(|slots| slots.encode(pass)),
            FrameStage::RasterizeBackward => frame.rasterize.backward(pass, tiles),
            FrameStage::ProjectBackward => frame.project.backward(pass),
        }
    }

    /// Runs one frame, with the backward pass if there are gradients, and returns the time of each stage, milliseconds:
    /// by timestamps if the device supports them, else by waiting for each.
    ///
    /// # Errors
    /// [`RenderError`] if the device failed or was lost.
    pub fn time_stages(&self, gpu: &Gpu) -> Result<Vec<(FrameStage, f64)>, RenderError> {
        let backward: &[FrameStage] = if self.options.purpose.has_gradients() { &FrameStage::BACKWARD } else { &[] };
        let stages = [&FrameStage::FORWARD[..], backward].concat();
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        self.clear(&mut encoder);
        self.frame.rasterize.clear(&mut encoder);
        let times = timing::time_passes(gpu, encoder, stages.len(), |k, pass| self.encode_stage(stages[k], pass))?;
        Ok(stages.into_iter().zip(times).collect())
    }

    /// Encodes the backward pass: dL/d(image) to dL/d(table of Gaussians). The forward pass of the same view must have
    /// been encoded before. Does nothing in a splatter without gradients.
    pub fn backward(&self, encoder: &mut wgpu::CommandEncoder) {
        if !self.options.purpose.has_gradients() {
            return;
        }
        self.frame.rasterize.clear(encoder);
        let mut pass = compute_pass(encoder, "splat backward");
        FrameStage::BACKWARD.iter().for_each(|stage| self.encode_stage(*stage, &mut pass));
    }

    /// Reads the counters of the last frame; waits for it.
    ///
    /// # Errors
    /// [`RenderError`] if the device failed or was lost.
    pub fn read_counters(&self, gpu: &Gpu) -> Result<Counters, RenderError> {
        Ok(buffers::read(gpu, &self.shared.counters, 1)?.first().copied().unwrap_or_default())
    }

    /// Whether the frame of these counters was complete. If not, the buffers are grown, and the frame must be encoded
    /// again. If growing fails, the buffers are unchanged, and smaller frames can still be rendered.
    ///
    /// # Errors
    /// [`RenderError::Invalid`] if the device cannot hold that many intersections or process a tile's Gaussians;
    /// [`RenderError::OutOfMemory`] if it has too little memory now, [`RenderError::Lost`] if it is lost.
    pub fn complete_for(&mut self, gpu: &Gpu, counters: &Counters) -> Result<bool, RenderError> {
        let &Counters { intersections_wanted: wanted, cut_short, too_wide, .. } = counters;
        if cut_short > 0 {
            // Mesa's software rasteriser ends shader loops after 65,535 iterations, here of two, eight or sixteen
            // Gaussians.
            return Err(RenderError::Invalid(format!(
                "{cut_short} Gaussians are on one tile of {TILE_SIZE} x {TILE_SIZE} pixels, more than {} can process; \
                 render a larger image or fewer Gaussians, or use a GPU",
                gpu.info.name
            )));
        }
        if too_wide > 0 {
            return Err(RenderError::Invalid(format!(
                "a Gaussian covers {too_wide} tiles of {TILE_SIZE} x {TILE_SIZE} pixels, more than {} can process; \
                 render a smaller image, or use a GPU",
                gpu.info.name
            )));
        }
        if wanted <= self.capacity {
            return Ok(true);
        }
        let limit = gpu.device.limits().max_storage_buffer_binding_size / self.options.bytes_per_intersection(gpu.tier);
        let limit = u32::try_from(limit).unwrap_or(u32::MAX);
        if wanted > limit {
            return Err(RenderError::Invalid(format!(
                "the view needs {wanted} tile intersections, but the device can hold {limit}; use fewer or smaller \
                 Gaussians or a smaller image"
            )));
        }
        let capacity = wanted.saturating_add(wanted / 2).min(limit);
        let what = format!("{capacity} tile intersections in {}", description(self.count, self.max_size));
        self.frame = gpu.scoped(&what, || {
            let buffers = FrameBuffers::new(gpu, &self.options, &self.shared, self.count, self.max_size, capacity);
            Frame::new(gpu, &self.pipelines, &buffers, self.options.thresholds.depth_bits())
        })?;
        self.capacity = capacity;
        self.set_view(gpu, self.current)?;
        Ok(false)
    }

    /// Runs one frame: submits the commands of `encode`, which must include [`Splatter::forward`], and repeats this
    /// with a larger intersection buffer until the frame is complete. Other commands of `encode` can run on an
    /// incomplete frame, and are repeated.
    ///
    /// # Errors
    /// As [`Splatter::complete_for`], or the error of `encode`.
    pub fn run_frame(
        &mut self,
        gpu: &Gpu,
        mut encode: impl FnMut(&Splatter, &mut wgpu::CommandEncoder) -> Result<(), RenderError>,
    ) -> Result<Counters, RenderError> {
        loop {
            let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            encode(self, &mut encoder)?;
            gpu.queue.submit([encoder.finish()]);
            let counters = self.read_counters(gpu)?;
            if self.complete_for(gpu, &counters)? {
                return Ok(counters);
            }
        }
    }

    /// Renders the current view of the current table and waits for the image.
    ///
    /// # Errors
    /// [`RenderError`] if the device failed or ran out of memory.
    pub fn render(&mut self, gpu: &Gpu) -> Result<Image, RenderError> {
        self.run_frame(gpu, |splatter, encoder| {
            splatter.forward(encoder);
            Ok(())
        })?;
        self.read_image(gpu)
    }

    /// As [`Splatter::render`], without blocking the thread: for browsers. Elsewhere [`Gpu::poll`] must be called until
    /// it is done.
    ///
    /// # Errors
    /// As [`Splatter::render`].
    pub async fn render_async(&mut self, gpu: &Gpu) -> Result<Image, RenderError> {
        loop {
            let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            self.forward(&mut encoder);
            gpu.queue.submit([encoder.finish()]);
            let counters = buffers::read_async(gpu, &self.shared.counters, 1).await?.first().copied();
            if self.complete_for(gpu, &counters.unwrap_or_default())? {
                return self.read_image_async(gpu).await;
            }
        }
    }

    /// As [`Splatter::read_image`], without blocking the thread; see [`Splatter::render_async`].
    ///
    /// # Errors
    /// As [`Splatter::read_image`].
    pub async fn read_image_async(&self, gpu: &Gpu) -> Result<Image, RenderError> {
        let [width, height] = self.current.size;
        let rgba = buffers::read_async(gpu, &self.shared.image, width as usize * height as usize).await?;
        Ok(Image { width, height, rgba })
    }

    /// Reads the last frame's image; waits for it.
    ///
    /// # Errors
    /// [`RenderError`] if the device failed or was lost.
    pub fn read_image(&self, gpu: &Gpu) -> Result<Image, RenderError> {
        let [width, height] = self.current.size;
        let rgba = buffers::read(gpu, &self.shared.image, width as usize * height as usize)?;
        Ok(Image { width, height, rgba })
    }
}

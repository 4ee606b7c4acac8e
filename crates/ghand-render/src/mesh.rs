//! Offscreen rendering of triangle meshes with depth: textured or coloured, lit or unlit, with edges as lines.
//!
//! Draws the truth of synthetic captures and the mesh layers of viewers. The CPU twin is [`crate::reference::mesh`].

mod blocks;
mod edges;
mod faces;
mod image;
mod input;
mod resolve;
pub mod weights;
mod wireframe;

use crate::device::Gpu;
use ghand_core::Camera;

pub(crate) use self::edges::{Segment, segments};
pub use self::faces::MeshUniforms;
pub use self::image::MeshImage;
pub(crate) use self::input::check_input;
pub use self::input::{
    FARTHEST, LINE_WIDTHS, Light, MAX_LIGHTS, MAX_SUPERSAMPLE, MeshError, MeshInstance, MeshStyle, Shading, Surface,
    Wireframe,
};
pub use self::resolve::ResolveUniforms;
use self::resolve::Resolved;
pub use self::wireframe::WireframeUniforms;

/// Geometry nearer to the camera than this is clipped, metres (the near plane of the splatter).
pub const NEAR_PLANE: f64 = 0.01;

/// Draws meshes on one device.
#[derive(Debug)]
pub struct MeshRenderer {
    context: Context,
    faces: faces::Faces,
    lines: wireframe::Lines,
    resolve: resolve::Resolve,
}

/// The device with which the stages of an image make buffers and textures.
#[derive(Debug)]
struct Context {
    gpu: Gpu,
    device: wgpu::Device,
    queue: wgpu::Queue,
}

/// The textures passed between the stages of an image, at k times its size and with a margin for lines.
struct Targets {
    /// Width and height, samples.
    size: [u32; 2],
    /// Premultiplied colours of the faces.
    color: wgpu::TextureView,
    /// Camera z of the faces, metres; 0 in samples without a face.
    face_depth: wgpu::TextureView,
    /// Coverage by visible lines; one sample if there are no lines.
    coverage: wgpu::TextureView,
}

impl MeshRenderer {
    /// Builds the pipelines.
    ///
    /// # Errors
    /// [`MeshError::Device`] if the device rejects the shaders.
    pub fn new(gpu: &Gpu) -> Result<MeshRenderer, MeshError> {
        let context = Context { gpu: gpu.clone(), device: gpu.device.clone(), queue: gpu.queue.clone() };
        let (faces, lines, resolve) = gpu.scoped("the mesh rasteriser", || {
            let device = &gpu.device;
            (faces::Faces::new(device), wireframe::Lines::new(device), resolve::Resolve::new(gpu))
        })?;
        Ok(MeshRenderer { context, faces, lines, resolve })
    }

    /// Draws an image of validated input in one piece and waits for it.
    fn render_block(&self, mesh: &MeshInstance, camera: &Camera, style: &MeshStyle) -> Result<MeshImage, MeshError> {
        let k = style.supersample;
        let what = format!(
            "a mesh of {} triangles in {} x {} pixels, {k} x {k} samples each",
            mesh.triangles.len(),
            camera.width,
            camera.height
        );
        let readback = self.context.gpu.scoped(&what, || {
            let mut encoder = self.context.device.create_command_encoder(&Default::default());
            let image = self.encode_block(&mut encoder, mesh, camera, style);
            let readback = image.read_back(&self.context, &mut encoder);
            self.context.queue.submit([encoder.finish()]);
            readback
        })?;
        readback.read(&self.context, camera)
    }

    /// Encodes all stages of an image of validated input.
    fn encode_block(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        mesh: &MeshInstance,
        camera: &Camera,
        style: &MeshStyle,
    ) -> Resolved {
        let k = style.supersample;
        let margin = style.wireframe.map_or(0, |w| w.margin());
        let around = with_margin(camera, margin);
        let targets = self.context.targets(&around, k, style.wireframe.is_some());
        self.faces.encode(&self.context, encoder, mesh, &around, &style.shading, &targets);
        if let Some(wireframe) = &style.wireframe {
            let half_width = 0.5 * wireframe.width * f64::from(k);
            let segments = segments(mesh.positions, mesh.triangles, &around, k, half_width + 1.0);
            self.lines.encode(&self.context, encoder, &segments, half_width, &targets);
        }
        self.resolve.encode(&self.context, encoder, camera, style, margin, &targets)
    }

    /// Encodes an image that stays on the device, and returns its buffer: row-major premultiplied pixels,
    /// `vec4<f32>(colour x coverage, coverage)`.
    ///
    /// # Errors
    /// [`MeshError::Invalid`] if the input is unusable or the device has no textures of that many samples;
    /// [`MeshError::Device`] if it lacks memory.
    pub fn encode(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        mesh: &MeshInstance,
        camera: &Camera,
        style: &MeshStyle,
    ) -> Result<wgpu::Buffer, MeshError> {
        check_input(mesh, camera, style)?;
        let largest = self.largest_block(style);
        if camera.width.max(camera.height) > largest {
            let size = format!("{} x {} pixels", camera.width, camera.height);
            return MeshError::invalid("size", format!("{size}; at most {largest} are drawn at once"));
        }
        let what = format!("a mesh in {} x {} pixels", camera.width, camera.height);
        Ok(self.context.gpu.scoped(&what, || self.encode_block(encoder, mesh, camera, style).colors)?)
    }
}

/// The camera of an image extended by `margin` pixels on every side.
pub(crate) fn with_margin(camera: &Camera, margin: u32) -> Camera {
    let offset = -(margin as i32);
    camera.cropped(offset, offset, camera.width + 2 * margin, camera.height + 2 * margin)
}

/// A color attachment that is cleared to zero and stored.
fn color_target(view: &wgpu::TextureView) -> Option<wgpu::RenderPassColorAttachment<'_>> {
    Some(wgpu::RenderPassColorAttachment {
        view,
        depth_slice: None,
        resolve_target: None,
        ops: wgpu::Operations { load: wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT), store: wgpu::StoreOp::Store },
    })
}

impl Context {
    fn targets(&self, camera: &Camera, k: u32, lines: bool) -> Targets {
        let size = [camera.width * k, camera.height * k];
        let line_size = if lines { size } else { [1; 2] };
        Targets {
            size,
            color: self.target("mesh color", size, faces::COLOR_FORMAT),
            face_depth: self.target("mesh face depth", size, faces::SAMPLE_DEPTH_FORMAT),
            coverage: self.target("wireframe coverage", line_size, wireframe::COVERAGE_FORMAT),
        }
    }

    fn target(&self, label: &str, [width, height]: [u32; 2], format: wgpu::TextureFormat) -> wgpu::TextureView {
        let texture = self.device.create_texture(&wgpu::TextureDescriptor {
            label: Some(label),
            size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::TEXTURE_BINDING,
            view_formats: &[],
        });
        texture.create_view(&Default::default())
    }

    fn buffer(&self, contents: &[u8], usage: wgpu::BufferUsages) -> wgpu::Buffer {
        // Not `create_buffer_init`, which panics if the buffer cannot be made.
        let buffer = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("mesh"),
            size: contents.len() as u64,
            usage: usage | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        self.queue.write_buffer(&buffer, 0, contents);
        buffer
    }
}

//! Host part of `mesh_resolve.wgsl`: resolves the samples to the image, and reads it back.

use bytemuck::{Pod, Zeroable};
use ghand_core::Camera;

use super::{Context, MeshError, MeshImage, MeshStyle, Targets};
use crate::pipeline::{Module, Stage};
use crate::{Gpu, RenderError, buffers, stages};

/// `ResolveUniforms` of `mesh_resolve.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct ResolveUniforms {
    /// Size of the image, pixels.
    pub size: [u32; 2],
    /// Samples per pixel along each axis.
    pub supersample: u32,
    /// Margin of pixels that were drawn around the image and are removed.
    pub margin: u32,
    /// Colour of the lines, and 1; 0 if there are none.
    pub line_color: [f32; 4],
}

/// An image on the device.
pub(super) struct Resolved {
    pixels: usize,
    /// Premultiplied colours, `vec4<f32>` for each pixel.
    pub colors: wgpu::Buffer,
    /// Depths, `f32` for each pixel.
    depths: wgpu::Buffer,
}

/// The readback buffer of the image: colours, then depths.
pub(super) struct Readback {
    pixels: usize,
    buffer: wgpu::Buffer,
}

/// Bytes of a pixel's colour and of its depth.
const COLOR_BYTES: usize = 16;
const DEPTH_BYTES: usize = 4;

/// Resolves samples to images.
#[derive(Debug)]
pub(super) struct Resolve {
    stage: Stage<stages::Resolve>,
}

impl Resolve {
    pub fn new(gpu: &Gpu) -> Resolve {
        Resolve { stage: Module::new(gpu, "mesh_resolve").stage(gpu, &[]) }
    }

    /// Encodes the resolve of the samples to an image, without the `margin` pixels around it.
    pub fn encode(
        &self,
        context: &Context,
        encoder: &mut wgpu::CommandEncoder,
        camera: &Camera,
        style: &MeshStyle,
        margin: u32,
        targets: &Targets,
    ) -> Resolved {
        let uniforms = ResolveUniforms {
            size: [camera.width, camera.height],
            supersample: style.supersample,
            margin,
            line_color: style.wireframe.map_or([0.0; 4], |w| w.color.as_vec3().extend(1.0).to_array()),
        };
        let uniforms = context.buffer(bytemuck::bytes_of(&uniforms), wgpu::BufferUsages::UNIFORM);
        let pixels = camera.width as usize * camera.height as usize;
        let output = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC;
        let colors = context.image_buffer(pixels * COLOR_BYTES, output);
        let depths = context.image_buffer(pixels * DEPTH_BYTES, output);
        let bound = self.stage.bind(
            &context.gpu,
            &stages::ResolveBindings {
                uniforms: &uniforms,
                face_colors: &targets.color,
                face_depths: &targets.face_depth,
                line_coverages: &targets.coverage,
                image: &colors,
                depths: &depths,
            },
        );
        let groups = [camera.width, camera.height].map(|edge| edge.div_ceil(8));
        bound.dispatch_grid(&mut encoder.begin_compute_pass(&Default::default()), groups);
        Resolved { pixels, colors, depths }
    }
}

impl Context {
    fn image_buffer(&self, size: usize, usage: wgpu::BufferUsages) -> wgpu::Buffer {
        self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("mesh image"),
            size: size as u64,
            usage,
            mapped_at_creation: false,
        })
    }
}

impl Resolved {
    /// Encodes the copy that is read back.
    pub fn read_back(&self, context: &Context, encoder: &mut wgpu::CommandEncoder) -> Readback {
        let colors = self.pixels * COLOR_BYTES;
        let depths = self.pixels * DEPTH_BYTES;
        let buffer = context.image_buffer(colors + depths, wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ);
        encoder.copy_buffer_to_buffer(&self.colors, 0, &buffer, 0, colors as u64);
        encoder.copy_buffer_to_buffer(&self.depths, 0, &buffer, colors as u64, depths as u64);
        Readback { pixels: self.pixels, buffer }
    }
}

impl Readback {
    /// Waits for the image.
    pub fn read(self, context: &Context, camera: &Camera) -> Result<MeshImage, MeshError> {
        let failed = |e: &dyn std::fmt::Display| RenderError::Device(format!("the image could not be read: {e}"));
        buffers::map(&context.gpu, &self.buffer)?;
        let bytes = self.buffer.get_mapped_range(..).map_err(|e| failed(&e))?;
        let (colors, depths) = bytes.split_at(self.pixels * COLOR_BYTES);
        let rgba = bytemuck::pod_collect_to_vec(colors);
        let mut depth: Vec<f32> = bytemuck::pod_collect_to_vec(depths);
        for z in &mut depth {
            if *z == 0.0 {
                *z = f32::INFINITY;
            }
        }
        Ok(MeshImage { width: camera.width, height: camera.height, rgba, depth })
    }
}

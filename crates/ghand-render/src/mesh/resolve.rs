//! Host part of `mesh_resolve.wgsl`: resolves the samples to the image, and reads it back.

use bytemuck::{Pod, Zeroable};
use ghand_core::Camera;
use glam::DVec3;

use super::{Context, MeshError, MeshImage, MeshStyle, NEAR_PLANE, Targets};
use crate::bindings::Bindings;
use crate::{RenderError, buffers, shader_sources};

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
    /// Colour of visible lines.
    pub line_color: [f32; 4],
    /// Colour of lines behind faces.
    pub hidden_color: [f32; 4],
    /// Whether there are lines.
    pub lines: u32,
    /// Near plane, metres.
    pub near: f32,
    /// Unused.
    pub padding: [u32; 2],
}

/// The readback buffer of the image: colours, then depths.
pub(super) struct Readback {
    pixels: usize,
    buffer: wgpu::Buffer,
}

/// Resolves samples to images.
#[derive(Debug)]
pub(super) struct Resolve {
    pipeline: wgpu::ComputePipeline,
    bindings: Bindings,
}

impl Resolve {
    pub fn new(device: &wgpu::Device) -> Resolve {
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("mesh resolve"),
            source: wgpu::ShaderSource::Wgsl(shader_sources::source("mesh_resolve").into()),
        });
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some("mesh resolve"),
            layout: None,
            module: &module,
            entry_point: Some("resolve"),
            compilation_options: Default::default(),
            cache: None,
        });
        Resolve { pipeline, bindings: Bindings::new("mesh_resolve", &["resolve"]) }
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
    ) -> Readback {
        let row = |color: DVec3| color.as_vec3().extend(0.0).to_array();
        let uniforms = ResolveUniforms {
            size: [camera.width, camera.height],
            supersample: style.supersample,
            margin,
            line_color: style.wireframe.map_or([0.0; 4], |w| row(w.color)),
            hidden_color: style.wireframe.and_then(|w| w.hidden).map_or([0.0; 4], row),
            lines: u32::from(style.wireframe.is_some()),
            near: NEAR_PLANE as f32,
            padding: [0; 2],
        };
        let uniforms = context.buffer(bytemuck::bytes_of(&uniforms), wgpu::BufferUsages::UNIFORM);
        let pixels = camera.width as usize * camera.height as usize;
        let make = |size: usize, usage| {
            context.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("mesh image"),
                size: size as u64,
                usage,
                mapped_at_creation: false,
            })
        };
        let output = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC;
        let (colors, depths) = (make(pixels * 16, output), make(pixels * 4, output));
        let readback = make(pixels * 20, wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ);
        let texture = wgpu::BindingResource::TextureView;
        let resources = [
            ("uniforms", uniforms.as_entire_binding()),
            ("face_colors", texture(&targets.color)),
            ("face_depths", texture(&targets.face_depth)),
            ("line_coverages", texture(&targets.coverage)),
            ("line_depths", texture(&targets.line_depth)),
            ("image", colors.as_entire_binding()),
            ("depths", depths.as_entire_binding()),
        ];
        let layout = self.pipeline.get_bind_group_layout(0);
        let bindings = self.bindings.group(&context.device, "mesh resolve", &layout, &resources);
        let mut pass = encoder.begin_compute_pass(&Default::default());
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &bindings, &[]);
        pass.dispatch_workgroups(camera.width.div_ceil(8), camera.height.div_ceil(8), 1);
        drop(pass);
        encoder.copy_buffer_to_buffer(&colors, 0, &readback, 0, pixels as u64 * 16);
        encoder.copy_buffer_to_buffer(&depths, 0, &readback, pixels as u64 * 16, pixels as u64 * 4);
        Readback { pixels, buffer: readback }
    }
}

impl Readback {
    /// Waits for the image.
    pub fn read(self, context: &Context, camera: &Camera) -> Result<MeshImage, MeshError> {
        let failed = |e: &dyn std::fmt::Display| RenderError::Device(format!("the image could not be read: {e}"));
        buffers::map(&context.gpu, &self.buffer)?;
        let bytes = self.buffer.get_mapped_range(..).map_err(|e| failed(&e))?;
        let (colors, depths) = bytes.split_at(self.pixels * 16);
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

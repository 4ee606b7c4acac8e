//! Host part of `wireframe.wgsl`: lines at k times the image's size.

use bytemuck::{Pod, Zeroable};

use super::edges::Segment;
use super::{Context, Targets, color_target};
use crate::bindings::RenderBindings;
use crate::shader_sources::Shader;
use crate::stages::{Wireframe, WireframeBindings};

/// A line in the layout of `wireframe.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct LineInstance {
    ends: [f32; 4],
    inverse_depths: [f32; 2],
    tolerance: f32,
}

/// `WireframeUniforms` of `wireframe.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct WireframeUniforms {
    /// Size of the target, samples.
    pub size: [f32; 2],
    /// Half the width of a line, samples.
    pub half_width: f32,
    /// Unused.
    pub padding: u32,
}

/// Coverage by visible lines, in a format that every device can blend.
pub(super) const COVERAGE_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::R16Float;

/// Draws lines.
#[derive(Debug)]
pub(super) struct Lines {
    pipeline: wgpu::RenderPipeline,
    bindings: RenderBindings<Wireframe>,
}

impl Lines {
    pub fn new(device: &wgpu::Device) -> Lines {
        let module = Shader::named("wireframe").module(device);
        let attributes = wgpu::vertex_attr_array![0 => Float32x4, 1 => Float32x3];
        let larger = wgpu::BlendComponent {
            src_factor: wgpu::BlendFactor::One,
            dst_factor: wgpu::BlendFactor::One,
            operation: wgpu::BlendOperation::Max,
        };
        let coverage = wgpu::ColorTargetState {
            format: COVERAGE_FORMAT,
            blend: Some(wgpu::BlendState { color: larger, alpha: larger }),
            write_mask: wgpu::ColorWrites::ALL,
        };
        let pipeline = device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some("wireframe"),
            layout: None,
            vertex: wgpu::VertexState {
                module: &module,
                entry_point: Some("line_vertex"),
                compilation_options: Default::default(),
                buffers: &[Some(wgpu::VertexBufferLayout {
                    array_stride: size_of::<LineInstance>() as u64,
                    step_mode: wgpu::VertexStepMode::Instance,
                    attributes: &attributes,
                })],
            },
            primitive: wgpu::PrimitiveState { topology: wgpu::PrimitiveTopology::TriangleStrip, ..Default::default() },
            depth_stencil: None,
            multisample: Default::default(),
            fragment: Some(wgpu::FragmentState {
                module: &module,
                entry_point: Some("line_coverage"),
                compilation_options: Default::default(),
                targets: &[Some(coverage)],
            }),
            multiview_mask: None,
            cache: None,
        });
        Lines { bindings: RenderBindings::new(&["line_vertex", "line_coverage"]), pipeline }
    }

    /// Fills `targets.coverage`; `targets.face_depth` must already be drawn. `half_width` is in samples.
    pub fn encode(
        &self,
        context: &Context,
        encoder: &mut wgpu::CommandEncoder,
        segments: &[Segment],
        half_width: f64,
        targets: &Targets,
    ) {
        let uniforms =
            WireframeUniforms { size: targets.size.map(|v| v as f32), half_width: half_width as f32, padding: 0 };
        let uniforms = context.buffer(bytemuck::bytes_of(&uniforms), wgpu::BufferUsages::UNIFORM);
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("wireframe"),
            color_attachments: &[color_target(&targets.coverage)],
            ..Default::default()
        });
        // An empty buffer cannot be made.
        if segments.is_empty() {
            return;
        }
        let instances: Vec<LineInstance> = segments.iter().map(instance).collect();
        let lines = context.buffer(bytemuck::cast_slice(&instances), wgpu::BufferUsages::VERTEX);
        let bindings = WireframeBindings { uniforms: &uniforms, face_depths: &targets.face_depth };
        let group = self.bindings.group(&context.device, &self.pipeline, &bindings);
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &group, &[]);
        pass.set_vertex_buffer(0, lines.slice(..));
        pass.draw(0..4, 0..instances.len() as u32);
    }
}

fn instance(segment: &Segment) -> LineInstance {
    let [start, end] = segment.ends.map(|p| p.as_vec2());
    LineInstance {
        ends: [start.x, start.y, end.x, end.y],
        inverse_depths: segment.inverse_depths.map(|s| s as f32),
        tolerance: segment.tolerance as f32,
    }
}

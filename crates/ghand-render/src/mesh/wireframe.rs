//! Host part of `wireframe.wgsl`: lines at k times the image's size.

use bytemuck::{Pod, Zeroable};

use super::edges::Segment;
use super::{Context, NEAR_PLANE, Targets, color_target};
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
    /// Near plane, metres.
    pub near: f32,
    /// 1 to also draw lines behind faces.
    pub hidden: u32,
    /// Unused.
    pub padding_1: u32,
    /// Unused.
    pub padding_2: u32,
    /// Unused.
    pub padding_3: u32,
}

/// Coverage by visible lines and by hidden lines, in a format that every device can blend.
pub(super) const COVERAGE_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rg16Float;
pub(super) const LINE_DEPTH_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;

/// Draws lines.
#[derive(Debug)]
pub(super) struct Lines {
    cover: wgpu::RenderPipeline,
    depth: wgpu::RenderPipeline,
    bindings: RenderBindings<Wireframe>,
}

impl Lines {
    pub fn new(device: &wgpu::Device) -> Lines {
        let module = Shader::named("wireframe").module(device);
        let attributes = wgpu::vertex_attr_array![0 => Float32x4, 1 => Float32x3];
        let pipeline = |entry_point, targets: &[Option<wgpu::ColorTargetState>], depth_stencil| {
            device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
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
                primitive: wgpu::PrimitiveState {
                    topology: wgpu::PrimitiveTopology::TriangleStrip,
                    ..Default::default()
                },
                depth_stencil,
                multisample: Default::default(),
                fragment: Some(wgpu::FragmentState {
                    module: &module,
                    entry_point: Some(entry_point),
                    compilation_options: Default::default(),
                    targets,
                }),
                multiview_mask: None,
                cache: None,
            })
        };
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
        let nearest = wgpu::DepthStencilState {
            format: LINE_DEPTH_FORMAT,
            depth_write_enabled: Some(true),
            depth_compare: Some(wgpu::CompareFunction::Greater),
            stencil: Default::default(),
            bias: Default::default(),
        };
        Lines {
            bindings: RenderBindings::new(&["line_vertex", "line_coverage", "line_depth"]),
            cover: pipeline("line_coverage", &[Some(coverage)], None),
            depth: pipeline("line_depth", &[], Some(nearest)),
        }
    }

    /// Fills `targets.coverage` and `targets.line_depth`; `targets.face_depth` must already be drawn. `half_width` is
    /// in samples.
    pub fn encode(
        &self,
        context: &Context,
        encoder: &mut wgpu::CommandEncoder,
        segments: &[Segment],
        half_width: f64,
        hidden: bool,
        targets: &Targets,
    ) {
        let uniforms = WireframeUniforms {
            size: targets.size.map(|v| v as f32),
            half_width: half_width as f32,
            near: NEAR_PLANE as f32,
            hidden: u32::from(hidden),
            ..Zeroable::zeroed()
        };
        let uniforms = context.buffer(bytemuck::bytes_of(&uniforms), wgpu::BufferUsages::UNIFORM);
        let instances: Vec<LineInstance> = segments.iter().map(instance).collect();
        // An empty buffer cannot be made.
        let lines = (!instances.is_empty())
            .then(|| context.buffer(bytemuck::cast_slice(&instances), wgpu::BufferUsages::VERTEX));
        let draw = |pass: &mut wgpu::RenderPass<'_>, pipeline: &wgpu::RenderPipeline| {
            let Some(lines) = &lines else { return };
            let bindings = WireframeBindings { uniforms: &uniforms, face_depths: &targets.face_depth };
            let group = self.bindings.group(&context.device, pipeline, &bindings);
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, &group, &[]);
            pass.set_vertex_buffer(0, lines.slice(..));
            pass.draw(0..4, 0..instances.len() as u32);
        };
        let cover = wgpu::RenderPassDescriptor {
            label: Some("wireframe"),
            color_attachments: &[color_target(&targets.coverage)],
            ..Default::default()
        };
        draw(&mut encoder.begin_render_pass(&cover), &self.cover);
        let depth = wgpu::RenderPassDescriptor {
            label: Some("wireframe depth"),
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: &targets.line_depth,
                depth_ops: Some(wgpu::Operations { load: wgpu::LoadOp::Clear(0.0), store: wgpu::StoreOp::Store }),
                stencil_ops: None,
            }),
            ..Default::default()
        };
        draw(&mut encoder.begin_render_pass(&depth), &self.depth);
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

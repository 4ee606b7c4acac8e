//! Host part of `mesh.wgsl`: the faces, at k times the image's size.

use bytemuck::{Pod, Zeroable};
use ghand_core::Camera;
use ghand_core::mesh::Texture;
use glam::{DVec2, DVec3};
use wgpu::util::DeviceExt;

use super::{Context, MAX_LIGHTS, MeshInstance, NEAR_PLANE, Shading, Surface, Targets, color_target};
use crate::bindings::RenderBindings;
use crate::shader_sources::Shader;
use crate::stages::{Mesh, MeshBindings};

/// Vertex in the layout of `mesh.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct MeshVertex {
    position_camera: [f32; 3],
    normal_world: [f32; 3],
    /// UV and 0, or a colour.
    surface: [f32; 3],
    light_visibility: f32,
}

/// `MeshUniforms` of `mesh.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct MeshUniforms {
    /// x_clip = clip_x.xy . (x, z).
    pub clip_x: [f32; 4],
    /// y_clip = clip_y.xy . (y, z).
    pub clip_y: [f32; 4],
    /// Near plane, wrap, number of lights.
    pub settings: [f32; 4],
    /// Shading: 0 unlit, 1 lit, 2 transparent; surface: 0 texture, 1 colours.
    pub modes: [u32; 4],
    /// Ambient light.
    pub ambient: [f32; 4],
    /// Unit vectors towards the lights, world axes.
    pub light_directions: [[f32; 4]; MAX_LIGHTS],
    /// Colours of the lights.
    pub light_colors: [[f32; 4]; MAX_LIGHTS],
}

pub(super) const COLOR_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba16Float;
pub(super) const SAMPLE_DEPTH_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::R32Float;
const DEPTH_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;

/// Draws faces.
#[derive(Debug)]
pub(super) struct Faces {
    pipeline: wgpu::RenderPipeline,
    bindings: RenderBindings<Mesh>,
}

impl Faces {
    pub fn new(device: &wgpu::Device) -> Faces {
        let module = Shader::named("mesh").module(device);
        let attributes = wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32x3, 2 => Float32x3, 3 => Float32];
        let target = |format| Some(wgpu::ColorTargetState { format, blend: None, write_mask: wgpu::ColorWrites::ALL });
        let pipeline = device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some("mesh"),
            layout: None,
            vertex: wgpu::VertexState {
                module: &module,
                entry_point: Some("vertex"),
                compilation_options: Default::default(),
                buffers: &[Some(wgpu::VertexBufferLayout {
                    array_stride: size_of::<MeshVertex>() as u64,
                    step_mode: wgpu::VertexStepMode::Vertex,
                    attributes: &attributes,
                })],
            },
            primitive: wgpu::PrimitiveState::default(),
            depth_stencil: Some(wgpu::DepthStencilState {
                format: DEPTH_FORMAT,
                depth_write_enabled: Some(true),
                depth_compare: Some(wgpu::CompareFunction::Greater),
                stencil: Default::default(),
                bias: Default::default(),
            }),
            multisample: Default::default(),
            fragment: Some(wgpu::FragmentState {
                module: &module,
                entry_point: Some("fragment"),
                compilation_options: Default::default(),
                targets: &[target(COLOR_FORMAT), target(SAMPLE_DEPTH_FORMAT)],
            }),
            multiview_mask: None,
            cache: None,
        });
        Faces { pipeline, bindings: RenderBindings::new(&["vertex", "fragment"]) }
    }

    /// Fills `targets.color` and `targets.face_depth`. `camera` is the camera of the targets.
    pub fn encode(
        &self,
        context: &Context,
        encoder: &mut wgpu::CommandEncoder,
        mesh: &MeshInstance,
        camera: &Camera,
        shading: &Shading,
        targets: &Targets,
    ) {
        let uniforms = uniforms_of(camera, &mesh.surface, shading);
        let uniforms = context.buffer(bytemuck::bytes_of(&uniforms), wgpu::BufferUsages::UNIFORM);
        let texture = match mesh.surface {
            Surface::Texture { texture, .. } => context.upload_texture(texture),
            // Bound because the pipeline requires a texture, but not read.
            Surface::VertexColors(_) | Surface::Color(_) => context.upload_texture(&Texture::plain([0; 3])),
        };
        let bindings = MeshBindings { uniforms: &uniforms, color_texture: &texture };
        let group = self.bindings.group(&context.device, &self.pipeline, &bindings);
        let depth = context.target("mesh depth", targets.size, DEPTH_FORMAT);
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("mesh"),
            color_attachments: &[color_target(&targets.color), color_target(&targets.face_depth)],
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: &depth,
                depth_ops: Some(wgpu::Operations { load: wgpu::LoadOp::Clear(0.0), store: wgpu::StoreOp::Discard }),
                stencil_ops: None,
            }),
            ..Default::default()
        });
        if mesh.triangles.is_empty() {
            return;
        }
        let vertices = context.buffer(bytemuck::cast_slice(&vertices(mesh, camera)), wgpu::BufferUsages::VERTEX);
        let indices = context.buffer(bytemuck::cast_slice(mesh.triangles), wgpu::BufferUsages::INDEX);
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &group, &[]);
        pass.set_vertex_buffer(0, vertices.slice(..));
        pass.set_index_buffer(indices.slice(..), wgpu::IndexFormat::Uint32);
        pass.draw_indexed(0..mesh.triangles.len() as u32 * 3, 0, 0..1);
    }
}

impl Context {
    fn upload_texture(&self, texture: &Texture) -> wgpu::TextureView {
        let texels: Vec<[u8; 4]> = texture.rgb.iter().map(|&[r, g, b]| [r, g, b, 255]).collect();
        let descriptor = wgpu::TextureDescriptor {
            label: Some("mesh texture"),
            size: wgpu::Extent3d { width: texture.width, height: texture.height, depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: wgpu::TextureFormat::Rgba8Unorm,
            usage: wgpu::TextureUsages::TEXTURE_BINDING,
            view_formats: &[],
        };
        let data = bytemuck::cast_slice(&texels);
        let texture = self.device.create_texture_with_data(&self.queue, &descriptor, Default::default(), data);
        texture.create_view(&Default::default())
    }
}

fn vertices(mesh: &MeshInstance, camera: &Camera) -> Vec<MeshVertex> {
    // In f64, to keep the precision of scenes far from the world's origin.
    (mesh.positions.iter().zip(mesh.normals))
        .enumerate()
        .map(|(i, (p, n))| MeshVertex {
            position_camera: camera.camera_from_world(*p).as_vec3().to_array(),
            normal_world: n.as_vec3().to_array(),
            surface: mesh.surface.at_vertex(i).as_vec3().to_array(),
            light_visibility: mesh.light_visibility.map_or(1.0, |e| e[i] as f32),
        })
        .collect()
}

impl Surface<'_> {
    /// The value interpolated between vertices: UV and 0, or a colour.
    pub(crate) fn at_vertex(&self, i: usize) -> DVec3 {
        match self {
            Surface::Texture { uvs, .. } => uvs[i].extend(0.0),
            Surface::VertexColors(colors) => colors[i],
            Surface::Color(color) => *color,
        }
    }
}

fn uniforms_of(camera: &Camera, surface: &Surface, shading: &Shading) -> MeshUniforms {
    let size = DVec2::new(f64::from(camera.width), f64::from(camera.height));
    // Pixel x is fx X/Z + cx, and normalised device x is 2 x/W - 1; device y points up.
    let scale = 2.0 * camera.focal / size;
    let shift = 2.0 * camera.principal / size - 1.0;
    let row = |v: DVec3| [v.x as f32, v.y as f32, v.z as f32, 0.0];
    let shading_mode = match shading {
        Shading::Unlit => 0,
        Shading::Lit { .. } => 1,
        Shading::Transparent => 2,
    };
    let surface_mode = match surface {
        Surface::Texture { .. } => 0,
        Surface::VertexColors(_) | Surface::Color(_) => 1,
    };
    let mut uniforms = MeshUniforms {
        clip_x: [scale.x as f32, shift.x as f32, 0.0, 0.0],
        clip_y: [-scale.y as f32, -shift.y as f32, 0.0, 0.0],
        settings: [NEAR_PLANE as f32, 0.0, 0.0, 0.0],
        modes: [shading_mode, surface_mode, 0, 0],
        ..Zeroable::zeroed()
    };
    if let Shading::Lit { ambient, lights, wrap } = shading {
        uniforms.settings = [NEAR_PLANE as f32, *wrap as f32, lights.len() as f32, 0.0];
        uniforms.ambient = row(*ambient);
        for (i, light) in lights.iter().enumerate().take(MAX_LIGHTS) {
            uniforms.light_directions[i] = row(light.direction.normalize_or_zero());
            uniforms.light_colors[i] = row(light.color);
        }
    }
    uniforms
}

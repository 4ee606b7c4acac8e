//! Draws an avatar into the render pass of another program, which has its own device, its own meshes and its own depth:
//! here a board, through which the hand reaches. Writes `pass.png`.
//!
//!     cargo run --example draw_into_a_pass [AVATAR.ghand]

use std::path::Path;

use anyhow::Context;
use ghand::prelude::*;
use ghand::render::buffers;
use ghand::render::splat::SplatOptions;
use ghand::render::texture_pass::{DepthTarget, Target, TexturePass};
use glam::{DMat3, DMat4, DVec3};

const SIZE: [u32; 2] = [512, 512];
const COLOR: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8UnormSrgb;
const DEPTH: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;
/// Near and far plane, metres.
const NEAR: f32 = 0.05;
const FAR: f32 = 5.0;

/// The program's own mesh: two triangles in linear colours.
const BOARD: &str = "
@group(0) @binding(0) var<uniform> clip_from_world: mat4x4<f32>;
@vertex fn board_vertex(@location(0) position: vec3<f32>) -> @builtin(position) vec4<f32> {
    return clip_from_world * vec4(position, 1.0);
}
@fragment fn board_fragment() -> @location(0) vec4<f32> { return vec4(0.02, 0.1, 0.3, 1.0); }";

fn main() -> anyhow::Result<()> {
    let avatar = match std::env::args().nth(1) {
        Some(path) => Avatar::load(Path::new(&path))?,
        None => Avatar::untrained(&builtin_hand(Side::Right)?, &AvatarConfig::default(), [0.8, 0.6, 0.5], 0)?,
    };
    let pose = named_pose("spread", &avatar.model).context("there is no pose `spread`")?;

    // The program's device. Subgroups and more workgroup memory make splatting faster, where there are any.
    let instance = ghand::render::device::instance();
    let adapter = pollster::block_on(instance.request_adapter(&wgpu::RequestAdapterOptions::default()))?;
    let subgroups = adapter.features() & wgpu::Features::SUBGROUP;
    let memory = adapter.limits().max_compute_workgroup_storage_size.min(32_768);
    let (device, queue) = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor {
        required_features: subgroups,
        required_limits: wgpu::Limits { max_compute_workgroup_storage_size: memory, ..wgpu::Limits::default() },
        ..Default::default()
    }))?;

    // ghand on that device: a scene with depths, and the pass that draws it.
    let gpu = Gpu::from_parts(adapter, device.clone(), queue.clone())?;
    let options = SplatOptions { purpose: Purpose::Images, depth: true, ..SplatOptions::default() };
    let mut scene = Scene::with_options(&gpu, &[&avatar], 1, SIZE, options)?;
    let depth = DepthTarget::near_to_far(DEPTH, NEAR, FAR);
    let texture_pass = TexturePass::new(&gpu, Target { depth: Some(depth), ..Target::color(COLOR) })?;
    let hand = texture_pass.layer(&gpu, scene.splatter())?;

    // The program's camera, by its matrices. The avatar stands where the program wants it.
    let center = avatar.model.vertices.iter().sum::<DVec3>() / avatar.model.vertices.len() as f64;
    let view = glam::dcamera::rh::view::look_at_mat4(DVec3::new(0.15, 0.25, 0.4), DVec3::ZERO, DVec3::Y);
    let projection = glam::dcamera::rh::proj::directx::perspective(0.7, 1.0, NEAR.into(), FAR.into());
    let camera = Camera::from_view_and_projection(&view, &projection, SIZE[0], SIZE[1]);
    scene.set_placement(0, DMat3::IDENTITY, -center)?;
    scene.set_pose(&gpu, 0, 0, &pose)?;
    scene.set_view(&gpu, &camera, [0.0; 3])?;
    texture_pass.set_place(&gpu, &hand, [0; 2], SIZE, [0.0; 3]);

    let texture = |format, usage| {
        device.create_texture(&wgpu::TextureDescriptor {
            label: None,
            size: wgpu::Extent3d { width: SIZE[0], height: SIZE[1], depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT | usage,
            view_formats: &[],
        })
    };
    let color = texture(COLOR, wgpu::TextureUsages::COPY_SRC);
    let (color_view, depth_view) = (
        color.create_view(&Default::default()),
        texture(DEPTH, wgpu::TextureUsages::empty()).create_view(&Default::default()),
    );
    let board = Board::new(&device, &queue, &(projection * view));

    // Frames: nothing waits. A frame whose buffers were too small lacks splats; they have grown two frames later.
    for _ in 0..3 {
        let mut encoder = device.create_command_encoder(&Default::default());
        scene.encode_growing(&gpu, &mut encoder)?;
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("the program's pass"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: &color_view,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations { load: wgpu::LoadOp::Clear(wgpu::Color::WHITE), store: wgpu::StoreOp::Store },
            })],
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: &depth_view,
                depth_ops: Some(wgpu::Operations { load: wgpu::LoadOp::Clear(1.0), store: wgpu::StoreOp::Store }),
                stencil_ops: None,
            }),
            ..Default::default()
        });
        board.draw(&mut pass);
        texture_pass.draw(&mut pass, &hand);
        drop(pass);
        queue.submit([encoder.finish()]);
        device.poll(wgpu::PollType::wait_indefinitely())?;
    }
    save(&gpu, &color)?;
    println!("pass.png: {} Gaussians and a board, on the tier {}", avatar.template.len(), gpu.tier.name());
    Ok(())
}

/// The mesh of the program.
struct Board {
    pipeline: wgpu::RenderPipeline,
    group: wgpu::BindGroup,
    vertices: wgpu::Buffer,
}

impl Board {
    fn new(device: &wgpu::Device, queue: &wgpu::Queue, clip_from_world: &DMat4) -> Board {
        let source = wgpu::ShaderSource::Wgsl(BOARD.into());
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor { label: None, source });
        let buffer = |bytes: &[u8], usage| {
            let usage = usage | wgpu::BufferUsages::COPY_DST;
            let size = bytes.len() as u64;
            let descriptor = wgpu::BufferDescriptor { label: None, size, usage, mapped_at_creation: false };
            let buffer = device.create_buffer(&descriptor);
            queue.write_buffer(&buffer, 0, bytes);
            buffer
        };
        // A board across the fingers, 30 cm wide and 10 cm deep.
        let corners = [[-0.15f32, 0.0, -0.05], [0.15, 0.0, -0.05], [0.15, 0.0, 0.05], [-0.15, 0.0, 0.05]];
        let vertices =
            buffer(bytemuck::cast_slice(&[0, 1, 2, 0, 2, 3].map(|i| corners[i])), wgpu::BufferUsages::VERTEX);
        let matrix = clip_from_world.as_mat4().to_cols_array();
        let matrix = buffer(bytemuck::cast_slice(&matrix), wgpu::BufferUsages::UNIFORM);
        let attributes = wgpu::vertex_attr_array![0 => Float32x3];
        let pipeline = device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some("board"),
            layout: None,
            vertex: wgpu::VertexState {
                module: &module,
                entry_point: Some("board_vertex"),
                compilation_options: Default::default(),
                buffers: &[Some(wgpu::VertexBufferLayout {
                    array_stride: 12,
                    step_mode: wgpu::VertexStepMode::Vertex,
                    attributes: &attributes,
                })],
            },
            primitive: Default::default(),
            depth_stencil: Some(wgpu::DepthStencilState {
                format: DEPTH,
                depth_write_enabled: Some(true),
                depth_compare: Some(wgpu::CompareFunction::Less),
                stencil: Default::default(),
                bias: Default::default(),
            }),
            multisample: Default::default(),
            fragment: Some(wgpu::FragmentState {
                module: &module,
                entry_point: Some("board_fragment"),
                compilation_options: Default::default(),
                targets: &[Some(COLOR.into())],
            }),
            multiview_mask: None,
            cache: None,
        });
        let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &pipeline.get_bind_group_layout(0),
            entries: &[wgpu::BindGroupEntry { binding: 0, resource: matrix.as_entire_binding() }],
        });
        Board { pipeline, group, vertices }
    }

    fn draw(&self, pass: &mut wgpu::RenderPass<'_>) {
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &self.group, &[]);
        pass.set_vertex_buffer(0, self.vertices.slice(..));
        pass.draw(0..6, 0..1);
    }
}

fn save(gpu: &Gpu, color: &wgpu::Texture) -> anyhow::Result<()> {
    let words = (SIZE[0] * SIZE[1]) as usize;
    let rows = buffers::zeroed(gpu, "rows", words);
    let mut encoder = gpu.device.create_command_encoder(&Default::default());
    let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(4 * SIZE[0]), rows_per_image: None };
    let to = wgpu::TexelCopyBufferInfo { buffer: &rows, layout };
    encoder.copy_texture_to_buffer(color.as_image_copy(), to, color.size());
    gpu.queue.submit([encoder.finish()]);
    let bytes: Vec<u8> = buffers::read(gpu, &rows, 4 * words)?;
    let picture = image::RgbaImage::from_raw(SIZE[0], SIZE[1], bytes).context("the picture has another size")?;
    Ok(picture.save("pass.png")?)
}

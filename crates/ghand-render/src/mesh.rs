//! Offscreen rendering of textured, lit triangle meshes with depth.
//!
//! Draws the truth of synthetic captures and the mesh layers of viewers. The CPU twin is [`crate::reference::mesh`].

use bytemuck::{Pod, Zeroable};
use ghand_core::Camera;
use ghand_core::mesh::Texture;
use glam::{DVec2, DVec3};
use wgpu::util::DeviceExt;

use crate::device::{Gpu, RenderError};
use crate::shader_sources;

/// Triangles nearer to the camera than this are cut, metres (the near plane of the splatter).
pub const NEAR_PLANE: f64 = 0.01;
/// The most lights of one [`Shading::Lit`].
pub const MAX_LIGHTS: usize = 4;
/// The largest supersampling factor.
pub const MAX_SUPERSAMPLE: u32 = 4;

/// Why a mesh could not be rendered.
#[derive(Debug, thiserror::Error)]
pub enum MeshError {
    /// Part of the input is unusable.
    #[error("mesh: {field}: {problem}")]
    Invalid {
        /// The part that is wrong.
        field: &'static str,
        /// What is wrong and what to do about it.
        problem: String,
    },
    /// The device failed while it drew or while the image was read back, or was lost.
    #[error("mesh: {0}")]
    Device(#[from] RenderError),
}

/// A posed mesh with its texture, borrowed for one image.
#[derive(Debug, Clone, Copy)]
pub struct MeshInstance<'a> {
    /// Vertex positions, metres, world axes.
    pub positions: &'a [DVec3],
    /// Vertex normals, world axes; any length, normalised per pixel after interpolation.
    pub normals: &'a [DVec3],
    /// UV of each vertex, (0, 0) at the corner of the first texel; beyond `[0, 1]` the border texels repeat.
    pub uvs: &'a [DVec2],
    /// The part of the light that arrives at each vertex past other geometry, `[0, 1]`; `None` for all of it. Unlit shading
    /// ignores it.
    pub exposure: Option<&'a [f64]>,
    /// Triangles as vertex indices; both sides are drawn.
    pub triangles: &'a [[u32; 3]],
    /// Colours.
    pub texture: &'a Texture,
}

/// A directional light fixed in the world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Light {
    /// Direction from the scene towards the light, world axes; any length but zero.
    pub direction: DVec3,
    /// What it adds to the texture's factor where it falls in squarely, linear in display values.
    pub color: DVec3,
}

/// How texture colours become pixel colours.
#[derive(Debug, Clone, PartialEq)]
pub enum Shading {
    /// The texture as it is.
    Unlit,
    /// Lambert: texture x exposure x (ambient + sum of lights), clamped to 1.
    Lit {
        /// Light from everywhere.
        ambient: DVec3,
        /// At most [`MAX_LIGHTS`] lights.
        lights: Vec<Light>,
        /// Softness of the terminator, in `[0, 1]`: the cosine c of a light counts as max(0, (c + wrap) / (1 + wrap)). Zero is
        /// Lambert; skin, which scatters light below its surface, looks right near 0.3.
        wrap: f64,
    },
}

/// How to draw a mesh. The background is transparent.
#[derive(Debug, Clone, PartialEq)]
pub struct MeshStyle {
    /// Samples per pixel along each axis, 1 to [`MAX_SUPERSAMPLE`].
    pub supersample: u32,
    /// Colours.
    pub shading: Shading,
}

/// A rendered mesh.
#[derive(Debug, Clone, PartialEq)]
pub struct MeshImage {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Row-major pixels, premultiplied: (colour x coverage, coverage), each in `[0, 1]`.
    pub rgba: Vec<[f32; 4]>,
    /// Smallest camera z (metres) of each pixel's covered samples; infinity where the pixel is empty.
    pub depth: Vec<f32>,
}

impl MeshImage {
    /// Straight-alpha 8-bit pixels: colour of the covered part (black where there is none) and coverage.
    pub fn to_straight_rgba8(&self) -> Vec<[u8; 4]> {
        let to_byte = |v: f32| (v * 255.0).round().clamp(0.0, 255.0) as u8;
        self.rgba
            .iter()
            .map(|&[r, g, b, a]| {
                let gain = if a > 0.0 { 1.0 / a } else { 0.0 };
                [to_byte(r * gain), to_byte(g * gain), to_byte(b * gain), to_byte(a)]
            })
            .collect()
    }
}

/// Vertex as `mesh.wgsl` reads it.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct MeshVertex {
    position_camera: [f32; 3],
    normal_world: [f32; 3],
    uv: [f32; 2],
    exposure: f32,
}

/// `MeshUniforms` of `mesh.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct MeshUniforms {
    /// x_clip = clip_x.xy . (x, z).
    pub clip_x: [f32; 4],
    /// y_clip = clip_y.xy . (y, z).
    pub clip_y: [f32; 4],
    /// Near plane, wrap, number of lights, 1 for lit.
    pub settings: [f32; 4],
    /// Ambient light.
    pub ambient: [f32; 4],
    /// Unit vectors towards the lights, world axes.
    pub light_directions: [[f32; 4]; MAX_LIGHTS],
    /// Colours of the lights.
    pub light_colors: [[f32; 4]; MAX_LIGHTS],
}

/// `ResolveUniforms` of `mesh.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct ResolveUniforms {
    /// Size of the image, pixels.
    pub size: [u32; 2],
    /// Samples per pixel along each axis.
    pub supersample: u32,
    /// Unused.
    pub padding: u32,
}

/// Checks what both the GPU and its twin rely on.
///
/// # Errors
/// [`MeshError::Invalid`] names the first field that is unusable.
pub(crate) fn check_input(mesh: &MeshInstance, camera: &Camera, style: &MeshStyle) -> Result<(), MeshError> {
    let fail = |field, problem| Err(MeshError::Invalid { field, problem });
    let n = mesh.positions.len();
    if mesh.normals.len() != n || mesh.uvs.len() != n {
        let counts = format!("{} normals and {} uvs", mesh.normals.len(), mesh.uvs.len());
        return fail("vertices", format!("{n} positions but {counts}; give one of each a vertex"));
    }
    if let Some(exposure) = mesh.exposure.filter(|e| e.len() != n) {
        return fail("exposure", format!("{} numbers for {n} vertices; give one each", exposure.len()));
    }
    if let Some(i) = mesh.positions.iter().position(|p| !p.is_finite()) {
        return fail("positions", format!("vertex {i} is not finite"));
    }
    if mesh.triangles.iter().flatten().any(|&i| i as usize >= n) {
        return fail("triangles", format!("an index is beyond the {n} vertices"));
    }
    let t = mesh.texture;
    if t.width == 0 || t.height == 0 || t.rgb.len() != t.width as usize * t.height as usize {
        return fail("texture", format!("{} x {} does not fit its {} texels", t.width, t.height, t.rgb.len()));
    }
    if camera.width == 0 || camera.height == 0 {
        return fail("camera", format!("the image is {} x {}; both must be positive", camera.width, camera.height));
    }
    if !(1..=MAX_SUPERSAMPLE).contains(&style.supersample) {
        return fail("supersample", format!("{} is outside 1 to {MAX_SUPERSAMPLE}", style.supersample));
    }
    if let Shading::Lit { lights, .. } = &style.shading {
        if lights.len() > MAX_LIGHTS {
            return fail("lights", format!("{} lights; at most {MAX_LIGHTS} are drawn", lights.len()));
        }
        if lights.iter().any(|l| l.direction.try_normalize().is_none()) {
            return fail("lights", "a direction has no length".into());
        }
    }
    Ok(())
}

/// Draws meshes on one device.
#[derive(Debug)]
pub struct MeshRenderer {
    gpu: Gpu,
    device: wgpu::Device,
    queue: wgpu::Queue,
    draw: wgpu::RenderPipeline,
    resolve: wgpu::ComputePipeline,
}

const COLOR_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba16Float;
const SAMPLE_DEPTH_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::R32Float;
const DEPTH_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;

impl MeshRenderer {
    /// Builds the pipelines.
    ///
    /// # Errors
    /// [`MeshError::Device`] when the device refuses the shaders.
    pub fn new(gpu: &Gpu) -> Result<MeshRenderer, MeshError> {
        Ok(gpu.scoped("the mesh rasteriser", || MeshRenderer::make(gpu))?)
    }

    fn make(gpu: &Gpu) -> MeshRenderer {
        let device = gpu.device.clone();
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("mesh"),
            source: wgpu::ShaderSource::Wgsl(shader_sources::mesh().into()),
        });
        let attributes = wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32x3, 2 => Float32x2, 3 => Float32];
        let target = |format| Some(wgpu::ColorTargetState { format, blend: None, write_mask: wgpu::ColorWrites::ALL });
        let draw = device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
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
        let resolve = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some("mesh resolve"),
            layout: None,
            module: &module,
            entry_point: Some("resolve"),
            compilation_options: Default::default(),
            cache: None,
        });
        MeshRenderer { gpu: gpu.clone(), device, queue: gpu.queue.clone(), draw, resolve }
    }

    /// Draws one image and waits for it.
    ///
    /// # Errors
    /// [`MeshError::Invalid`] when the input is unusable or the supersampled image is larger than the device's
    /// textures; [`MeshError::Device`] when the device fails.
    pub fn render(&self, mesh: &MeshInstance, camera: &Camera, style: &MeshStyle) -> Result<MeshImage, MeshError> {
        check_input(mesh, camera, style)?;
        let k = style.supersample;
        let largest = self.device.limits().max_texture_dimension_2d;
        if camera.width.max(camera.height) > largest / k || mesh.texture.width.max(mesh.texture.height) > largest {
            let problem = format!("image x {k} or texture is larger than the {largest} pixels that this device draws");
            return Err(MeshError::Invalid { field: "size", problem });
        }

        let what = format!(
            "a mesh of {} triangles in {} x {} pixels, {k} x {k} samples each",
            mesh.triangles.len(),
            camera.width,
            camera.height
        );
        let (pixels, readback) = self.gpu.scoped(&what, || {
            let color = self.target(camera, k, COLOR_FORMAT);
            let depth = self.target(camera, k, SAMPLE_DEPTH_FORMAT);
            let mut encoder = self.device.create_command_encoder(&Default::default());
            self.encode_draw(&mut encoder, mesh, camera, style, &color, &depth);
            let (pixels, readback) = self.encode_resolve(&mut encoder, camera, k, &color, &depth);
            self.queue.submit([encoder.finish()]);
            (pixels, readback)
        })?;
        self.read_image(camera, pixels, &readback)
    }

    fn target(&self, camera: &Camera, k: u32, format: wgpu::TextureFormat) -> wgpu::TextureView {
        let texture = self.device.create_texture(&wgpu::TextureDescriptor {
            label: Some("mesh target"),
            size: wgpu::Extent3d { width: camera.width * k, height: camera.height * k, depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::TEXTURE_BINDING,
            view_formats: &[],
        });
        texture.create_view(&Default::default())
    }

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

    fn buffer(&self, contents: &[u8], usage: wgpu::BufferUsages) -> wgpu::Buffer {
        // Not `create_buffer_init`: that panics where the buffer cannot be made.
        let buffer = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("mesh"),
            size: contents.len() as u64,
            usage: usage | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        self.queue.write_buffer(&buffer, 0, contents);
        buffer
    }

    fn encode_draw(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        mesh: &MeshInstance,
        camera: &Camera,
        style: &MeshStyle,
        color: &wgpu::TextureView,
        sample_depth: &wgpu::TextureView,
    ) {
        let uniforms = self.buffer(bytemuck::bytes_of(&uniforms_of(camera, style)), wgpu::BufferUsages::UNIFORM);
        let texture = self.upload_texture(mesh.texture);
        let bindings = self.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("mesh"),
            layout: &self.draw.get_bind_group_layout(0),
            entries: &[
                wgpu::BindGroupEntry { binding: 0, resource: uniforms.as_entire_binding() },
                wgpu::BindGroupEntry { binding: 1, resource: wgpu::BindingResource::TextureView(&texture) },
            ],
        });
        // To camera axes in f64: scenes far from the world's origin keep their precision.
        let vertices: Vec<MeshVertex> = (mesh.positions.iter().zip(mesh.normals).zip(mesh.uvs))
            .enumerate()
            .map(|(i, ((p, n), uv))| MeshVertex {
                position_camera: camera.camera_from_world(*p).as_vec3().to_array(),
                normal_world: n.as_vec3().to_array(),
                uv: uv.as_vec2().to_array(),
                exposure: mesh.exposure.map_or(1.0, |e| e[i] as f32),
            })
            .collect();
        let depth = self.target(camera, style.supersample, DEPTH_FORMAT);
        let attachment = |view| {
            Some(wgpu::RenderPassColorAttachment {
                view,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations {
                    load: wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT),
                    store: wgpu::StoreOp::Store,
                },
            })
        };
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("mesh"),
            color_attachments: &[attachment(color), attachment(sample_depth)],
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
        let vertices = self.buffer(bytemuck::cast_slice(&vertices), wgpu::BufferUsages::VERTEX);
        let indices = self.buffer(bytemuck::cast_slice(mesh.triangles), wgpu::BufferUsages::INDEX);
        pass.set_pipeline(&self.draw);
        pass.set_bind_group(0, &bindings, &[]);
        pass.set_vertex_buffer(0, vertices.slice(..));
        pass.set_index_buffer(indices.slice(..), wgpu::IndexFormat::Uint32);
        pass.draw_indexed(0..mesh.triangles.len() as u32 * 3, 0, 0..1);
    }

    /// Returns the number of pixels and the buffer that will hold their colours, then their depths.
    fn encode_resolve(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        camera: &Camera,
        supersample: u32,
        color: &wgpu::TextureView,
        depth: &wgpu::TextureView,
    ) -> (usize, wgpu::Buffer) {
        let uniforms = ResolveUniforms { size: [camera.width, camera.height], supersample, padding: 0 };
        let uniforms = self.buffer(bytemuck::bytes_of(&uniforms), wgpu::BufferUsages::UNIFORM);
        let pixels = camera.width as usize * camera.height as usize;
        let make = |size: usize, usage| {
            self.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("mesh image"),
                size: size as u64,
                usage,
                mapped_at_creation: false,
            })
        };
        let output = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC;
        let (colors, depths) = (make(pixels * 16, output), make(pixels * 4, output));
        let readback = make(pixels * 20, wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ);
        let bindings = self.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("mesh resolve"),
            layout: &self.resolve.get_bind_group_layout(0),
            entries: &[
                wgpu::BindGroupEntry { binding: 0, resource: uniforms.as_entire_binding() },
                wgpu::BindGroupEntry { binding: 1, resource: wgpu::BindingResource::TextureView(color) },
                wgpu::BindGroupEntry { binding: 2, resource: wgpu::BindingResource::TextureView(depth) },
                wgpu::BindGroupEntry { binding: 3, resource: colors.as_entire_binding() },
                wgpu::BindGroupEntry { binding: 4, resource: depths.as_entire_binding() },
            ],
        });
        let mut pass = encoder.begin_compute_pass(&Default::default());
        pass.set_pipeline(&self.resolve);
        pass.set_bind_group(0, &bindings, &[]);
        pass.dispatch_workgroups(camera.width.div_ceil(8), camera.height.div_ceil(8), 1);
        drop(pass);
        encoder.copy_buffer_to_buffer(&colors, 0, &readback, 0, pixels as u64 * 16);
        encoder.copy_buffer_to_buffer(&depths, 0, &readback, pixels as u64 * 16, pixels as u64 * 4);
        (pixels, readback)
    }

    fn read_image(&self, camera: &Camera, pixels: usize, readback: &wgpu::Buffer) -> Result<MeshImage, MeshError> {
        let failed = |e: &dyn std::fmt::Display| RenderError::Device(format!("the image could not be read: {e}"));
        let (sender, receiver) = std::sync::mpsc::channel();
        readback.map_async(wgpu::MapMode::Read, .., move |result| {
            // The receiver is gone only if waiting failed, which is reported there.
            let _ = sender.send(result);
        });
        self.gpu.wait()?;
        receiver.try_recv().map_err(|e| failed(&e))?.map_err(|e| failed(&e))?;
        let bytes = readback.get_mapped_range(..).map_err(|e| failed(&e))?;
        let (colors, depths) = bytes.split_at(pixels * 16);
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

fn uniforms_of(camera: &Camera, style: &MeshStyle) -> MeshUniforms {
    let size = DVec2::new(f64::from(camera.width), f64::from(camera.height));
    // Pixel x is fx X/Z + cx, and normalised device x is 2 x/W - 1; device y points up.
    let scale = 2.0 * camera.focal / size;
    let shift = 2.0 * camera.principal / size - 1.0;
    let row = |v: DVec3| [v.x as f32, v.y as f32, v.z as f32, 0.0];
    let mut uniforms = MeshUniforms {
        clip_x: [scale.x as f32, shift.x as f32, 0.0, 0.0],
        clip_y: [-scale.y as f32, -shift.y as f32, 0.0, 0.0],
        settings: [NEAR_PLANE as f32, 0.0, 0.0, 0.0],
        ..Zeroable::zeroed()
    };
    if let Shading::Lit { ambient, lights, wrap } = &style.shading {
        uniforms.settings = [NEAR_PLANE as f32, *wrap as f32, lights.len() as f32, 1.0];
        uniforms.ambient = row(*ambient);
        for (i, light) in lights.iter().enumerate().take(MAX_LIGHTS) {
            uniforms.light_directions[i] = row(light.direction.normalize_or_zero());
            uniforms.light_colors[i] = row(light.color);
        }
    }
    uniforms
}

//! Avatars in the render pass of another program, on its device.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use ghand_avatar::{AvatarConfig, Scene};
use ghand_core::{Camera, Pose};
use ghand_render::splat::{Purpose, SplatOptions};
use ghand_render::texture_pass::{DepthTarget, Target, TexturePass};
use ghand_render::{DeviceError, Gpu, buffers};
use glam::{DMat3, DVec3};

use crate::common::{JOINTS, random_avatar};

const SIZE: [u32; 2] = [64, 48];
const COLOR: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;
const DEPTH: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;

/// Another program: its device, and the errors that its own handler has got.
struct Host {
    adapter: wgpu::Adapter,
    device: wgpu::Device,
    queue: wgpu::Queue,
    errors: Arc<AtomicUsize>,
}

impl Host {
    fn new(features: wgpu::Features, limits: wgpu::Limits) -> Host {
        let instance = ghand_render::device::instance();
        let options = wgpu::RequestAdapterOptions { force_fallback_adapter: true, ..Default::default() };
        let adapter = pollster::block_on(instance.request_adapter(&options))
            .or_else(|_| pollster::block_on(instance.request_adapter(&wgpu::RequestAdapterOptions::default())))
            .unwrap();
        let required_features = features & adapter.features();
        let descriptor = wgpu::DeviceDescriptor { required_features, required_limits: limits, ..Default::default() };
        let (device, queue) = pollster::block_on(adapter.request_device(&descriptor)).unwrap();
        let errors = Arc::new(AtomicUsize::new(0));
        let counted = errors.clone();
        device.on_uncaptured_error(Arc::new(move |_| {
            counted.fetch_add(1, Ordering::Relaxed);
        }));
        Host { adapter, device, queue, errors }
    }

    fn gpu(&self) -> Result<Gpu, DeviceError> {
        Gpu::from_parts(self.adapter.clone(), self.device.clone(), self.queue.clone())
    }

    /// The pixels of a pass without depth that is replaced by the scene's image over a background.
    fn replaced(
        &self,
        gpu: &Gpu,
        scene: &Scene,
        pass: &TexturePass,
        format: wgpu::TextureFormat,
        background: [f32; 3],
    ) -> Vec<[u8; 4]> {
        let layer = pass.layer(gpu, scene.splatter()).unwrap();
        pass.set_place(gpu, &layer, [0; 2], SIZE, background);
        let color = self.texture(format);
        let view = color.create_view(&Default::default());
        let mut encoder = self.device.create_command_encoder(&Default::default());
        let mut render = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: None,
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: &view,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations { load: wgpu::LoadOp::Clear(wgpu::Color::BLACK), store: wgpu::StoreOp::Store },
            })],
            ..Default::default()
        });
        pass.draw(&mut render, &layer);
        drop(render);
        self.read(gpu, encoder, &color)
    }

    fn texture(&self, format: wgpu::TextureFormat) -> wgpu::Texture {
        self.device.create_texture(&wgpu::TextureDescriptor {
            label: None,
            size: wgpu::Extent3d { width: SIZE[0], height: SIZE[1], depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
            view_formats: &[],
        })
    }

    /// Submits the commands, and reads the texture that they draw to.
    fn read(&self, gpu: &Gpu, mut encoder: wgpu::CommandEncoder, color: &wgpu::Texture) -> Vec<[u8; 4]> {
        let count = (SIZE[0] * SIZE[1]) as usize;
        let rows = buffers::zeroed(gpu, "rows", count);
        let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(4 * SIZE[0]), rows_per_image: None };
        let to = wgpu::TexelCopyBufferInfo { buffer: &rows, layout };
        encoder.copy_texture_to_buffer(color.as_image_copy(), to, color.size());
        self.queue.submit([encoder.finish()]);
        buffers::read(gpu, &rows, count).unwrap()
    }

    /// The pixels of a pass that clears depth to that of a wall at `wall` metres and colour to grey, then draws the scene.
    fn picture(&self, gpu: &Gpu, scene: &mut Scene, pass: &TexturePass, wall: f32, depth: DepthTarget) -> Vec<[u8; 4]> {
        let layer = pass.layer(gpu, scene.splatter()).unwrap();
        pass.set_place(gpu, &layer, [0; 2], SIZE, [0.0; 3]);
        let color = self.texture(COLOR);
        let deep = self.texture(DEPTH);
        let [color_view, depth_view] = [&color, &deep].map(|t| t.create_view(&Default::default()));
        let mut encoder = self.device.create_command_encoder(&Default::default());
        scene.encode_growing(gpu, &mut encoder).unwrap();
        let grey = wgpu::Color { r: 0.5, g: 0.5, b: 0.5, a: 1.0 };
        let cleared = depth.depth_from_z[0] + depth.depth_from_z[1] / wall;
        let mut render = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: None,
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: &color_view,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations { load: wgpu::LoadOp::Clear(grey), store: wgpu::StoreOp::Store },
            })],
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: &depth_view,
                depth_ops: Some(wgpu::Operations { load: wgpu::LoadOp::Clear(cleared), store: wgpu::StoreOp::Store }),
                stencil_ops: None,
            }),
            ..Default::default()
        });
        pass.draw(&mut render, &layer);
        drop(render);
        self.read(gpu, encoder, &color)
    }
}

fn camera() -> Camera {
    Camera::look_at(DVec3::new(0.0, 0.0, -0.6), DVec3::ZERO, DVec3::Y, 0.7, SIZE[0], SIZE[1])
}

fn scene(gpu: &Gpu) -> Scene {
    scene_of_size(gpu, SIZE)
}

fn scene_of_size(gpu: &Gpu, size: [u32; 2]) -> Scene {
    let avatar = random_avatar(3, &AvatarConfig { shape_bases: 3, color_components: 2, ..Default::default() });
    let options = SplatOptions { purpose: Purpose::Images, depth: true, ..SplatOptions::default() };
    let mut scene = Scene::with_options(gpu, &[&avatar], 1, size, options).unwrap();
    scene.set_pose(gpu, 0, 0, &Pose::rest(JOINTS)).unwrap();
    scene.set_view(gpu, &camera().resized(size[0], size[1]), [0.0; 3]).unwrap();
    scene
}

#[test]
fn splats_are_drawn_over_a_host_and_hidden_by_what_is_nearer() {
    let host = Host::new(wgpu::Features::empty(), wgpu::Limits::default());
    let gpu = host.gpu().unwrap();
    assert!(!gpu.tier.has_subgroups(), "the host did not ask for subgroups");
    let mut scene = scene(&gpu);
    let image = scene.render(&gpu, 0, &camera(), [0.0; 3]).unwrap();
    for depth in [DepthTarget::near_to_far(DEPTH, 0.05, 5.0), DepthTarget::reversed(DEPTH, 0.05)] {
        let pass = TexturePass::new(&gpu, Target { depth: Some(depth), ..Target::color(COLOR) }).unwrap();
        let before_a_wall = host.picture(&gpu, &mut scene, &pass, 4.0, depth);
        let worst = |pixels: &[[u8; 4]]| {
            let over = |p: &[f32; 4]| [0, 1, 2].map(|c| p[c] + (1.0 - p[3]) * 0.5);
            let each = image.rgba.iter().zip(pixels).flat_map(|(p, got)| {
                over(p).into_iter().zip(*got).map(|(a, b)| (255.0 * a - f32::from(b)).abs()).collect::<Vec<_>>()
            });
            each.fold(0.0, f32::max)
        };
        // Rounding of the grey and of the sum; some devices blend in eight bits.
        assert!(worst(&before_a_wall) <= 1.5, "{}", worst(&before_a_wall));
        assert!(image.rgba.iter().filter(|p| p[3] > 0.5).count() > 100, "nothing is in the picture");
        let behind_a_wall = host.picture(&gpu, &mut scene, &pass, 0.1, depth);
        assert!(behind_a_wall.iter().all(|p| p[..3] == behind_a_wall[0][..3]), "splats behind a wall are drawn");
        assert!(worst(&behind_a_wall) > 20.0, "pictures are not compared");
    }
}

#[test]
fn textures_of_linear_light_show_the_same_colours() {
    // With all that is offered, the host's device runs the same tier as one that is opened here.
    let limits = wgpu::Limits { max_compute_workgroup_storage_size: 32_768, ..wgpu::Limits::default() };
    let host = Host::new(wgpu::Features::SUBGROUP, limits);
    let gpu = host.gpu().unwrap();
    let offered = gpu.info.subgroup_min_size >= 8 && gpu.device.features().contains(wgpu::Features::SUBGROUP);
    assert_eq!(gpu.tier.has_subgroups(), offered);
    let mut scene = scene(&gpu);
    let image = scene.render(&gpu, 0, &camera(), [0.0; 3]).unwrap();
    let background = [0.1, 0.5, 0.9];
    let worst = |target: Target| {
        let pass = TexturePass::new(&gpu, target).unwrap();
        let pixels = host.replaced(&gpu, &scene, &pass, target.format, background);
        let over = |p: &[f32; 4]| [0, 1, 2].map(|c| p[c] + (1.0 - p[3]) * background[c]);
        let each = image.rgba.iter().zip(pixels).flat_map(|(p, got)| {
            over(p).into_iter().zip(got).map(|(a, b)| (255.0 * a.min(1.0) - f32::from(b)).abs()).collect::<Vec<_>>()
        });
        each.fold(0.0, f32::max)
    };
    let replace = |format| Target { replace: true, ..Target::color(format) };
    let srgb = wgpu::TextureFormat::Rgba8UnormSrgb;
    // Rounding, which devices may do within 0.6 of a step, and the device's own conversion from linear light.
    assert!(worst(replace(COLOR)) <= 0.61, "{}", worst(replace(COLOR)));
    assert!(worst(replace(srgb)) <= 1.1, "{}", worst(replace(srgb)));
    assert!(worst(Target { linear: false, ..replace(srgb) }) > 20.0, "colours are not compared");
}

#[test]
fn the_callbacks_of_a_hosts_device_stay_its_own() {
    let host = Host::new(wgpu::Features::SUBGROUP, wgpu::Limits::default());
    let gpu = host.gpu().unwrap();
    let mut scene = scene(&gpu);
    scene.render(&gpu, 0, &camera(), [0.0; 3]).unwrap();
    assert_eq!(host.errors.load(Ordering::Relaxed), 0);
    // An error of the host's: a shader that does not compile.
    let source = wgpu::ShaderSource::Wgsl("fn x(".into());
    let _broken = host.device.create_shader_module(wgpu::ShaderModuleDescriptor { label: None, source });
    assert_eq!(host.errors.load(Ordering::Relaxed), 1);
    assert_eq!(gpu.check(), Ok(()));
}

#[test]
fn a_host_device_with_less_than_every_webgpu_device_is_refused_by_the_limits_name() {
    let limits = wgpu::Limits { max_storage_buffers_per_shader_stage: 4, ..wgpu::Limits::default() };
    let message = Host::new(wgpu::Features::empty(), limits).gpu().unwrap_err().to_string();
    assert!(message.contains("max_storage_buffers_per_shader_stage of 4") && message.contains("Limits"), "{message}");
}

#[test]
fn buffers_grow_without_waiting_and_asynchronous_reads_give_the_same_image() {
    let gpu = Gpu::new(&ghand_render::AdapterChoice::from_env()).unwrap_or_else(|e| panic!("{e}"));
    // Large enough for each Gaussian to be on many tiles.
    let near = camera().resized(1024, 768);
    let scene = |gpu: &Gpu| scene_of_size(gpu, [1024, 768]);
    let mut patient = scene(&gpu);
    let expected = patient.render(&gpu, 0, &near, [0.1; 3]).unwrap();
    assert!(patient.splatter().capacity() > scene(&gpu).splatter().capacity(), "nothing had to grow");
    let mut growing = scene(&gpu);
    growing.set_view(&gpu, &near, [0.1; 3]).unwrap();
    // Commands that a host drops answer nothing; the next frame asks again.
    growing.encode_growing(&gpu, &mut gpu.device.create_command_encoder(&Default::default())).unwrap();
    let frames = (0..5).map(|_| {
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        let grown = growing.encode_growing(&gpu, &mut encoder).unwrap();
        gpu.queue.submit([encoder.finish()]);
        gpu.poll().unwrap();
        (grown, growing.splatter().read_image(&gpu).unwrap() == expected)
    });
    let frames: Vec<(bool, bool)> = frames.collect();
    assert!(!frames[0].1 && frames.iter().any(|frame| frame.0) && frames[4] == (false, true), "{frames:?}");
    let mut asynchronous = scene(&gpu);
    let rendering = async { asynchronous.render_async(&gpu, 0, &near, [0.1; 3]).await };
    let done = AtomicBool::new(false);
    let image = std::thread::scope(|threads| {
        threads.spawn(|| {
            while !done.load(Ordering::Relaxed) {
                gpu.poll().unwrap();
                std::thread::yield_now();
            }
        });
        let image = pollster::block_on(rendering);
        done.store(true, Ordering::Relaxed);
        image
    });
    assert!(image.unwrap() == expected);
}

#[test]
fn a_placed_avatar_is_seen_as_by_a_camera_that_moved_the_other_way() {
    let gpu = Gpu::new(&ghand_render::AdapterChoice::from_env()).unwrap_or_else(|e| panic!("{e}"));
    let mut fixed = scene(&gpu);
    let mut placed = scene(&gpu);
    let rotation = DMat3::from_rotation_y(0.7) * DMat3::from_rotation_x(-0.4);
    let shift = DVec3::new(0.03, -0.02, 0.05);
    placed.set_placement(0, rotation, shift).unwrap();
    placed.set_pose(&gpu, 0, 0, &Pose::rest(JOINTS)).unwrap();
    let camera = camera();
    let moved = Camera {
        rotation: camera.rotation * rotation,
        translation: camera.rotation * shift + camera.translation,
        ..camera.clone()
    };
    let seen = placed.render(&gpu, 0, &camera, [0.0; 3]).unwrap();
    let expected = fixed.render(&gpu, 0, &moved, [0.0; 3]).unwrap();
    let mean = |a: &ghand_render::splat::Image, b: &ghand_render::splat::Image| {
        let sum: f32 = a.rgba.iter().flatten().zip(b.rgba.iter().flatten()).map(|(a, b)| (a - b).abs()).sum();
        sum / (4 * a.rgba.len()) as f32
    };
    // Gaussians at the same depth may change places.
    assert!(mean(&seen, &expected) < 1e-4, "{}", mean(&seen, &expected));
    let unmoved = fixed.render(&gpu, 0, &camera, [0.0; 3]).unwrap();
    assert!(mean(&seen, &unmoved) > 1e-2, "places are not compared");
    assert!(placed.set_placement(1, rotation, shift).is_err());
}

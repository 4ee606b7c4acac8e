//! Devices that are lost, run out of memory, or reject a shader.

use std::sync::mpsc::channel;
use std::time::Duration;

use crate::common::*;
use ghand_core::mesh::Texture;
use ghand_render::image_loss::{ImageLoss, LossWeights};
use ghand_render::mesh::{MeshError, MeshInstance, MeshRenderer, MeshStyle, Shading, Surface};
use ghand_render::optimizer::{Adam, Grouping};
use ghand_render::splat::{Counters, SplatModel, SplatOptions, Splatter, View};
use ghand_render::{AdapterChoice, Gpu, RenderError, buffers};
use glam::{DVec2, DVec3};

/// Far longer than any test here takes.
const PATIENCE: Duration = Duration::from_secs(120);

/// Runs `work` on another thread, so that a call that waits forever fails the test instead of stopping it.
fn in_time<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> T {
    let (sender, receiver) = channel();
    let thread = std::thread::spawn(move || sender.send(work()));
    let result = receiver.recv_timeout(PATIENCE);
    match result {
        Ok(result) => result,
        Err(std::sync::mpsc::RecvTimeoutError::Timeout) => panic!("it never returns"),
        Err(_) => std::panic::resume_unwind(thread.join().unwrap_err()),
    }
}

fn is_loss<T>(result: Result<T, RenderError>) -> bool {
    let Err(RenderError::Lost(reason)) = result else { return false };
    let sentence = RenderError::Lost(reason).to_string();
    sentence.contains("was lost (") && sentence.contains("driver") && !sentence.contains('\n')
}

const SIZE: [u32; 2] = [60, 44];
const COUNT: usize = 800;

/// A splatter with a scene and a view.
fn splatter(gpu: &Gpu) -> Splatter {
    let model = SplatModel::HAND;
    let mut splatter = Splatter::new(gpu, SplatOptions { model, ..SplatOptions::default() }, COUNT, SIZE)
        .unwrap_or_else(|e| panic!("{e}"));
    gpu.queue.write_buffer(
        splatter.gaussians(),
        0,
        bytemuck::cast_slice(&table(&random_scene(5, COUNT, 0.002..0.02), &model)),
    );
    splatter.set_view(gpu, View::new(&camera(SIZE[0], SIZE[1]), COUNT, BACKGROUND, 1.0)).unwrap();
    splatter
}

fn image_bits(gpu: &Gpu) -> Vec<[u32; 4]> {
    splatter(gpu).render(gpu).unwrap().rgba.iter().map(|p| p.map(f32::to_bits)).collect()
}

#[test]
fn a_program_that_waits_for_the_loss_is_woken() {
    let gpu = gpu();
    let lost = gpu.lost();
    let waits = in_time({
        let gpu = gpu.clone();
        move || {
            let waiting = std::thread::spawn(move || pollster::block_on(lost));
            std::thread::sleep(Duration::from_millis(50));
            let early = waiting.is_finished();
            gpu.device.destroy();
            let _ = gpu.poll();
            (early, waiting.join().unwrap())
        }
    });
    assert_eq!(waits, (false, "it was destroyed".to_owned()));
    assert_eq!(pollster::block_on(gpu.lost()), "it was destroyed", "also afterwards");
}

#[test]
fn a_loss_is_distinguished_from_other_errors() {
    let gpu = gpu();
    assert!(!is_loss(gpu.check()) && !is_loss::<()>(Err(RenderError::Device("lost".into()))));
    in_time(move || {
        // No scope catches the error, but the device remains usable.
        let too_large = |label: &str| {
            let usage = wgpu::BufferUsages::STORAGE;
            let descriptor =
                wgpu::BufferDescriptor { label: Some(label), size: u64::MAX, usage, mapped_at_creation: false };
            drop(gpu.device.create_buffer(&descriptor));
        };
        too_large("outside scopes");
        let Err(RenderError::Device(first)) = gpu.check() else { panic!("{:?}", gpu.check()) };
        assert!(first.contains("outside scopes") && !first.contains('\n'), "{first}");
        assert!(!gpu.is_lost());
        ["second", "third"].iter().for_each(|label| too_large(label));
        // The first error is reported; the others are counted.
        let Err(RenderError::Device(later)) = gpu.wait() else { panic!("{:?}", gpu.wait()) };
        assert_eq!(later, format!("{first} (and 2 more errors after it)"));
        gpu.device.destroy();
        // An earlier error does not hide the loss.
        assert!(is_loss(gpu.wait()) && gpu.is_lost());
    });
}

#[test]
fn all_calls_that_wait_for_a_lost_device_fail_at_once_and_say_so() {
    in_time(|| {
        let gpu = gpu();
        let mut splatter = splatter(&gpu);
        splatter.render(&gpu).unwrap();
        let pixels = (SIZE[0] * SIZE[1]) as usize;
        let mut loss = ImageLoss::new(&gpu, splatter.image(), splatter.d_image(), pixels).unwrap();
        let adam = Adam::new(&gpu).unwrap();
        let mesh = MeshRenderer::new(&gpu).unwrap();
        assert!(!gpu.is_lost());
        gpu.device.destroy();
        assert!(is_loss(splatter.render(&gpu)));
        assert!(gpu.is_lost() && is_loss(gpu.check()) && is_loss(gpu.wait()) && is_loss(gpu.poll()));
        assert!(is_loss(buffers::read::<f32>(&gpu, splatter.image(), 4 * pixels)));
        assert!(is_loss(splatter.read_counters(&gpu)) && is_loss(splatter.time_stages(&gpu)));
        loss.set_target(&gpu, SIZE, &vec![[0; 4]; pixels], LossWeights::default(), 1.0).unwrap();
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        loss.encode(&mut encoder);
        gpu.queue.submit([encoder.finish()]);
        assert!(is_loss(loss.value(&gpu)));
        // Nothing new can be made, and trying is harmless.
        assert!(is_loss(Splatter::new(&gpu, SplatOptions::default(), 10, SIZE)));
        assert!(is_loss(ImageLoss::new(&gpu, splatter.image(), splatter.d_image(), pixels)));
        assert!(is_loss(Adam::new(&gpu)));
        let image = splatter.image();
        assert!(is_loss(adam.table(&gpu, image, image, 4, 1, Grouping::Scalars)));
        buffers::filled(&gpu, "on a lost device", &[1u8, 2, 3]);
        buffers::uniform(&gpu, "on a lost device", &[1.0f32; 4]);
        let texture = Texture::plain([255; 3]);
        let triangle = MeshInstance {
            positions: &[DVec3::ZERO, DVec3::X, DVec3::Y],
            normals: &[DVec3::Z; 3],
            light_visibility: None,
            triangles: &[[0, 1, 2]],
            surface: Surface::Texture { uvs: &[DVec2::ZERO; 3], texture: &texture },
        };
        let style = MeshStyle { supersample: 1, shading: Shading::Unlit, wireframe: None };
        let drawn = mesh.render(&triangle, &camera(SIZE[0], SIZE[1]), &style);
        assert!(matches!(drawn, Err(MeshError::Device(RenderError::Lost(_)))), "{drawn:?}");
        assert!(matches!(MeshRenderer::new(&gpu), Err(MeshError::Device(RenderError::Lost(_)))));
    });
}

#[test]
fn a_loss_during_a_frame_is_noticed_by_the_thread_that_waits_for_it() {
    in_time(|| {
        let gpu = gpu();
        let splatter = splatter(&gpu);
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        splatter.forward(&mut encoder);
        splatter.backward(&mut encoder);
        gpu.queue.submit([encoder.finish()]);
        gpu.device.destroy();
        assert!(is_loss(gpu.wait()));
        assert!(is_loss(splatter.read_counters(&gpu)));
    });
}

#[test]
fn a_loss_during_a_mapping_does_not_hang() {
    in_time(|| {
        let gpu = gpu();
        let usage = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
        let buffer = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("mapped"),
            size: 16,
            usage,
            mapped_at_creation: false,
        });
        let (sender, receiver) = channel();
        buffer.map_async(wgpu::MapMode::Read, .., move |result| sender.send(result.is_ok()).unwrap_or(()));
        gpu.device.destroy();
        assert!(is_loss(gpu.wait()));
        // Whether the callback was called or not, checking is safe, and mapping after the loss fails.
        let _ = receiver.try_recv();
        let (sender, receiver) = channel();
        buffer.map_async(wgpu::MapMode::Read, .., move |result| sender.send(result.is_ok()).unwrap_or(()));
        assert_eq!(receiver.try_recv(), Ok(false));
    });
}

#[test]
fn a_reopened_device_renders_the_same_bits() {
    in_time(|| {
        let gpu = gpu();
        let before = image_bits(&gpu);
        gpu.device.destroy();
        assert!(is_loss(gpu.wait()));
        let again = gpu.reopen().unwrap();
        assert!(gpu.is_lost() && !again.is_lost(), "the old device stays lost, the new one is not");
        assert_eq!(again.info, gpu.info);
        let after = image_bits(&again);
        assert!(before == after);
        // The comparison detects a single changed bit.
        let mut wrong = after;
        wrong[7][1] ^= 1;
        assert!(before != wrong);
    });
}

#[test]
fn work_is_restarted_after_each_loss_until_there_are_too_many() {
    in_time(|| {
        #[derive(Debug, thiserror::Error)]
        enum Failed {
            #[error(transparent)]
            Render(#[from] RenderError),
            #[error(transparent)]
            Device(#[from] ghand_render::DeviceError),
        }
        let mut gpu = gpu();
        let lose = |times: usize, tries: &mut usize, gpu: &Gpu| -> Result<usize, Failed> {
            *tries += 1;
            if *tries <= times {
                gpu.device.destroy();
            }
            gpu.wait()?;
            Ok(*tries)
        };
        let mut tries = 0;
        assert_eq!(gpu.retry_on_device_loss("counting", |gpu| lose(2, &mut tries, gpu)).unwrap(), 3);
        assert!(!gpu.is_lost());
        let mut tries = 0;
        let given_up = gpu.retry_on_device_loss("counting", |gpu| lose(usize::MAX, &mut tries, gpu));
        assert!(matches!(given_up, Err(Failed::Render(RenderError::Lost(_)))), "{given_up:?}");
        assert_eq!(tries, 4);
        // Work that failed for another reason is not repeated; a device lost earlier is replaced first.
        let mut tries = 0;
        let other = gpu.retry_on_device_loss("failing", |gpu| -> Result<(), Failed> {
            tries += 1;
            gpu.wait()?;
            Err(RenderError::Invalid("no".into()).into())
        });
        assert!(matches!(other, Err(Failed::Render(RenderError::Invalid(_)))), "{other:?}");
        assert_eq!(tries, 1);
    });
}

#[test]
fn too_little_memory_is_one_sentence_and_the_device_remains_usable() {
    in_time(|| {
        let gpu = gpu();
        let before = image_bits(&gpu);
        let limits = gpu.device.limits();
        let sentence = |result: Result<(), RenderError>, part: &str| {
            let Err(error @ RenderError::OutOfMemory { .. }) = result else { panic!("{result:?}") };
            let text = error.to_string();
            assert!(text.contains("too little memory") && text.contains(part) && !text.contains('\n'), "{text}");
            println!("{text}");
        };
        // A buffer that the device allows, but cannot bind as a whole; and one that it does not allow.
        let bindable = limits.max_storage_buffer_binding_size / 16;
        let count = usize::try_from(bindable / 4 + 1000).unwrap();
        sentence(Splatter::new(&gpu, SplatOptions::default(), count * 4, SIZE).map(drop), "60 x 44 pixels");
        let largest = usize::try_from(limits.max_buffer_size / 4 + 1).unwrap();
        sentence(gpu.scoped("the largest buffer", || buffers::zeroed(&gpu, "large", largest)).map(drop), "at most");
        assert!(gpu.check().is_ok(), "{:?}", gpu.check());
        assert!(before == image_bits(&gpu));
    });
}

/// Counters of a frame that needs this many intersections.
fn wanting(intersections_wanted: u32) -> Counters {
    Counters { intersections_wanted, ..Counters::default() }
}

#[test]
fn a_frame_that_cannot_grow_leaves_the_splatter_unchanged() {
    in_time(|| {
        let gpu = gpu();
        let mut splatter = splatter(&gpu);
        let before = splatter.render(&gpu).unwrap();
        let capacity = splatter.capacity();
        // The maximum number of intersections, whose buffers together exceed any memory.
        let bytes = if gpu.tier.has_subgroups() { 32 } else { 4 * 32 };
        let most = u32::try_from(gpu.device.limits().max_storage_buffer_binding_size / bytes).unwrap_or(u32::MAX);
        match splatter.complete_for(&gpu, &wanting(most)) {
            // A software adapter has all of the machine's memory.
            Ok(grown) => assert!(!grown && splatter.capacity() == most),
            Err(e) => {
                assert!(matches!(&e, RenderError::OutOfMemory { what, .. } if what.contains("intersections")), "{e}");
                assert_eq!(splatter.capacity(), capacity);
            }
        }
        assert!(matches!(splatter.complete_for(&gpu, &wanting(u32::MAX)), Err(RenderError::Invalid(_))));
        assert!(splatter.render(&gpu).unwrap() == before);
    });
}

#[test]
fn a_shader_that_does_not_compile_is_an_error_of_the_call_that_made_it() {
    let gpu = gpu();
    let make = |source: &str, entry: &'static str| {
        gpu.scoped("a stage under test", || {
            let source = wgpu::ShaderSource::Wgsl(source.into());
            let module = gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor { label: None, source });
            gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: None,
                layout: None,
                module: &module,
                entry_point: Some(entry),
                compilation_options: Default::default(),
                cache: None,
            })
        })
        .map(drop)
    };
    let good = "@compute @workgroup_size(1) fn run() {}";
    assert_eq!(make(good, "run"), Ok(()));
    for (source, entry) in
        [("fn x(", "x"), ("@compute @workgroup_size(1) fn run() { let a: u32 = 1.5; }", "run"), (good, "absent")]
    {
        let Err(RenderError::Device(message)) = make(source, entry) else { panic!("{source}") };
        assert!(message.contains("a stage under test") && !message.contains('\n'), "{message}");
    }
    // The device has not recorded an error.
    assert_eq!(gpu.check(), Ok(()));
    assert_eq!(make(good, "run"), Ok(()));
}

#[test]
fn an_adapter_choice_without_a_match_lists_the_available_adapters() {
    let gpu = gpu();
    let error = Gpu::new(&AdapterChoice::Named("no such adapter".into())).unwrap_err().to_string();
    assert!(
        error.contains(&gpu.info.name) && error.contains(AdapterChoice::VARIABLE) && !error.contains('\n'),
        "{error}"
    );
}

#[test]
fn many_threads_read_from_one_device() {
    in_time(|| {
        let gpu = gpu();
        let threads: Vec<_> = (0..8u32)
            .map(|thread| {
                let gpu = gpu.clone();
                std::thread::spawn(move || {
                    for round in 0..200 {
                        let numbers = [thread, round];
                        let buffer = buffers::filled(&gpu, "read by a thread", &numbers);
                        assert_eq!(buffers::read::<u32>(&gpu, &buffer, 2), Ok(numbers.to_vec()));
                    }
                })
            })
            .collect();
        threads.into_iter().for_each(|thread| thread.join().unwrap());
    });
}

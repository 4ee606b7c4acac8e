//! The user interface as a picture, without a window or a display.

use std::path::Path;

use anyhow::{Context, ensure};
use egui::{Pos2, Rect, Vec2};
use ghand_pictures::write_png;
use ghand_render::Gpu;
use image::{RgbImage, RgbaImage};

use crate::viewer::app::Viewer;
use crate::viewer::document::subject::Subject;
use crate::viewer::window::style;

/// Format of the target: display values, as egui prefers.
const FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;
/// Runs of the user interface before giving up on a complete picture: the first lays out, the second measures, and a
/// picture that needs more memory takes one more.
const MOST_RUNS: usize = 8;

/// Runs the user interface at this size (pixels) and scale (pixels per point) until the subject's picture is complete, and writes it
/// as PNG. A motion does not advance.
///
/// # Errors
/// An error that says why there is no picture, or names the file that could not be written.
pub fn screenshot(viewer: &mut Viewer, size: [u32; 2], scale: f32, path: &Path) -> anyhow::Result<()> {
    viewer.subject_mut().pause();
    let rgb = viewer.retry_on_device_loss(|viewer| picture(viewer, size, scale))?;
    Ok(write_png(path, &rgb)?)
}

fn picture(viewer: &mut Viewer, size: [u32; 2], scale: f32) -> anyhow::Result<RgbImage> {
    // The context sends its textures once, to one renderer.
    let context = &egui::Context::default();
    style(context);
    let gpu = viewer.gpu().clone();
    // The renderer panics if it cannot allocate its buffers, here and below.
    gpu.poll()?;
    let largest = gpu.device.limits().max_texture_dimension_2d;
    ensure!(
        size.iter().all(|edge| *edge <= largest),
        "--size: the device can draw at most {largest} x {largest} pixels"
    );
    let mut renderer = egui_wgpu::Renderer::new(&gpu.device, FORMAT, egui_wgpu::RendererOptions::PREDICTABLE);
    let mut output = run(viewer, context, (size, scale), &mut renderer, 0, &gpu);
    let mut complete = false;
    for number in 1..MOST_RUNS {
        // One more run after the picture is complete, so that its figures are on the panel.
        let last = complete;
        output = run(viewer, context, (size, scale), &mut renderer, number, &gpu);
        complete = viewer.finish()?;
        if let Subject::Hand(hand) = viewer.subject_mut() {
            complete &= hand.wait_for_thumbnails(context);
        }
        if last && complete {
            break;
        }
    }
    ensure!(complete, "the picture was not complete after {MOST_RUNS} tries");
    let image = paint(&gpu, context, output, size, &mut renderer)?;
    let rgb = image.pixels().flat_map(|p| [p.0[0], p.0[1], p.0[2]]).collect();
    RgbImage::from_raw(size[0], size[1], rgb).context("the screenshot has the wrong size")
}

/// One run of the user interface; its textures go to the renderer.
fn run(
    viewer: &mut Viewer,
    context: &egui::Context,
    ([width, height], scale): ([u32; 2], f32),
    renderer: &mut egui_wgpu::Renderer,
    number: usize,
    gpu: &Gpu,
) -> egui::FullOutput {
    let mut input = egui::RawInput {
        screen_rect: Some(Rect::from_min_size(Pos2::ZERO, Vec2::new(width as f32, height as f32) / scale)),
        max_texture_side: Some(gpu.device.limits().max_texture_dimension_2d as usize),
        // Far apart, so that animations have ended.
        time: Some(number as f64),
        ..Default::default()
    };
    input.viewports.entry(egui::ViewportId::ROOT).or_default().native_pixels_per_point = Some(scale);
    let mut output = context.run_ui(input, |ui| viewer.ui(ui, renderer));
    for (id, deltas) in output.textures_delta.set.drain() {
        for delta in deltas {
            renderer.update_texture(&gpu.device, &gpu.queue, id, &delta);
        }
    }
    for id in output.textures_delta.free.drain() {
        renderer.free_texture(&id);
    }
    output
}

fn paint(
    gpu: &Gpu,
    context: &egui::Context,
    output: egui::FullOutput,
    [width, height]: [u32; 2],
    renderer: &mut egui_wgpu::Renderer,
) -> anyhow::Result<RgbaImage> {
    let jobs = context.tessellate(output.shapes, output.pixels_per_point);
    let screen =
        egui_wgpu::ScreenDescriptor { size_in_pixels: [width, height], pixels_per_point: output.pixels_per_point };
    let target = gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some("screenshot"),
        size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: FORMAT,
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
        view_formats: &[],
    });
    gpu.poll()?;
    let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    let mut commands = renderer.update_buffers(&gpu.device, &gpu.queue, &mut encoder, &jobs, &screen);
    let view = target.create_view(&wgpu::TextureViewDescriptor::default());
    {
        let pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("screenshot"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: &view,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations { load: wgpu::LoadOp::Clear(wgpu::Color::BLACK), store: wgpu::StoreOp::Store },
            })],
            ..Default::default()
        });
        renderer.render(&mut pass.forget_lifetime(), &jobs, &screen);
    }
    let row = (4 * width).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
    let words = row as usize / 4 * height as usize;
    let rows = ghand_render::buffers::zeroed(gpu, "screenshot", words);
    encoder.copy_texture_to_buffer(
        target.as_image_copy(),
        wgpu::TexelCopyBufferInfo {
            buffer: &rows,
            layout: wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(row), rows_per_image: None },
        },
        wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
    );
    commands.push(encoder.finish());
    gpu.queue.submit(commands);
    let bytes: Vec<u8> = ghand_render::buffers::read(gpu, &rows, 4 * words)?;
    let pixels = bytes.chunks_exact(row as usize).flat_map(|r| r.iter().take(4 * width as usize)).copied().collect();
    RgbaImage::from_raw(width, height, pixels).context("the screenshot has the wrong size")
}

//! The whole user interface as pictures: [`ghand_test_support::golden`].

use egui::{Key, Modifiers, Rect, TexturesDelta};
use egui_kittest::TestRenderer;
use egui_wgpu::ScreenDescriptor;
use ghand_footage::LiveSource;
use ghand_test_support::golden;
use image::{Rgb, RgbImage};

use super::*;

/// Space for the longest time, points.
const LONGEST: f32 = 80.0;

/// Keeps egui's textures on the device that draws the subject.
pub(super) struct Textures {
    pub gpu: Gpu,
    pub renderer: Arc<Mutex<egui_wgpu::Renderer>>,
}

impl TestRenderer for Textures {
    fn handle_delta(&mut self, delta: &mut TexturesDelta) {
        let mut renderer = self.renderer.lock().unwrap();
        let mut changes: Vec<_> = delta.set.drain().collect();
        changes.sort_by_key(|(id, _)| format!("{id:?}"));
        for (id, images) in changes {
            for image in images {
                renderer.update_texture(&self.gpu.device, &self.gpu.queue, id, &image);
            }
        }
        for id in delta.free.drain() {
            renderer.free_texture(&id);
        }
    }
}

impl Headless {
    /// Shows frames until picture and animations rest.
    fn rest(&mut self) {
        for _ in 0..30 {
            self.frame(Vec::new());
        }
        assert!(self.viewer().finish().unwrap(), "the picture is not complete");
        self.frame(Vec::new());
    }

    /// The user interface as it is drawn, without what differs between machines: times and the adapter's name.
    fn screen(&mut self) -> RgbImage {
        let adapter = self.viewer().gpu().info.name.clone();
        let mut hidden: Vec<Rect> = [" ms", adapter.as_str()]
            .iter()
            .flat_map(|text| self.harness.query_all_by_label_contains(text).map(|node| node.rect()).collect::<Vec<_>>())
            .collect();
        hidden.retain(|rect| rect.is_finite());
        let mut picture = self.drawn();
        for rect in hidden {
            // Numbers stand at the right, with as many digits as the machine is slow.
            let rect = rect.with_min_x(rect.left().min(rect.right() - LONGEST));
            let ([left, top], [right, bottom]) = (<[f32; 2]>::from(rect.min), <[f32; 2]>::from(rect.max));
            let rows = (top.max(0.0) as u32..(bottom.ceil() as u32).min(picture.height())).collect::<Vec<_>>();
            for y in rows {
                for x in left.max(0.0) as u32..(right.ceil() as u32).min(picture.width()) {
                    picture.put_pixel(x, y, Rgb([90; 3]));
                }
            }
        }
        picture
    }

    fn drawn(&mut self) -> RgbImage {
        let context = self.harness.ctx.clone();
        let scale = context.pixels_per_point();
        let shapes = context.tessellate(self.harness.output().shapes.clone(), scale);
        let size = context.content_rect().size() * scale;
        let [width, height] = [size.x.round() as u32, size.y.round() as u32];
        let screen = ScreenDescriptor { size_in_pixels: [width, height], pixels_per_point: scale };
        let Gpu { device, queue, .. } = self.viewer().gpu().clone();
        let extent = wgpu::Extent3d { width, height, depth_or_array_layers: 1 };
        let texture = device.create_texture(&wgpu::TextureDescriptor {
            label: Some("screen"),
            size: extent,
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: wgpu::TextureFormat::Rgba8Unorm,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
            view_formats: &[],
        });
        let row = (4 * width).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
        let pixels = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("screen"),
            size: u64::from(row * height),
            usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        });
        let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let renderer = self.harness.state().renderer.clone();
        let mut renderer = renderer.lock().unwrap();
        let first = renderer.update_buffers(&device, &queue, &mut encoder, &shapes, &screen);
        let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
        let attachment = wgpu::RenderPassColorAttachment {
            view: &view,
            depth_slice: None,
            resolve_target: None,
            ops: wgpu::Operations { load: wgpu::LoadOp::Clear(wgpu::Color::BLACK), store: wgpu::StoreOp::Store },
        };
        let pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("screen"),
            color_attachments: &[Some(attachment)],
            ..Default::default()
        });
        renderer.render(&mut pass.forget_lifetime(), &shapes, &screen);
        let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(row), rows_per_image: None };
        let copy = wgpu::TexelCopyBufferInfo { buffer: &pixels, layout };
        encoder.copy_texture_to_buffer(texture.as_image_copy(), copy, extent);
        queue.submit(first.into_iter().chain([encoder.finish()]));
        let words: Vec<[u8; 4]> =
            ghand_render::buffers::read(self.viewer().gpu(), &pixels, (row * height / 4) as usize).unwrap();
        RgbImage::from_fn(width, height, |x, y| {
            let [r, g, b, _] = words[(y * row / 4 + x) as usize];
            Rgb([r, g, b])
        })
    }
}

/// Films that stand for two cameras; `None` without ffmpeg.
fn two_films(folder: &Path) -> Option<Vec<LiveSource>> {
    if !ghand_test_support::ffmpeg() {
        return None;
    }
    let film = |name: &str| {
        let path = folder.join(name);
        let mut ffmpeg = std::process::Command::new("ffmpeg");
        ffmpeg.args(["-v", "error", "-f", "lavfi", "-i", "color=gray:s=64x48:d=0.2", "-c:v", "ffv1"]).arg(&path);
        assert!(ffmpeg.status().unwrap().success());
        LiveSource::video(&path).unwrap()
    };
    Some(["a.mkv", "b.mkv"].map(film).into())
}

/// A hand with a motion.
fn hand() -> Headless {
    let mut hand = small_hand();
    let motion = ghand_motion::motions::motion("wave", hand.model(), 30.0).unwrap().unwrap();
    hand.show("wave".into(), motion);
    hand.pause();
    Headless::new(Subject::Hand(Box::new(hand)), vec2(760.0, 620.0), 0.1)
}

#[test]
fn the_panels_of_a_hand_look_as_before() {
    let mut ui = hand();
    ui.rest();
    golden::check("viewer-hand", &ui.screen());
    ui.click("Joints");
    ui.click("Index finger");
    ui.rest();
    golden::check("viewer-joints", &ui.screen());
}

#[test]
fn a_scene_looks_as_before() {
    let mut ui = Headless::new(small_scene(), vec2(760.0, 480.0), 0.1);
    ui.rest();
    golden::check("viewer-scene", &ui.screen());
}

#[test]
fn dialogs_look_as_before() {
    let mut ui = hand();
    ui.rest();
    for (name, modifiers, key) in [
        ("viewer-commands", Modifiers::COMMAND, Key::K),
        ("viewer-help", Modifiers::NONE, Key::F1),
        ("viewer-save-picture", Modifiers::COMMAND | Modifiers::SHIFT, Key::S),
        ("viewer-save-film", Modifiers::COMMAND | Modifiers::SHIFT, Key::F),
    ] {
        ui.press(modifiers, key);
        ui.rest();
        golden::check(name, &ui.screen());
        ui.press(Modifiers::NONE, Key::Escape);
        ui.rest();
    }
}

#[test]
fn the_menu_of_poses_looks_as_before() {
    let folder = tempfile::tempdir().unwrap();
    let Some(cameras) = two_films(folder.path()) else { return };
    let mut ui = hand();
    ui.viewer().live.set_cameras(cameras);
    ui.rest();
    ui.open_menu("Pose");
    ui.rest();
    golden::check("viewer-pose-menu", &ui.screen());
}

#[test]
fn another_panel_is_not_taken_for_it() {
    let mut ui = hand();
    ui.rest();
    let before = ui.screen();
    ui.click("Joints");
    ui.rest();
    let after = ui.screen();
    assert_ne!(before, after);
    // The same screen is drawn with the same pixels.
    assert_eq!(after, ui.screen());
}

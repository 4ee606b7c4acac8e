//! The viewer's user interface, without the window around it.

mod recovery;

use std::path::Path;
use std::time::{Duration, Instant};

use egui::{
    Align, CentralPanel, CollapsingHeader, Color32, Frame, Layout, Panel, PointerButton, Rect, RichText, ScrollArea,
    Sense, Ui,
};
use ghand_avatar::Avatar;
use ghand_core::Pose;
use ghand_data::PoseSequence;
use ghand_render::{Gpu, RenderError};
use glam::DVec2;

use crate::viewer::camera::OrbitCamera;
use crate::viewer::picture::{Median, Picture, Progress, Scene};
use crate::viewer::pose_panel::PosePanel;
use crate::viewer::timeline::Timeline;

/// Longest edge of the picture, pixels, on a graphics card.
const LARGEST_PICTURE: u32 = 2048;
/// The same on a software rasteriser.
const LARGEST_PICTURE_CPU: u32 = 1024;
/// Width of the side panel, points.
const PANEL_WIDTH: f32 = 260.0;
/// Colour behind the hand at first.
const BACKGROUND: [u8; 3] = [30, 32, 36];
/// How soon to look again whether a picture is done.
const SOON: Duration = Duration::from_millis(5);
/// Zoom for a scroll of one point; a wheel's notch is about 40.
const ZOOM_PER_POINT: f64 = 0.002;
/// Step by which the picture's edges shrink while the device cannot hold it, and grow when it can again.
const DETAIL_STEP: f32 = 0.75;
/// Coarser than this, the picture is given up.
const LEAST_DETAIL: f32 = 0.1;

/// The state of the viewer.
pub struct Viewer {
    gpu: Gpu,
    avatar: Avatar,
    source: String,
    picture: Picture,
    panel: PosePanel,
    camera: OrbitCamera,
    pose: Pose,
    timeline: Option<Timeline>,
    background: [u8; 3],
    largest_edge: u32,
    /// Edge of the picture as a part of the panel's: less than 1 where the device cannot hold so large a close-up.
    detail: f32,
    /// Fewest tile intersections that the device could not hold.
    too_many: u32,
    /// What the picture shows, if it is complete or will be.
    shown: Option<Scene>,
    texture: Option<egui::TextureId>,
    failure: Option<RenderError>,
    measure: bool,
    last_frame: Option<Instant>,
    between_frames_ms: Median,
}

impl Viewer {
    /// A viewer of an avatar in a pose; `source` says where the avatar is from.
    ///
    /// # Errors
    /// [`RenderError`] if the device cannot hold the avatar.
    pub fn new(gpu: &Gpu, avatar: Avatar, source: String, pose: Pose) -> Result<Viewer, RenderError> {
        let largest_edge = if gpu.is_cpu() { LARGEST_PICTURE_CPU } else { LARGEST_PICTURE };
        let picture = Picture::new(gpu, &avatar, [largest_edge; 2])?;
        let panel = PosePanel::new(&avatar.model);
        // The view stays the same whatever the pose, so it must have room for the flat hand.
        let camera = OrbitCamera::facing(&avatar.model, &Pose::rest(avatar.model.joint_count()));
        Ok(Viewer {
            gpu: gpu.clone(),
            avatar,
            source,
            picture,
            panel,
            camera,
            pose,
            timeline: None,
            background: BACKGROUND,
            largest_edge,
            detail: 1.0,
            too_many: u32::MAX,
            shown: None,
            texture: None,
            failure: None,
            measure: false,
            last_frame: None,
            between_frames_ms: Median::default(),
        })
    }

    /// Shows a motion from its beginning.
    pub fn play(&mut self, title: String, sequence: PoseSequence, playing: bool) {
        let timeline = Timeline::new(title, sequence, playing);
        self.pose = timeline.pose().unwrap_or_else(|| self.pose.clone());
        self.timeline = Some(timeline);
    }

    /// The device.
    pub fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    /// Waits for the picture. Returns whether it is complete; if not, the user interface must run once more.
    ///
    /// # Errors
    /// [`RenderError`] if the picture could not be rendered.
    pub fn finish(&mut self) -> Result<bool, RenderError> {
        self.gpu.wait()?;
        self.collect();
        match self.failure.take() {
            Some(failure) => Err(failure),
            None => Ok(self.shown.is_some()),
        }
    }

    /// Runs the user interface; the picture is drawn through `renderer`.
    pub fn ui(&mut self, ui: &mut Ui, renderer: &mut egui_wgpu::Renderer) {
        let progress = self.collect();
        Panel::left("controls").resizable(false).exact_size(PANEL_WIDTH).show(ui, |ui| {
            ScrollArea::vertical().auto_shrink(false).show(ui, |ui| self.controls(ui));
        });
        CentralPanel::default().frame(Frame::NONE).show(ui, |ui| self.hand(ui, renderer, progress));
    }

    /// Takes note of a picture that is done.
    fn collect(&mut self) -> Progress {
        let progress = self.picture.poll(&self.gpu).unwrap_or_else(|e| {
            self.failure.get_or_insert(e);
            Progress::Complete
        });
        let wanted = self.picture.intersections();
        match progress {
            Progress::Busy => {}
            Progress::Incomplete => self.shown = None,
            Progress::TooFine if self.detail > LEAST_DETAIL => {
                self.too_many = self.too_many.min(wanted);
                self.detail *= DETAIL_STEP;
                self.shown = None;
            }
            Progress::TooFine => {
                let problem = format!("the view needs {wanted} tile intersections, more than the device can hold");
                self.failure.get_or_insert(RenderError::Invalid(problem));
            }
            // A step grows the number by less than 2; the rest is a margin, so that it does not go back and forth.
            Progress::Complete if self.detail < 1.0 && wanted < self.too_many / 3 => {
                self.detail = (self.detail / DETAIL_STEP).min(1.0);
            }
            Progress::Complete => {}
        }
        progress
    }

    fn controls(&mut self, ui: &mut Ui) {
        ui.add_space(6.0);
        // A model from a file has the file's path for a name.
        let name = &self.avatar.template.name;
        ui.heading(Path::new(name).file_name().map_or(name.as_str().into(), |n| n.to_string_lossy()));
        ui.label(RichText::new(&self.source).weak());
        ui.separator();

        ui.label(RichText::new("Pose").strong());
        let before = self.pose.clone();
        self.panel.named_poses(ui, &mut self.pose);
        ui.add_space(4.0);
        CollapsingHeader::new("Joints").show(ui, |ui| self.panel.joints(ui, &mut self.pose));
        if self.pose != before {
            // Who poses the hand by hand wants no motion to move it on.
            self.timeline = None;
        }
        ui.separator();
        ui.label(RichText::new("Motion").strong());
        Timeline::show(&mut self.timeline, ui, &self.avatar.model, &mut self.pose);
        ui.separator();

        ui.label(RichText::new("View").strong());
        ui.horizontal(|ui| {
            ui.color_edit_button_srgb(&mut self.background);
            ui.label("background");
        });
        ui.horizontal(|ui| {
            if ui.button("Reset view").clicked() {
                self.reset_view();
            }
            if ui.button("Reset all").clicked() {
                self.reset_view();
                self.pose = Pose::rest(self.avatar.model.joint_count());
                self.timeline = None;
                self.background = BACKGROUND;
            }
        });
        ui.label(
            RichText::new("Drag to turn, right or shift drag to move, scroll to zoom, double click to reset.").weak(),
        );
        ui.separator();
        self.figures(ui);
    }

    fn figures(&mut self, ui: &mut Ui) {
        let row = |ui: &mut Ui, name: &str, value: String| {
            ui.horizontal(|ui| {
                ui.label(name);
                ui.with_layout(Layout::right_to_left(Align::Center), |ui| ui.label(RichText::new(value).monospace()));
            });
        };
        let ms = |time: Option<f64>| time.map_or("-".to_owned(), |t| format!("{t:.1} ms"));
        row(ui, "Picture", ms(self.picture.frame_ms()));
        if self.measure {
            row(ui, "Frame to frame", ms(self.between_frames_ms.get()));
        }
        row(ui, "Gaussians", thousands(self.picture.gaussian_count()));
        if let Some(texture) = self.picture.texture() {
            row(ui, "Pixels", format!("{} x {}", texture.width(), texture.height()));
        }
        ui.label(RichText::new(&self.gpu.info.name).weak());
        let hover = "Renders without pause. Both times are medians of the last 60: that of the device for one picture, and \
                     that from one picture to the next.";
        if ui.checkbox(&mut self.measure, "measure").on_hover_text(hover).changed() {
            self.picture.clear_times();
            self.between_frames_ms.clear();
            self.last_frame = None;
        }
    }

    fn reset_view(&mut self) {
        self.camera = OrbitCamera::facing(&self.avatar.model, &Pose::rest(self.avatar.model.joint_count()));
    }

    fn hand(&mut self, ui: &mut Ui, renderer: &mut egui_wgpu::Renderer, mut progress: Progress) {
        let rect = ui.max_rect();
        self.navigate(ui, rect);
        let size = self.picture_size(rect, ui.ctx().pixels_per_point());
        let scene = Scene {
            pose: self.pose.clone(),
            camera: self.camera.camera(size),
            background: self.background.map(|v| f32::from(v) / 255.0),
        };
        let outdated =
            |viewer: &Viewer| viewer.failure.is_none() && (viewer.measure || viewer.shown.as_ref() != Some(&scene));
        if progress == Progress::Busy && self.gpu.is_cpu() && outdated(self) {
            // One processor draws the hand and the user interface: drawing the latter twice would only delay the next picture.
            progress = match self.gpu.wait() {
                Ok(()) => self.collect(),
                Err(_) => progress,
            };
        }
        if outdated(self) {
            if progress == Progress::Busy {
                ui.ctx().request_repaint_after(SOON);
            } else {
                self.render(scene, renderer);
                // Soon the counters tell whether the picture is complete.
                ui.ctx().request_repaint_after(SOON);
            }
        } else if progress == Progress::Busy {
            ui.ctx().request_repaint_after(SOON);
        }
        if let Some(texture) = self.texture {
            let whole = Rect::from_min_max(egui::pos2(0.0, 0.0), egui::pos2(1.0, 1.0));
            ui.painter().image(texture, rect, whole, Color32::WHITE);
        }
        if let Some(failure) = &self.failure {
            ui.painter().text(
                rect.center(),
                egui::Align2::CENTER_CENTER,
                failure.to_string(),
                egui::FontId::proportional(15.0),
                ui.visuals().error_fg_color,
            );
        }
    }

    fn render(&mut self, scene: Scene, renderer: &mut egui_wgpu::Renderer) {
        match self.picture.render(&self.gpu, &scene) {
            Ok(renewed) => {
                if renewed {
                    self.show_texture(renderer);
                }
                self.shown = Some(scene);
            }
            Err(e) => self.failure = Some(e),
        }
        let now = Instant::now();
        if let Some(last) = self.last_frame.replace(now).filter(|_| self.measure) {
            self.between_frames_ms.add((now - last).as_secs_f64() * 1e3);
        }
    }

    fn show_texture(&mut self, renderer: &mut egui_wgpu::Renderer) {
        let Some(view) = self.picture.view() else { return };
        let (device, filter) = (&self.gpu.device, wgpu::FilterMode::Linear);
        match self.texture {
            Some(id) => renderer.update_egui_texture_from_wgpu_texture(device, view, filter, id),
            None => self.texture = Some(renderer.register_native_texture(device, view, filter)),
        }
    }

    fn navigate(&mut self, ui: &mut Ui, rect: Rect) {
        let response = ui.interact(rect, ui.scope_id().with("hand"), Sense::click_and_drag());
        let drag = response.drag_delta();
        let drag = DVec2::new(drag.x.into(), drag.y.into());
        let shift = ui.input(|i| i.modifiers.shift);
        let other = response.dragged_by(PointerButton::Secondary) || response.dragged_by(PointerButton::Middle);
        if response.dragged() && (other || shift) {
            self.camera.pan(drag, rect.width().min(rect.height()).into());
        } else if response.dragged() {
            self.camera.orbit(drag);
        }
        if response.hovered() {
            let (scroll, pinch) = ui.input(|i| (i.smooth_scroll_delta().y, i.zoom_delta()));
            if scroll != 0.0 || pinch != 1.0 {
                self.camera.zoom((f64::from(scroll) * ZOOM_PER_POINT).exp() * f64::from(pinch));
            }
        }
        if response.double_clicked() {
            self.reset_view();
        }
    }

    /// The panel's pixels, fewer where that would be too many.
    fn picture_size(&self, rect: Rect, pixels_per_point: f32) -> [u32; 2] {
        let pixels = rect.size() * pixels_per_point;
        let shrink = (self.largest_edge as f32 / pixels.max_elem().max(1.0)).min(1.0) * self.detail;
        [pixels.x, pixels.y].map(|edge| ((edge * shrink).round() as u32).clamp(1, self.largest_edge))
    }
}

fn thousands(number: usize) -> String {
    let digits = number.to_string();
    let mut out = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            out.push(',');
        }
        out.push(digit);
    }
    out
}

#[cfg(test)]
mod tests {
    use egui::{Event, Modifiers, Pos2, Vec2, pos2, vec2};
    use ghand_render::AdapterChoice;

    use super::*;
    use crate::bare_hand::bare_hand;

    /// The user interface of the bare hand without a window.
    struct Headless {
        viewer: Viewer,
        context: egui::Context,
        renderer: egui_wgpu::Renderer,
        time: f64,
    }

    impl Headless {
        fn new() -> Headless {
            let gpu = Gpu::new(&AdapterChoice::from_env()).unwrap_or_else(|e| panic!("{e}"));
            let avatar = bare_hand().unwrap();
            let pose = Pose::rest(avatar.model.joint_count());
            let viewer = Viewer::new(&gpu, avatar, "test".into(), pose).unwrap();
            let options = egui_wgpu::RendererOptions::PREDICTABLE;
            let renderer = egui_wgpu::Renderer::new(&gpu.device, wgpu::TextureFormat::Rgba8Unorm, options);
            Headless { viewer, context: egui::Context::default(), renderer, time: 0.0 }
        }

        /// Runs the user interface once, waits for its picture, and returns whether there was one to wait for.
        fn run(&mut self, events: Vec<Event>) -> bool {
            let before = self.viewer.last_frame;
            self.time += 1.0;
            let input = egui::RawInput {
                screen_rect: Some(Rect::from_min_size(Pos2::ZERO, vec2(700.0, 400.0))),
                time: Some(self.time),
                events,
                ..Default::default()
            };
            let output = self.context.run_ui(input, |ui| self.viewer.ui(ui, &mut self.renderer));
            output.drop_without_applying_deltas();
            self.viewer.gpu.wait().unwrap();
            before != self.viewer.last_frame
        }

        fn press(&mut self, button: PointerButton, pressed: bool, pos: Pos2) {
            let modifiers = Modifiers::default();
            self.run(vec![Event::PointerMoved(pos), Event::PointerButton { pos, button, pressed, modifiers }]);
        }
    }

    #[test]
    fn only_changes_are_rendered() {
        let mut ui = Headless::new();
        assert!(ui.run(Vec::new()));
        // The first picture may have lacked room.
        ui.run(Vec::new());
        assert!(!ui.run(Vec::new()) && !ui.run(vec![Event::PointerMoved(pos2(500.0, 200.0))]));
        ui.viewer.pose = crate::pose_choice::pose_by_name("fist", &ui.viewer.avatar.model).unwrap();
        assert!(ui.run(Vec::new()));
        ui.run(Vec::new());
        assert!(!ui.run(Vec::new()));
        ui.viewer.measure = true;
        assert!(ui.run(Vec::new()) && ui.run(Vec::new()));
        assert!(ui.viewer.picture.frame_ms().is_some_and(|ms| ms > 0.0));
    }

    #[test]
    fn the_mouse_turns_moves_zooms_and_resets() {
        let mut ui = Headless::new();
        ui.run(Vec::new());
        let start = ui.viewer.camera.clone();
        let view = |ui: &Headless| ui.viewer.camera.camera([100, 100]);
        for (button, turns) in [(PointerButton::Primary, true), (PointerButton::Secondary, false)] {
            let before = view(&ui);
            ui.press(button, true, pos2(400.0, 200.0));
            assert!(ui.run(vec![Event::PointerMoved(pos2(450.0, 220.0))]));
            ui.press(button, false, pos2(450.0, 220.0));
            let turned = (view(&ui).rotation - before.rotation).to_cols_array().iter().any(|v| v.abs() > 1e-3);
            assert_eq!(turned, turns);
            assert!(view(&ui).center().distance(before.center()) > 1e-3);
        }
        // On the panel the mouse does nothing to the view.
        let before = view(&ui);
        ui.press(PointerButton::Primary, true, pos2(100.0, 380.0));
        ui.run(vec![Event::PointerMoved(pos2(140.0, 350.0))]);
        ui.press(PointerButton::Primary, false, pos2(140.0, 350.0));
        assert_eq!(view(&ui), before);
        let wheel = Event::MouseWheel {
            unit: egui::MouseWheelUnit::Line,
            delta: Vec2::new(0.0, 3.0),
            phase: egui::TouchPhase::Move,
            source: egui::MouseWheelSource::Unknown,
            modifiers: Modifiers::default(),
        };
        ui.run(vec![Event::PointerMoved(pos2(500.0, 200.0)), wheel]);
        ui.run(Vec::new());
        assert!(view(&ui).center().distance(before.center()) > 0.01, "the wheel does not zoom");
        ui.viewer.reset_view();
        assert_eq!(ui.viewer.camera, start);
    }

    #[test]
    fn a_picture_that_lacked_room_is_rendered_again() {
        let mut ui = Headless::new();
        ui.run(Vec::new());
        ui.viewer.camera.zoom(4.0);
        assert!(ui.run(Vec::new()));
        assert!(!ui.viewer.finish().unwrap(), "the picture had room; zoom in further");
        assert!(ui.run(Vec::new()));
        assert!(ui.viewer.finish().unwrap());
        assert!(!ui.run(Vec::new()));
    }

    #[test]
    fn a_close_up_beyond_the_device_gets_coarser_and_recovers() {
        let mut ui = Headless::new();
        ui.run(Vec::new());
        let settle = |ui: &mut Headless| {
            for _ in 0..40 {
                if !ui.run(Vec::new()) && ui.viewer.finish().unwrap() {
                    return;
                }
            }
            panic!("the picture does not settle");
        };
        settle(&mut ui);
        assert_eq!(ui.viewer.detail, 1.0);
        // As a device that holds no more than the picture has now.
        ui.viewer.too_many = ui.viewer.picture.intersections();
        ui.viewer.detail = DETAIL_STEP.powi(2);
        settle(&mut ui);
        assert_eq!(ui.viewer.detail, DETAIL_STEP.powi(2), "it must not go back and forth");
        ui.viewer.camera.zoom(0.25);
        settle(&mut ui);
        assert_eq!((ui.viewer.detail, ui.viewer.failure.is_none()), (1.0, true));
    }

    #[test]
    fn large_numbers_are_grouped() {
        assert_eq!([0, 999, 1000, 22010, 1234567].map(thousands), ["0", "999", "1,000", "22,010", "1,234,567"]);
    }
}

//! The view of the subject: its picture, and what the pointer does in it.

use std::time::{Duration, Instant};

use egui::{Color32, Event, Rect, Sense, Ui};
use ghand_render::RenderError;
use glam::DVec2;

use crate::viewer::app::Viewer;
use crate::viewer::navigation::Drag;
use crate::viewer::picture::{Picture, PictureInputs, Progress};

/// Interval of checks whether a picture is done.
const SOON: Duration = Duration::from_millis(5);
/// Zoom for a scroll of one point; a wheel's notch is about 40.
pub(super) const ZOOM_PER_POINT: f64 = 0.002;

impl Viewer {
    /// Shows the picture, and renders it if it is outdated.
    pub(super) fn view(&mut self, ui: &mut Ui, renderer: &mut egui_wgpu::Renderer, mut progress: Progress) {
        let rect = ui.max_rect();
        self.navigate(ui, rect);
        if self.uploaded != self.subject.shown() {
            match self.upload() {
                Ok(()) => progress = Progress::Complete,
                Err(e) => self.failure = Some(e),
            }
        }
        let size = self.picture_size(rect, ui.ctx().pixels_per_point());
        let shot = PictureInputs {
            pose: self.subject.pose().cloned(),
            shape: self.subject.shape().to_vec(),
            light: self.subject.light().cloned(),
            camera: self.camera.camera(size),
            background: self.background.map(|v| f32::from(v) / 255.0),
        };
        let outdated =
            |viewer: &Viewer| viewer.failure.is_none() && (viewer.measure || viewer.shown.as_ref() != Some(&shot));
        if progress == Progress::Busy && self.gpu.is_cpu() && outdated(self) {
            // One processor draws the picture and the user interface: drawing the latter twice would only delay the
            // next picture.
            progress = match self.gpu.wait() {
                Ok(()) => self.collect(),
                Err(_) => progress,
            };
        }
        if outdated(self) {
            if progress == Progress::Busy {
                ui.ctx().request_repaint_after(SOON);
            } else {
                self.render(shot, renderer);
                // The counters will show soon whether the picture is complete.
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

    /// Puts the subject on the device in the colours that are shown now.
    pub(super) fn upload(&mut self) -> Result<(), RenderError> {
        self.uploaded = self.subject.shown();
        self.shown = None;
        self.picture = Picture::new(&self.gpu, &self.subject, [self.largest_edge; 2])?;
        Ok(())
    }

    fn render(&mut self, shot: PictureInputs, renderer: &mut egui_wgpu::Renderer) {
        match self.picture.render(&self.gpu, &shot) {
            Ok(renewed) => {
                if renewed {
                    self.show_texture(renderer);
                }
                self.shown = Some(shot);
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
        let response = ui.interact(rect, ui.scope_id().with("view"), Sense::click_and_drag());
        let events: Vec<Event> = ui.input(|i| i.events.clone());
        // Ignores presses on a popup over the view.
        let in_view = |pos| rect.contains(pos) && ui.ctx().layer_id_at(pos).is_none_or(|layer| layer == ui.layer_id());
        for drag in self.drags.follow(&events, in_view) {
            let points = |by: egui::Vec2| DVec2::new(by.x.into(), by.y.into());
            match drag {
                Drag::Turn(by) => self.camera.orbit(points(by)),
                Drag::Move(by) => self.camera.pan(points(by), rect.width().min(rect.height()).into()),
            }
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

    /// The panel's size in pixels, reduced if that is too many.
    fn picture_size(&self, rect: Rect, pixels_per_point: f32) -> [u32; 2] {
        let pixels = rect.size() * pixels_per_point;
        let shrink = (self.largest_edge as f32 / pixels.max_elem().max(1.0)).min(1.0) * self.detail;
        [pixels.x, pixels.y].map(|edge| ((edge * shrink).round() as u32).clamp(1, self.largest_edge))
    }
}

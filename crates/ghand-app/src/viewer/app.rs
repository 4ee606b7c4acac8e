//! The viewer's user interface, without the window around it.

mod recovery;

use std::time::{Duration, Instant};

use egui::{Align, CentralPanel, Color32, Event, Frame, Layout, Panel, Rect, RichText, ScrollArea, Sense, Ui};
use ghand_render::{Gpu, RenderError};
use glam::DVec2;

use crate::shown::Shown;
use crate::viewer::camera::OrbitCamera;
use crate::viewer::navigation::{Drag, Drags};
use crate::viewer::picture::{Median, Picture, PictureInputs, Progress};
use crate::viewer::subject::Subject;

/// Longest edge of the picture, pixels, on a graphics card.
const LARGEST_PICTURE: u32 = 2048;
/// The same on a software rasteriser.
const LARGEST_PICTURE_CPU: u32 = 1024;
/// Width of the side panel, points.
const PANEL_WIDTH: f32 = 260.0;
/// Initial colour behind the subject.
const BACKGROUND: [u8; 3] = [30, 32, 36];
/// Interval of checks whether a picture is done.
const SOON: Duration = Duration::from_millis(5);
/// Zoom for a scroll of one point; a wheel's notch is about 40.
const ZOOM_PER_POINT: f64 = 0.002;
/// Step by which the picture's edges shrink while the device cannot hold it, and grow when it can again.
const DETAIL_STEP: f32 = 0.75;
/// Below this scale the viewer gives up.
const LEAST_DETAIL: f32 = 0.1;

/// The state of the viewer.
pub struct Viewer {
    gpu: Gpu,
    subject: Subject,
    source: String,
    picture: Picture,
    /// What the colours on the device show.
    uploaded: Shown,
    camera: OrbitCamera,
    drags: Drags,
    background: [u8; 3],
    largest_edge: u32,
    /// Edge of the picture as a fraction of the panel's: less than 1 if the device cannot hold so large a close-up.
    detail: f32,
    /// Fewest tile intersections that the device could not hold.
    too_many: u32,
    /// What the picture shows, if it is complete or in progress.
    shown: Option<PictureInputs>,
    texture: Option<egui::TextureId>,
    failure: Option<RenderError>,
    measure: bool,
    last_frame: Option<Instant>,
    between_frames_ms: Median,
}

impl Viewer {
    /// A viewer of a subject; `source` says where the subject is from.
    ///
    /// # Errors
    /// [`RenderError`] if the device cannot hold the subject.
    pub fn new(gpu: &Gpu, subject: Subject, source: String) -> Result<Viewer, RenderError> {
        let largest_edge = if gpu.is_cpu() { LARGEST_PICTURE_CPU } else { LARGEST_PICTURE };
        let picture = Picture::new(gpu, &subject, [largest_edge; 2])?;
        let (camera, uploaded) = (subject.first_view(), subject.shown());
        Ok(Viewer {
            gpu: gpu.clone(),
            subject,
            source,
            picture,
            uploaded,
            camera,
            drags: Drags::default(),
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

    /// The subject.
    pub fn subject_mut(&mut self) -> &mut Subject {
        &mut self.subject
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
        CentralPanel::default().frame(Frame::NONE).show(ui, |ui| self.view(ui, renderer, progress));
    }

    /// Handles a finished picture.
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
            // One step less than doubles the number; the rest is a margin against oscillation.
            Progress::Complete if self.detail < 1.0 && wanted < self.too_many / 3 => {
                self.detail = (self.detail / DETAIL_STEP).min(1.0);
            }
            Progress::Complete => {}
        }
        progress
    }

    fn controls(&mut self, ui: &mut Ui) {
        ui.add_space(6.0);
        ui.heading(self.subject.name());
        ui.label(RichText::new(&self.source).weak());
        ui.separator();
        if self.subject.controls(ui) {
            ui.separator();
        }

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
                self.subject.reset();
                self.background = BACKGROUND;
            }
        });
        ui.label(
            RichText::new("Drag to rotate, right-drag or Shift-drag to move, scroll to zoom, double-click to reset.")
                .weak(),
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
        let (parts, count) = self.picture.subject_size();
        row(ui, parts, thousands(count));
        if self.picture.broken() > 0 {
            row(ui, "Skipped (not finite)", thousands(self.picture.broken() as usize));
        }
        if let Some(texture) = self.picture.texture() {
            row(ui, "Pixels", format!("{} x {}", texture.width(), texture.height()));
        }
        ui.label(RichText::new(&self.gpu.info.name).weak());
        let hover = "Renders continuously. Both times are medians of the last 60 pictures: the device's time per \
                     picture, and the time between pictures.";
        if ui.checkbox(&mut self.measure, "measure").on_hover_text(hover).changed() {
            self.picture.clear_times();
            self.between_frames_ms.clear();
            self.last_frame = None;
        }
    }

    fn reset_view(&mut self) {
        self.camera = self.subject.first_view();
    }

    fn view(&mut self, ui: &mut Ui, renderer: &mut egui_wgpu::Renderer, mut progress: Progress) {
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
    fn upload(&mut self) -> Result<(), RenderError> {
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
mod tests;

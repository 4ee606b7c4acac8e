//! The view of the subject: its picture, and what the pointer does in it.

use std::time::{Duration, Instant};

use egui::{Color32, Event, Rect, Sense, Ui};
use ghand_render::RenderError;
use glam::DVec2;

use crate::viewer::app::Viewer;
use crate::viewer::app::truth::tag;
use crate::viewer::document::subject::Subject;
use crate::viewer::hand::handles::draw_joint;
use crate::viewer::rendering::frame::PictureInputs;
use crate::viewer::rendering::picture::{Picture, Progress};
use crate::viewer::rendering::screen::Screen;
use crate::viewer::stage::drags::{Drag, Grip};

/// Interval of checks whether a picture is done.
const SOON: Duration = Duration::from_millis(5);
/// Zoom for a scroll of one point; a wheel's notch is about 40.
pub(super) const ZOOM_PER_POINT: f64 = 0.002;

impl Viewer {
    /// Shows the picture, and renders it if it is outdated.
    pub(super) fn view(&mut self, ui: &mut Ui, renderer: &mut egui_wgpu::Renderer, mut progress: Progress) {
        let rect = ui.max_rect();
        self.navigate(ui, rect);
        self.follow_layer();
        let mut shot = PictureInputs {
            pose: self.subject.pose().cloned(),
            shape: self.subject.shape().to_vec(),
            light: self.subject.light().cloned(),
            camera: self.camera.camera(self.picture_size(rect, ui.ctx().pixels_per_point())),
            background: (self.layer().background())
                .or_else(|| self.background_of_truth())
                .unwrap_or_else(|| self.background(ui).map(|v| f32::from(v) / 255.0)),
        };
        self.adapt_detail(&shot, ui);
        shot.camera = self.camera.camera(self.picture_size(rect, ui.ctx().pixels_per_point()));
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
        self.draw_truth(ui, rect);
        self.draw_scale(ui, rect);
        self.draw_times(ui, rect);
        self.draw_layers(ui, rect);
        self.draw_handles(ui, rect);
        self.drop_hint(ui, rect);
        if !self.settings.panel_shown {
            self.panel_button(ui, rect);
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

    /// Follows whether the picture changes.
    fn adapt_detail(&mut self, shot: &PictureInputs, ui: &Ui) {
        let now = ui.input(|input| input.time);
        if self.wanted.as_ref().is_none_or(|wanted| !wanted.shows_the_same(shot)) {
            // A first picture is not a change.
            if self.wanted.replace(shot.clone()).is_some() {
                self.adaptive.changed(now);
                // Another picture may be possible.
                self.failure = None;
            }
        } else if let Some(left) = self.adaptive.same(now) {
            ui.ctx().request_repaint_after(Duration::from_secs_f64(left.max(0.01)));
        }
    }

    /// Part of the picture's edge that is drawn while the picture changes. Times are measured of whole pictures.
    fn adaptive_scale(&self) -> f32 {
        if self.settings.adaptive && !self.measure { self.adaptive.scale() } else { 1.0 }
    }

    /// Says in the corner that the picture has fewer pixels for now.
    fn draw_scale(&self, ui: &Ui, rect: Rect) {
        if self.drawn_scale < 1.0 {
            let text = format!("{:.0} % resolution while it moves", 100.0 * self.drawn_scale);
            tag(ui, rect.right_top(), egui::Align2::RIGHT_TOP, &text);
        }
    }

    /// The button that shows the panel again.
    fn panel_button(&mut self, ui: &mut Ui, rect: Rect) {
        let place = Rect::from_min_size(rect.min + egui::vec2(8.0, 8.0), egui::vec2(52.0, 24.0));
        if ui.put(place, egui::Button::new("Panel")).on_hover_text("Show the panel (N)").clicked() {
            self.settings.panel_shown = true;
        }
    }

    /// Puts the subject on the device.
    pub(super) fn upload(&mut self) -> Result<(), RenderError> {
        self.shown = None;
        self.truth.forget_comparison();
        self.layers.forget_subject();
        self.picture = Picture::new(&self.gpu, self.subject.on_device(&self.gpu, [self.largest_edge; 2])?)?;
        Ok(())
    }

    fn render(&mut self, shot: PictureInputs, renderer: &mut egui_wgpu::Renderer) {
        let rendered = self.color_picture(&shot).and_then(|()| self.picture.render(&self.gpu, &shot));
        match rendered {
            Ok(renewed) => {
                if renewed {
                    self.show_texture(renderer);
                }
                self.drawn_scale = self.adaptive_scale();
                self.shown = Some(shot);
                if let Some(live) = &mut self.live {
                    live.picture_started();
                }
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

    /// Turns, moves and zooms the view and drags handles, as the pointer asks.
    fn navigate(&mut self, ui: &mut Ui, rect: Rect) {
        let response = ui.interact(rect, ui.scope_id().with("view"), Sense::click_and_drag());
        let events: Vec<Event> = ui.input(|i| i.events.clone());
        let screen = self.screen(rect, ui.ctx().pixels_per_point());
        // Ignores presses on a popup over the view.
        let split_line = self.split_line(rect, ui.ctx().pixels_per_point());
        let in_view = |pos| {
            rect.contains(pos)
                && ui.ctx().layer_id_at(pos).is_none_or(|layer| layer == ui.layer_id())
                && split_line.is_none_or(|line| !line.contains(pos))
        };
        let mut drags = std::mem::take(&mut self.drags);
        let found = drags
            .follow(&events, |pos| in_view(pos).then(|| self.handle_at(&screen, pos).map_or(Grip::View, Grip::Handle)));
        let held = drags.held_handle();
        self.drags = drags;
        for drag in found {
            let points = |by: egui::Vec2| DVec2::new(by.x.into(), by.y.into());
            match drag {
                Drag::Turn(by) => self.camera.orbit(points(by)),
                Drag::Move(by) => self.camera.pan(points(by), rect.width().min(rect.height()).into()),
                Drag::Handle(landmark, by) => self.drag_handle(landmark, by, &screen),
            }
        }
        if held.is_none() {
            self.handle_drag = None;
        }
        if response.hovered() {
            let (scroll, pinch) = ui.input(|i| (i.smooth_scroll_delta().y, i.zoom_delta()));
            if scroll != 0.0 || pinch != 1.0 {
                let factor = (f64::from(scroll) * ZOOM_PER_POINT).exp() * f64::from(pinch);
                let pointer = response.hover_pos().map_or(egui::Vec2::ZERO, |pos| pos - rect.center());
                let pointer = DVec2::new(pointer.x.into(), pointer.y.into());
                self.camera.zoom_at(factor, pointer, rect.width().min(rect.height()).into());
            }
        }
        if response.double_clicked() {
            self.reset_view();
        }
    }

    fn drag_handle(&mut self, landmark: usize, by: egui::Vec2, screen: &Screen) {
        let Subject::Hand(hand) = &mut self.subject else { return };
        let drag = self.handle_drag.take().filter(|drag| drag.landmark == landmark);
        let pose = hand.pose.clone();
        let Some(mut drag) = drag.or_else(|| Some(hand.handles()?.begin(&pose, landmark))) else { return };
        hand.drag_handle(&mut drag, screen, by);
        self.handle_drag = Some(drag);
    }

    /// The handle at a place, if handles are shown.
    fn handle_at(&mut self, screen: &Screen, pos: egui::Pos2) -> Option<usize> {
        let Subject::Hand(hand) = &mut self.subject else { return None };
        let pose = hand.pose.clone();
        if self.settings.handles_shown { hand.handles()?.at(&pose, screen, pos) } else { None }
    }

    /// Draws the handles when the pointer is on the hand, and the joint whose slider the user points at.
    fn draw_handles(&mut self, ui: &Ui, rect: Rect) {
        let screen = self.screen(rect, ui.ctx().pixels_per_point());
        let held = self.drags.held_handle();
        let (shown, panel_shown) = (self.settings.handles_shown, self.settings.panel_shown);
        let Subject::Hand(hand) = &mut self.subject else { return };
        let painter = ui.painter().with_clip_rect(rect);
        let (pose, shape) = (hand.pose.clone(), hand.shape.clone());
        if let Some(joint) = hand.pointed_at().filter(|_| panel_shown) {
            draw_joint(&painter, hand.model(), &shape, &pose, &screen, joint);
        }
        let Some(handles) = hand.handles().filter(|_| shown) else { return };
        let on_view = |pos: &egui::Pos2| {
            rect.contains(*pos) && ui.ctx().layer_id_at(*pos).is_none_or(|layer| layer == ui.layer_id())
        };
        let pointer = ui.input(|input| input.pointer.hover_pos()).filter(on_view);
        let hovered = held.or_else(|| handles.at(&pose, &screen, pointer?));
        if hovered.is_some() || pointer.is_some_and(|pointer| handles.is_near(&pose, &screen, pointer)) {
            handles.draw(&painter, &pose, &screen, hovered);
        }
        if hovered.is_some() {
            let icon = if held.is_some() { egui::CursorIcon::Grabbing } else { egui::CursorIcon::Grab };
            ui.ctx().set_cursor_icon(icon);
        }
    }

    pub(super) fn screen(&self, rect: Rect, pixels_per_point: f32) -> Screen {
        Screen { rect, camera: self.camera.camera(self.picture_size(rect, pixels_per_point)) }
    }

    /// The panel's size in pixels, reduced if that is too many.
    pub(super) fn picture_size(&self, rect: Rect, pixels_per_point: f32) -> [u32; 2] {
        let pixels = rect.size() * pixels_per_point;
        let shrink =
            (self.largest_edge as f32 / pixels.max_elem().max(1.0)).min(1.0) * self.detail * self.adaptive_scale();
        [pixels.x, pixels.y].map(|edge| ((edge * shrink).round() as u32).clamp(1, self.largest_edge))
    }
}

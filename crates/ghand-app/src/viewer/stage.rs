//! What is on the screen: the picture, its layers, the comparison with the truth, and what the pointer does there.
//!
//! [`Stage`] owns these and the camera. It shows a [`Document`]: of this it changes only the hand's pose, and that only when
//! the user drags a handle.

pub mod adaptive_detail;
pub mod canvas;
pub mod comparison;
pub mod drags;
pub mod layer;
pub mod layer_view;
pub mod legend;
pub mod overlay;
pub mod pace;
pub mod pointer;
pub mod resolution;
pub mod truth_reader;
pub mod truth_view;
pub mod turntable;
pub mod viewport;

use std::time::Instant;

use egui::{Context, Event, Pos2, Rect, Sense, Ui, Vec2};
use ghand_core::Camera;
use ghand_render::{Gpu, RenderError};
use glam::DVec2;

use crate::viewer::document::Document;
use crate::viewer::document::capture_panel::CapturePanel;
use crate::viewer::document::subject::Subject;
use crate::viewer::rendering::drawing::GaussianColors;
use crate::viewer::rendering::frame::PictureInputs;
use crate::viewer::rendering::picture::Progress;
use crate::viewer::rendering::screen::Screen;
use crate::viewer::session::Session;
use crate::viewer::stage::canvas::Canvas;
use crate::viewer::stage::drags::Effect;
use crate::viewer::stage::layer_view::LayerView;
use crate::viewer::stage::pointer::Pointer;
use crate::viewer::stage::truth_view::{TruthView, comparable, image_region};
use crate::viewer::stage::turntable::Turntable;
use crate::viewer::stage::viewport::Viewport;
use crate::viewer::widgets::number_slider::number_slider;
use ghand_avatar::orbit_camera::{OrbitCamera, Projection, ViewPoint};
use ghand_avatar::view_side::ViewSide;

/// Zoom for a scroll of one point; a wheel's notch is about 40.
pub(crate) const ZOOM_PER_POINT: f64 = 0.002;
/// Range of the field of view, degrees: beyond, the near plane cuts the hand, or it needs more distance than there is.
const FIELDS_OF_VIEW: [f64; 2] = [8.0, 90.0];
/// Colour behind the subject in the dark and in the light theme.
pub(crate) const DARK_BACKGROUND: [u8; 3] = [30, 32, 36];
const LIGHT_BACKGROUND: [u8; 3] = [222, 225, 229];

/// What is on the screen.
pub struct Stage {
    pub(in crate::viewer) canvas: Canvas,
    pub(in crate::viewer) camera: OrbitCamera,
    pointer: Pointer,
    turntable: Turntable,
    pub(in crate::viewer) layers: LayerView,
    pub(in crate::viewer) truth: TruthView,
    /// Colour behind the subject; `None` for that of the theme.
    background: Option<[u8; 3]>,
}

/// What is shown.
impl Stage {
    /// The first view of a subject.
    ///
    /// # Errors
    /// [`RenderError`] if the device cannot hold the subject.
    pub fn new(gpu: &Gpu, subject: &Subject) -> Result<Stage, RenderError> {
        Ok(Stage {
            canvas: Canvas::new(gpu, subject)?,
            camera: subject.first_view(),
            pointer: Pointer::default(),
            turntable: Turntable::default(),
            layers: LayerView::default(),
            truth: TruthView::default(),
            background: None,
        })
    }

    /// Shows another subject, if the device can hold it; the view stays.
    ///
    /// # Errors
    /// [`RenderError`] if it cannot; nothing changes then.
    pub fn replace(&mut self, subject: &Subject) -> Result<(), RenderError> {
        self.canvas.replace(subject)?;
        self.pointer.forget_hand();
        self.forget_subject();
        Ok(())
    }

    /// Shows the subject on a new device, because the old one is lost.
    ///
    /// # Errors
    /// [`RenderError`] or why there is no new device.
    pub fn renew(&mut self, subject: &Subject) -> anyhow::Result<()> {
        self.canvas.renew(subject)?;
        self.forget_subject();
        Ok(())
    }

    fn forget_subject(&mut self) {
        self.truth.forget_comparison();
        self.layers.forget_subject();
    }

    /// The device.
    pub fn gpu(&self) -> &Gpu {
        self.canvas.gpu()
    }

    /// Logs how long after `start` the first picture is done.
    pub fn log_start(&mut self, start: Instant) {
        self.canvas.pace_mut().log_start(start);
    }

    /// Whether the picture changes, or is about to.
    pub fn is_working(&self, progress: Progress) -> bool {
        progress == Progress::Busy || self.canvas.shown().is_none() || self.turntable.is_on || self.canvas.is_measured()
    }

    /// Whether the comparison still waits for something.
    pub fn is_comparing(&self, capture: Option<&CapturePanel>) -> bool {
        let pair = self.truth.compared_pair(capture, &self.camera);
        pair.is_some_and(|pair| self.truth.is_busy(pair, self.canvas.shown()))
    }

    /// Whether the view can be compared with an image of the capture.
    pub fn is_comparable(&self, capture: Option<&CapturePanel>) -> bool {
        comparable(capture, &self.camera).is_some()
    }
}

/// The camera.
impl Stage {
    /// The initial view of the subject.
    pub fn reset_view(&mut self, subject: &Subject) {
        self.camera = subject.first_view();
    }

    /// As at the start: view, layers and background.
    pub fn reset(&mut self, subject: &Subject) {
        self.layers.reset();
        self.reset_view(subject);
        self.background = None;
    }

    /// Moves the view so that the subject fills it in its present pose.
    pub fn frame(&mut self, subject: &Subject) {
        match subject {
            Subject::Hand(hand) => self.camera.frame(&hand.posed_vertices()),
            Subject::Scene { .. } => self.reset_view(subject),
        }
    }

    /// Looks at a hand from a side.
    pub fn look_from(&mut self, side: ViewSide, subject: &Subject) {
        if let Subject::Hand(hand) = subject {
            self.camera.look_from(side, hand.model(), &hand.pose);
            self.camera.frame(&hand.posed_vertices());
        }
    }

    /// Looks as the camera of a tracker does, at a subject that may have any orientation.
    pub fn look_as_tracker(&mut self, subject: &Subject) {
        self.camera.look_along_world();
        self.frame(subject);
    }

    /// Shows the view of a calibrated camera, with its target at this depth, metres.
    pub fn look_through(&mut self, camera: &Camera, depth: f64) {
        self.turntable.is_on = false;
        self.camera.show_calibrated(camera, depth);
    }

    /// Shows a saved view.
    pub fn take_view(&mut self, point: &ViewPoint) {
        self.camera.take(point);
        self.turntable.is_on = false;
    }

    /// Gives all depths the same size, or not.
    pub fn switch_projection(&mut self) {
        self.camera.switch_projection();
    }

    /// Whether all depths have the same size.
    pub fn is_orthographic(&self) -> bool {
        self.camera.projection() == Projection::Orthographic
    }

    /// Has the view turn by itself, or not.
    pub fn set_turning(&mut self, is_turning: bool) {
        self.turntable.is_on = is_turning;
    }

    /// Whether the view turns by itself.
    pub fn is_turning(&self) -> bool {
        self.turntable.is_on
    }

    /// Turns the turntable.
    pub fn advance_turntable(&mut self, context: &Context) {
        self.turntable.advance(&mut self.camera, context);
    }
}

/// The controls on the panel.
impl Stage {
    /// The sides of a hand as buttons.
    pub fn side_buttons(&mut self, ui: &mut Ui, subject: &Subject) {
        if subject.pose().is_none() {
            return;
        }
        ui.horizontal_wrapped(|ui| {
            for side in ViewSide::ALL {
                if ui.button(side.label()).clicked() {
                    self.look_from(side, subject);
                }
            }
        });
    }

    /// The controls of the camera and the background.
    pub fn camera_controls(&mut self, ui: &mut Ui, subject: &Subject) {
        ui.horizontal(|ui| {
            let label = ui.label("field of view").id;
            let mut degrees = self.camera.field_of_view().to_degrees();
            ui.spacing_mut().slider_width = 84.0;
            let range = FIELDS_OF_VIEW[0]..=FIELDS_OF_VIEW[1];
            // An orthographic view has none.
            let slider = number_slider(&mut degrees, range, 0, "°");
            if ui.add_enabled(!self.is_orthographic(), slider).labelled_by(label).changed() {
                self.camera.set_field_of_view(degrees.to_radians());
            }
        });
        ui.horizontal(|ui| {
            if ui.button("Frame").on_hover_text("Fill the view with the subject in its present pose (F)").clicked() {
                self.frame(subject);
            }
            ui.checkbox(&mut self.turntable.is_on, "turntable");
            let mut orthographic = self.is_orthographic();
            let hover = "All depths have the same size (O)";
            if ui.checkbox(&mut orthographic, "ortho").on_hover_text(hover).changed() {
                self.camera.switch_projection();
            }
        });
        ui.horizontal(|ui| {
            let mut color = self.background_color(ui);
            if ui.color_edit_button_srgb(&mut color).changed() {
                self.background = Some(color);
            }
            ui.label("background");
        });
    }

    /// The choice of what is compared with the capture's images. Returns whether the user wants the view of the camera.
    pub fn truth_controls(&mut self, ui: &mut Ui, capture: Option<&CapturePanel>) -> bool {
        self.truth.controls(ui, comparable(capture, &self.camera))
    }

    /// The colour behind the subject.
    fn background_color(&self, ui: &Ui) -> [u8; 3] {
        let of_theme = if ui.visuals().dark_mode { DARK_BACKGROUND } else { LIGHT_BACKGROUND };
        self.background.unwrap_or(of_theme)
    }
}

/// A frame.
impl Stage {
    /// Where points of the world are in the view.
    pub fn screen(&self, viewport: &Viewport) -> Screen {
        Screen { rect: viewport.rect, camera: self.camera.camera(self.canvas.size(viewport)) }
    }

    /// Turns, moves and zooms the view and drags handles, as the pointer asks.
    pub fn navigate(&mut self, ui: &mut Ui, viewport: &Viewport, document: &mut Document, handles_shown: bool) {
        let rect = viewport.rect;
        let response = ui.interact(rect, ui.scope_id().with("view"), Sense::click_and_drag());
        let events: Vec<Event> = ui.input(|i| i.events.clone());
        let screen = self.screen(viewport);
        // Ignores presses on a popup over the view.
        let split_line = self.split_line(viewport, document.capture());
        let in_view = |pos: Pos2| {
            rect.contains(pos)
                && ui.ctx().layer_id_at(pos).is_none_or(|layer| layer == ui.layer_id())
                && split_line.is_none_or(|line| !line.contains(pos))
        };
        let hand = document.hand_mut().filter(|_| handles_shown);
        let edge = rect.width().min(rect.height()).into();
        for drag in self.pointer.follow(&events, hand, &screen, in_view) {
            match drag.effect {
                Effect::Turn => self.camera.orbit(points(drag.by)),
                Effect::Move => self.camera.pan(points(drag.by), edge),
                Effect::Handle(landmark) => {
                    document.edit_hand(|hand| self.pointer.drag_handle(hand, landmark, drag.by, &screen));
                }
            }
        }
        self.pointer.release();
        if response.hovered() {
            let (scroll, pinch) = ui.input(|i| (i.smooth_scroll_delta().y, i.zoom_delta()));
            if scroll != 0.0 || pinch != 1.0 {
                let factor = (f64::from(scroll) * ZOOM_PER_POINT).exp() * f64::from(pinch);
                let pointer = response.hover_pos().map_or(Vec2::ZERO, |pos| pos - rect.center());
                self.camera.zoom_at(factor, points(pointer), edge);
            }
        }
        if response.double_clicked() {
            self.reset_view(&document.subject);
        }
    }

    /// What the picture should show now.
    pub fn inputs(&mut self, ui: &Ui, viewport: &Viewport, document: &Document) -> PictureInputs {
        if self.layers.follow(document.avatar()) {
            self.canvas.redraw();
        }
        let camera = self.camera.camera(self.canvas.size(viewport));
        let layer = self.layers.layer(document.avatar());
        let background = (layer.background())
            .or_else(|| self.background_of_truth(document.capture()))
            .unwrap_or_else(|| self.background_color(ui).map(|v| f32::from(v) / 255.0));
        let mut inputs = inputs(&document.subject, camera, background);
        self.canvas.follow(&inputs, ui);
        // Its size may be another one now.
        inputs.camera = self.camera.camera(self.canvas.size(viewport));
        inputs
    }

    /// Begins to render a picture. Returns whether that was possible.
    pub fn render(
        &mut self,
        inputs: PictureInputs,
        viewport: &Viewport,
        document: &Document,
        renderer: &mut egui_wgpu::Renderer,
    ) -> bool {
        let depth = self.camera.apparent_depth();
        let colors: Result<GaussianColors, RenderError> =
            self.layers.colors(&mut self.canvas, &inputs, document.avatar(), depth);
        let begun = colors.and_then(|colors| self.canvas.render(inputs, colors, viewport, renderer));
        let is_begun = begun.is_ok();
        if let Err(failure) = begun {
            self.canvas.fail(failure);
        }
        self.canvas.pace_mut().picture_begun();
        is_begun
    }

    /// Draws the picture and what is over it.
    pub fn paint(&mut self, ui: &mut Ui, viewport: &Viewport, document: &mut Document, session: &mut Session) {
        let rect = viewport.rect;
        self.canvas.paint(ui, rect);
        if let Some(capture) = document.capture() {
            self.paint_truth(ui, viewport, capture, session);
        }
        self.canvas.paint_scale(ui, rect);
        self.canvas.paint_times(ui, rect, session.settings.panel_shown);
        let screen = self.screen(viewport);
        if let Some(hand) = document.hand() {
            self.layers.paint_lines(ui, hand, &screen);
        }
        if !self.shows_difference(document.capture()) {
            self.layers.paint_legend(ui, rect, document.avatar());
        }
        if let Some(hand) = document.hand_mut() {
            self.pointer.paint_handles(ui, hand, &screen, &session.settings);
        }
    }

    /// Draws the truth over the picture, as the comparison asks.
    fn paint_truth(&mut self, ui: &mut Ui, viewport: &Viewport, capture: &CapturePanel, session: &mut Session) {
        let Some(pair) = self.truth.compared_pair(Some(capture), &self.camera) else { return };
        let Some((camera, _)) = capture.chosen() else { return };
        let region = image_region(viewport.rect, self.canvas.size(viewport), camera);
        if let Err(error) = self.truth.read(pair, capture, self.canvas.largest_edge(), ui.ctx()) {
            session.error(&error);
        }
        if let Err(failure) = self.truth.compare_at_rest(pair, camera, &mut self.canvas, ui.ctx()) {
            self.canvas.fail(failure);
        }
        let around = self.background_color(ui);
        self.truth.paint(ui, viewport.rect, region, pair, around);
    }

    /// The place in the view where the line between picture and truth can be taken, if there is one.
    fn split_line(&self, viewport: &Viewport, capture: Option<&CapturePanel>) -> Option<Rect> {
        self.truth.compared_pair(capture, &self.camera)?;
        let (camera, _) = capture?.chosen()?;
        self.truth.split_line(image_region(viewport.rect, self.canvas.size(viewport), camera))
    }

    /// Whether the view shows the difference instead of the picture.
    fn shows_difference(&self, capture: Option<&CapturePanel>) -> bool {
        let pair = self.truth.compared_pair(capture, &self.camera);
        pair.is_some() && self.truth.comparison() == comparison::Comparison::Difference
    }

    /// The colour behind the hand in the capture, display values, while its images are compared.
    fn background_of_truth(&self, capture: Option<&CapturePanel>) -> Option<[f32; 3]> {
        self.truth.compared_pair(capture, &self.camera)?;
        capture.map(|capture| capture.capture().background.map(|v| v as f32))
    }
}

/// Everything that a picture of the subject depends on.
pub fn inputs(subject: &Subject, camera: Camera, background: [f32; 3]) -> PictureInputs {
    PictureInputs {
        pose: subject.pose().cloned(),
        shape: subject.shape().to_vec(),
        light: subject.light().cloned(),
        camera,
        background,
    }
}

fn points(by: Vec2) -> DVec2 {
    DVec2::new(by.x.into(), by.y.into())
}

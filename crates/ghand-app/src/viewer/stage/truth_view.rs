//! Compares the picture with the capture's image while the view is that of a calibrated camera.

use std::time::Duration;

use egui::{
    Align2, Color32, ColorImage, Context, CursorIcon, FontId, Grid, Pos2, Rect, RichText, Sense, Shape, Stroke,
    TextureHandle, TextureOptions, Ui, WidgetInfo,
};
use ghand_measure::metrics::{Psnr, psnr, quantize};

use crate::viewer::app::Viewer;
use crate::viewer::document::capture_panel::CapturePanel;
use crate::viewer::rendering::frame::PictureInputs;
use crate::viewer::stage::comparison::{Comparison, LARGEST_DIFFERENCE, difference_image};
use crate::viewer::stage::legend::Legend;
use crate::viewer::stage::truth_reader::{Pair, TruthReader};
use crate::viewer::widgets::number_slider::number_slider;

/// How long each of picture and truth is shown in turn, seconds.
const FLICKER_SECS: f64 = 0.5;
/// A picture that has not changed for so long is compared with the truth, seconds.
const REST_SECS: f64 = 0.25;
/// A press this near to the line between picture and truth takes it, points.
const LINE_REACH: f32 = 8.0;
/// Colour of the line and of the labels, on a dark edge that is seen on any image.
const LINE_COLOR: Color32 = Color32::WHITE;
const EDGE_COLOR: Color32 = Color32::from_black_alpha(170);

/// The comparison and what it needs.
pub(super) struct TruthView {
    pub(super) comparison: Comparison,
    reader: TruthReader,
    /// The image that was read last, as a texture.
    texture: Option<(Pair, TextureHandle)>,
    /// The part of the image left of the line of the split, in percent.
    split: f64,
    /// The picture that is shown, and since when, in the user interface's seconds.
    resting: Option<(PictureInputs, f64)>,
    compared: Option<Compared>,
}

/// A picture that has been compared with its truth.
struct Compared {
    pair: Pair,
    shown: PictureInputs,
    psnr: Psnr,
    has_mask: bool,
    /// The factor by which the edges of the truth were reduced.
    reduced: f64,
    difference: TextureHandle,
}

impl Default for TruthView {
    fn default() -> Self {
        TruthView {
            comparison: Comparison::Picture,
            reader: TruthReader::default(),
            texture: None,
            split: 50.0,
            resting: None,
            compared: None,
        }
    }
}

impl TruthView {
    /// The camera and the frame whose image is on the screen.
    #[cfg(test)]
    pub(super) fn texture(&self) -> Option<Pair> {
        self.texture.as_ref().map(|(pair, _)| *pair)
    }

    /// As at the start for another capture; the comparison stays.
    pub(super) fn forget_images(&mut self) {
        *self = TruthView { comparison: self.comparison, split: self.split, ..TruthView::default() };
    }

    /// The place where the line of the split can be taken, in an image at this place.
    fn split_line(&self, region: Rect) -> Rect {
        let x = region.left() + 0.01 * self.split as f32 * region.width();
        Rect::from_x_y_ranges(x - LINE_REACH..=x + LINE_REACH, region.y_range())
    }

    /// Makes textures and figures again: for another user interface, or once the subject looks different.
    pub(super) fn forget_comparison(&mut self) {
        (self.texture, self.resting, self.compared) = (None, None, None);
    }
}

impl Viewer {
    /// Chooses what is shown of picture and truth.
    pub fn compare(&mut self, comparison: Comparison) {
        self.truth.comparison = comparison;
    }

    /// Camera and frame whose image can be compared with the view.
    pub(super) fn comparable(&self) -> Option<Pair> {
        let capture = self.capture.as_ref().filter(|_| self.camera.is_calibrated());
        capture.and_then(CapturePanel::chosen_indices)
    }

    /// Camera and frame that are compared now.
    fn compared_pair(&self) -> Option<Pair> {
        self.comparable().filter(|_| self.truth.comparison != Comparison::Picture)
    }

    /// Whether the view shows the difference instead of the picture.
    pub(super) fn shows_difference(&self) -> bool {
        self.truth.comparison == Comparison::Difference && self.compared_pair().is_some()
    }

    /// Waits for an image that is being read.
    pub(super) fn wait_for_truth(&mut self) {
        self.truth.reader.wait();
    }

    /// Whether the comparison still waits for something.
    pub(super) fn comparison_is_busy(&self) -> bool {
        let Some(pair) = self.compared_pair() else { return false };
        let is_done = self.truth.compared.as_ref().is_some_and(|compared| Some(&compared.shown) == self.shown.as_ref());
        self.truth.reader.is_busy() || (self.truth.reader.get(pair).is_some() && !is_done)
    }

    /// The colour behind the hand in the capture, display values, while its images are compared.
    pub(super) fn background_of_truth(&self) -> Option<[f32; 3]> {
        self.compared_pair()?;
        self.capture.as_ref().map(|capture| capture.capture().background.map(|v| v as f32))
    }

    /// The controls, below those of the capture.
    pub(super) fn truth_controls(&mut self, ui: &mut Ui) {
        let is_comparable = self.comparable().is_some();
        ui.add_enabled_ui(is_comparable, |ui| {
            ui.horizontal_wrapped(|ui| {
                for comparison in Comparison::ALL {
                    let chosen = &mut self.truth.comparison;
                    ui.selectable_value(chosen, comparison, comparison.name())
                        .on_hover_text(comparison.summary())
                        .on_disabled_hover_text("The view has moved away from the camera.");
                }
            });
        });
        if !is_comparable {
            if ui.button("Back to the camera").clicked() {
                self.look_through_camera();
            }
            return;
        }
        if self.truth.comparison == Comparison::Split {
            ui.horizontal(|ui| {
                let label = ui.label("split").id;
                ui.spacing_mut().slider_width = 110.0;
                ui.add(number_slider(&mut self.truth.split, 0.0..=100.0, 0, " %")).labelled_by(label);
            });
        }
        if let Some(pair) = self.compared_pair() {
            self.truth_figures(ui, pair);
        }
    }

    fn truth_figures(&self, ui: &mut Ui, pair: Pair) {
        let compared = self.truth.compared.as_ref().filter(|compared| compared.pair == pair);
        let Some(compared) = compared else {
            let text =
                if self.truth.reader.is_busy() { "reading the image ..." } else { "PSNR when the picture rests" };
            ui.label(RichText::new(text).weak());
            return;
        };
        let row = |ui: &mut Ui, name: &str, decibels: f64| {
            ui.label(name);
            ui.label(RichText::new(format!("{decibels:.2} dB")).monospace());
            ui.end_row();
        };
        Grid::new("psnr").num_columns(2).show(ui, |ui| {
            row(ui, "PSNR of the image", compared.psnr.whole);
            if compared.has_mask {
                row(ui, "PSNR on the hand", compared.psnr.hand);
            }
        });
        if compared.reduced < 1.0 {
            let percent = 100.0 * compared.reduced;
            ui.label(RichText::new(format!("compared at {percent:.0} % of the image's size")).weak());
        }
    }

    /// Where the capture's image is in the view: the calibrated camera's picture fits into it.
    fn truth_region(&self, rect: Rect, pixels_per_point: f32) -> Option<Rect> {
        let (camera, _) = self.capture.as_ref()?.chosen()?;
        let [width, height] = self.picture_size(rect, pixels_per_point).map(|edge| edge as f32);
        let (columns, rows) = (camera.width as f32, camera.height as f32);
        let scale = (width / columns).min(height / rows);
        let part = egui::vec2(columns * scale / width, rows * scale / height);
        Some(Rect::from_center_size(rect.center(), part * rect.size()))
    }

    /// The place in the view where the line between picture and truth can be taken, if there is one.
    pub(super) fn split_line(&self, rect: Rect, pixels_per_point: f32) -> Option<Rect> {
        let is_split = self.truth.comparison == Comparison::Split && self.compared_pair().is_some();
        Some(self.truth.split_line(self.truth_region(rect, pixels_per_point).filter(|_| is_split)?))
    }

    /// Draws the truth over the picture, as the comparison asks.
    pub(super) fn draw_truth(&mut self, ui: &mut Ui, rect: Rect) {
        let Some(pair) = self.compared_pair() else { return };
        let context = ui.ctx().clone();
        let Some(region) = self.truth_region(rect, context.pixels_per_point()) else { return };
        self.read_truth(pair, &context);
        self.compare_at_rest(pair, &context);
        let around = self.background(ui);
        for place in around_region(rect, region) {
            ui.painter().rect_filled(place, 0.0, Color32::from_rgb(around[0], around[1], around[2]));
        }
        let Some(truth) = self.truth.texture.as_ref().filter(|(of, _)| *of == pair).map(|(_, texture)| texture.id())
        else {
            return;
        };
        let whole = Rect::from_min_max(egui::pos2(0.0, 0.0), egui::pos2(1.0, 1.0));
        match self.truth.comparison {
            Comparison::Picture => {}
            Comparison::Truth => {
                ui.painter().image(truth, region, whole, Color32::WHITE);
                tag(ui, region.left_top(), Align2::LEFT_TOP, "truth");
            }
            Comparison::Split => self.draw_split(ui, region, truth),
            Comparison::Flicker => {
                let time = context.input(|input| input.time) / FLICKER_SECS;
                if time.rem_euclid(2.0) < 1.0 {
                    tag(ui, region.left_top(), Align2::LEFT_TOP, "picture");
                } else {
                    ui.painter().image(truth, region, whole, Color32::WHITE);
                    tag(ui, region.left_top(), Align2::LEFT_TOP, "truth");
                }
                let rest = (1.0 - time.rem_euclid(1.0)) * FLICKER_SECS;
                context.request_repaint_after(Duration::from_secs_f64(rest.max(0.01)));
            }
            Comparison::Difference => {
                let Some(compared) = self.truth.compared.as_ref().filter(|compared| compared.pair == pair) else {
                    return;
                };
                ui.painter().image(compared.difference.id(), region, whole, Color32::WHITE);
                Legend::linear("|picture - truth|, display values", [0.0, LARGEST_DIFFERENCE], true).show(ui, rect);
            }
        }
    }

    fn draw_split(&mut self, ui: &mut Ui, region: Rect, truth: egui::TextureId) {
        let line = self.truth.split_line(region);
        let response = ui.interact(line, ui.scope_id().with("split"), Sense::drag());
        response.widget_info(|| WidgetInfo::slider(true, self.truth.split, "Line between picture and truth"));
        if let Some(pointer) = response.interact_pointer_pos().filter(|_| response.dragged()) {
            let part = (pointer.x - region.left()) / region.width();
            self.truth.split = f64::from(100.0 * part.clamp(0.0, 1.0));
        }
        if response.hovered() || response.dragged() {
            ui.ctx().set_cursor_icon(CursorIcon::ResizeHorizontal);
        }
        let x = self.truth.split_line(region).center().x;
        let part = 0.01 * self.truth.split as f32;
        let right = Rect::from_min_max(egui::pos2(x, region.top()), region.max);
        let uv = Rect::from_min_max(egui::pos2(part, 0.0), egui::pos2(1.0, 1.0));
        ui.painter().image(truth, right, uv, Color32::WHITE);
        tag(ui, region.left_top(), Align2::LEFT_TOP, "picture");
        tag(ui, region.right_top(), Align2::RIGHT_TOP, "truth");
        let painter = ui.painter();
        painter.vline(x, region.y_range(), Stroke::new(4.0, EDGE_COLOR));
        painter.vline(x, region.y_range(), Stroke::new(2.0, LINE_COLOR));
        let middle = egui::pos2(x, region.center().y);
        painter.circle(middle, 9.0, LINE_COLOR, Stroke::new(1.5, EDGE_COLOR));
        for side in [-1.0, 1.0] {
            let point = |along: f32, across: f32| middle + egui::vec2(side * along, across);
            let arrow = vec![point(6.5, 0.0), point(2.5, -3.5), point(2.5, 3.5)];
            painter.add(Shape::convex_polygon(arrow, Color32::from_gray(40), Stroke::NONE));
        }
    }

    /// Reads the image of a pair, and makes a texture of it.
    fn read_truth(&mut self, pair: Pair, context: &Context) {
        let Some(capture) = self.capture.as_ref().map(CapturePanel::capture) else { return };
        if let Err(error) = self.truth.reader.request(capture, pair, self.largest_edge, context) {
            self.toasts.error(&error);
        }
        if self.truth.texture.as_ref().is_some_and(|(of, _)| *of == pair) {
            return;
        }
        self.truth.texture = self.truth.reader.get(pair).map(|truth| {
            let color = |&[r, g, b, _]: &[u8; 4]| Color32::from_rgb(r, g, b);
            let pixels = truth.view.rgba.iter().map(color).collect();
            let image = ColorImage::new(truth.size().map(|edge| edge as usize), pixels);
            (pair, context.load_texture("truth", image, TextureOptions::LINEAR))
        });
    }

    /// Compares the picture with the truth, pixel by pixel of the truth, once the picture has not changed for a while.
    fn compare_at_rest(&mut self, pair: Pair, context: &Context) {
        let now = context.input(|input| input.time);
        let Some(shown) = &self.shown else { return };
        let since = match &self.truth.resting {
            Some((resting, since)) if resting == shown => *since,
            _ => {
                self.truth.resting = Some((shown.clone(), now));
                now
            }
        };
        let is_known = |compared: &Compared| compared.pair == pair && compared.shown == *shown;
        let Some(truth) = self.truth.reader.get(pair) else { return };
        if self.truth.compared.as_ref().is_some_and(is_known) {
            return;
        }
        if now < since + REST_SECS || self.picture.is_busy() {
            context.request_repaint_after(Duration::from_secs_f64((since + REST_SECS - now).max(0.01)));
            return;
        }
        let Some((camera, _)) = self.capture.as_ref().and_then(CapturePanel::chosen) else { return };
        let [width, height] = truth.size();
        let inputs = PictureInputs { camera: camera.resized(width, height), ..shown.clone() };
        match self.picture.read(&self.gpu, &inputs) {
            Ok(picture) => {
                let picture: Vec<[u8; 3]> = picture.into_iter().map(quantize).collect();
                let difference = difference_image(truth.size(), &picture, &truth.view.rgba);
                self.truth.compared = Some(Compared {
                    pair,
                    shown: shown.clone(),
                    psnr: psnr(&picture, &truth.view.rgba),
                    has_mask: truth.has_mask(),
                    reduced: truth.reduced,
                    difference: context.load_texture("difference", difference, TextureOptions::LINEAR),
                });
                context.request_repaint();
            }
            Err(error) => self.failure = Some(error),
        }
    }
}

/// What is around a region of a rectangle.
fn around_region(rect: Rect, region: Rect) -> [Rect; 4] {
    [
        Rect::from_min_max(rect.min, egui::pos2(rect.right(), region.top())),
        Rect::from_min_max(egui::pos2(rect.left(), region.bottom()), rect.max),
        Rect::from_min_max(rect.min, egui::pos2(region.left(), rect.bottom())),
        Rect::from_min_max(egui::pos2(region.right(), rect.top()), rect.max),
    ]
}

/// A word in a corner of an image.
pub(super) fn tag(ui: &Ui, corner: Pos2, align: Align2, text: &str) {
    let offset = egui::vec2(if align == Align2::LEFT_TOP { 14.0 } else { -14.0 }, 12.0);
    let font = FontId::proportional(13.0);
    let galley = ui.painter().layout_no_wrap(text.into(), font, LINE_COLOR);
    let place = align.anchor_size(corner + offset, galley.size());
    ui.painter().rect_filled(place.expand2(egui::vec2(6.0, 3.0)), 4.0, EDGE_COLOR);
    ui.painter().galley(place.min, galley, LINE_COLOR);
}

//! Compares the picture with the capture's image while the view is that of a calibrated camera.
//!
//! [`TruthView`] owns the choice, the image and the figures. It reads the picture, but changes only what is drawn over it.

use std::time::Duration;

use clap::ValueEnum;
use egui::{
    Align2, Color32, ColorImage, Context, CursorIcon, Grid, Rect, RichText, Sense, Shape, Stroke, TextureHandle,
    TextureId, TextureOptions, Ui, WidgetInfo,
};
use ghand_core::Camera;
use ghand_measure::metrics::{Psnr, psnr};
use ghand_pictures::{Background, Picture};
use ghand_render::RenderError;

use crate::cli::choice_name;
use crate::viewer::document::capture_panel::CapturePanel;
use crate::viewer::rendering::drawing::GaussianColors;
use crate::viewer::rendering::frame::PictureInputs;
use crate::viewer::stage::canvas::Canvas;
use crate::viewer::stage::comparison::{Comparison, LARGEST_DIFFERENCE, difference_image};
use crate::viewer::stage::legend::Legend;
use crate::viewer::stage::truth_reader::{Pair, TruthReader};
use crate::viewer::widgets::corner_label::{EDGE_COLOR, LINE_COLOR, corner_label};
use crate::viewer::widgets::number_slider::number_slider;
use ghand_avatar::orbit_camera::OrbitCamera;

/// How long each of picture and truth is shown in turn, seconds.
const FLICKER_SECS: f64 = 0.5;
/// A picture that has not changed for so long is compared with the truth, seconds.
const REST_SECS: f64 = 0.25;
/// A press this near to the line between picture and truth takes it, points.
const LINE_REACH: f32 = 8.0;

/// The comparison and what it needs.
pub struct TruthView {
    comparison: Comparison,
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

/// Camera and frame whose image can be compared with the view.
pub fn comparable(capture: Option<&CapturePanel>, camera: &OrbitCamera) -> Option<Pair> {
    capture.filter(|_| camera.is_calibrated()).and_then(CapturePanel::chosen_indices)
}

impl TruthView {
    /// The camera and the frame whose image is on the screen.
    #[cfg(test)]
    pub(crate) fn texture(&self) -> Option<Pair> {
        self.texture.as_ref().map(|(pair, _)| *pair)
    }

    /// Chooses what is shown of picture and truth.
    pub fn choose(&mut self, comparison: Comparison) {
        self.comparison = comparison;
    }

    /// What is shown of picture and truth.
    pub fn comparison(&self) -> Comparison {
        self.comparison
    }

    /// As at the start for another capture; the comparison stays.
    pub fn forget_images(&mut self) {
        *self = TruthView { comparison: self.comparison, split: self.split, ..TruthView::default() };
    }

    /// Makes textures and figures again: for another user interface, or once the subject looks different.
    pub fn forget_comparison(&mut self) {
        (self.texture, self.resting, self.compared) = (None, None, None);
    }

    /// Camera and frame that are compared now.
    pub fn compared_pair(&self, capture: Option<&CapturePanel>, camera: &OrbitCamera) -> Option<Pair> {
        comparable(capture, camera).filter(|_| self.comparison != Comparison::Picture)
    }

    /// Waits for an image that is being read.
    pub fn wait(&self) {
        self.reader.wait();
    }

    /// Whether the comparison with the image of this pair still waits for something.
    pub fn is_busy(&self, pair: Pair, shown: Option<&PictureInputs>) -> bool {
        let is_done = self.compared.as_ref().is_some_and(|compared| Some(&compared.shown) == shown);
        self.reader.is_busy() || (self.reader.get(pair).is_some() && !is_done)
    }

    /// The controls, below those of the capture. Returns whether the user wants the view of the camera.
    pub fn controls(&mut self, ui: &mut Ui, comparable: Option<Pair>) -> bool {
        ui.add_enabled_ui(comparable.is_some(), |ui| {
            ui.horizontal_wrapped(|ui| {
                for &comparison in Comparison::value_variants() {
                    ui.selectable_value(&mut self.comparison, comparison, choice_name(comparison))
                        .on_hover_text(comparison.summary())
                        .on_disabled_hover_text("The view has moved away from the camera.");
                }
            });
        });
        let Some(pair) = comparable else { return ui.button("Back to the camera").clicked() };
        if self.comparison == Comparison::Split {
            ui.horizontal(|ui| {
                let label = ui.label("split").id;
                ui.spacing_mut().slider_width = 110.0;
                ui.add(number_slider(&mut self.split, 0.0..=100.0, 0, " %")).labelled_by(label);
            });
        }
        if self.comparison != Comparison::Picture {
            self.figures(ui, pair);
        }
        false
    }

    fn figures(&self, ui: &mut Ui, pair: Pair) {
        let compared = self.compared.as_ref().filter(|compared| compared.pair == pair);
        let Some(compared) = compared else {
            let text = if self.reader.is_busy() { "reading the image ..." } else { "PSNR when the picture rests" };
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

    /// The place where the line of the split can be taken, in an image at this place.
    fn line(&self, region: Rect) -> Rect {
        let x = region.left() + 0.01 * self.split as f32 * region.width();
        Rect::from_x_y_ranges(x - LINE_REACH..=x + LINE_REACH, region.y_range())
    }

    /// The place where the line between picture and truth can be taken, in an image at this place, if there is one.
    pub fn split_line(&self, region: Rect) -> Option<Rect> {
        (self.comparison == Comparison::Split).then(|| self.line(region))
    }

    /// Draws the truth of a pair over the picture in `rect`, as the comparison asks; `around` is the colour beside the image,
    /// which is in `region`.
    pub fn paint(&mut self, ui: &mut Ui, rect: Rect, region: Rect, pair: Pair, around: [u8; 3]) {
        for place in around_region(rect, region) {
            ui.painter().rect_filled(place, 0.0, Color32::from_rgb(around[0], around[1], around[2]));
        }
        let Some(truth) = self.texture.as_ref().filter(|(of, _)| *of == pair).map(|(_, texture)| texture.id()) else {
            return;
        };
        let whole = Rect::from_min_max(egui::pos2(0.0, 0.0), egui::pos2(1.0, 1.0));
        match self.comparison {
            Comparison::Picture => {}
            Comparison::Truth => {
                ui.painter().image(truth, region, whole, Color32::WHITE);
                corner_label(ui, region.left_top(), Align2::LEFT_TOP, "truth");
            }
            Comparison::Split => self.draw_split(ui, region, truth),
            Comparison::Flicker => {
                let time = ui.input(|input| input.time) / FLICKER_SECS;
                if time.rem_euclid(2.0) < 1.0 {
                    corner_label(ui, region.left_top(), Align2::LEFT_TOP, "picture");
                } else {
                    ui.painter().image(truth, region, whole, Color32::WHITE);
                    corner_label(ui, region.left_top(), Align2::LEFT_TOP, "truth");
                }
                let rest = (1.0 - time.rem_euclid(1.0)) * FLICKER_SECS;
                ui.ctx().request_repaint_after(Duration::from_secs_f64(rest.max(0.01)));
            }
            Comparison::Difference => {
                let Some(compared) = self.compared.as_ref().filter(|compared| compared.pair == pair) else {
                    return;
                };
                ui.painter().image(compared.difference.id(), region, whole, Color32::WHITE);
                Legend::linear("|picture - truth|, display values", [0.0, LARGEST_DIFFERENCE], true).show(ui, rect);
            }
        }
    }

    fn draw_split(&mut self, ui: &mut Ui, region: Rect, truth: TextureId) {
        let line = self.line(region);
        let response = ui.interact(line, ui.scope_id().with("split"), Sense::drag());
        response.widget_info(|| WidgetInfo::slider(true, self.split, "Line between picture and truth"));
        if let Some(pointer) = response.interact_pointer_pos().filter(|_| response.dragged()) {
            let part = (pointer.x - region.left()) / region.width();
            self.split = f64::from(100.0 * part.clamp(0.0, 1.0));
        }
        if response.hovered() || response.dragged() {
            ui.ctx().set_cursor_icon(CursorIcon::ResizeHorizontal);
        }
        let x = self.line(region).center().x;
        let part = 0.01 * self.split as f32;
        let right = Rect::from_min_max(egui::pos2(x, region.top()), region.max);
        let uv = Rect::from_min_max(egui::pos2(part, 0.0), egui::pos2(1.0, 1.0));
        ui.painter().image(truth, right, uv, Color32::WHITE);
        corner_label(ui, region.left_top(), Align2::LEFT_TOP, "picture");
        corner_label(ui, region.right_top(), Align2::RIGHT_TOP, "truth");
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

    /// Reads the image of a pair, and makes a texture of it. Images with edges of more than `largest_edge` pixels are reduced.
    ///
    /// # Errors
    /// Once, one sentence that names the file that is missing or broken.
    pub fn read(
        &mut self,
        pair: Pair,
        capture: &CapturePanel,
        largest_edge: u32,
        context: &Context,
    ) -> anyhow::Result<()> {
        let read = self.reader.request(capture.capture(), pair, largest_edge, context);
        if self.texture.as_ref().is_none_or(|(of, _)| *of != pair) {
            self.texture = self.reader.get(pair).map(|truth| {
                let color = |&[r, g, b, _]: &[u8; 4]| Color32::from_rgb(r, g, b);
                let pixels = truth.view.rgba.iter().map(color).collect();
                let image = ColorImage::new(truth.size().map(|edge| edge as usize), pixels);
                (pair, context.load_texture("truth", image, TextureOptions::LINEAR))
            });
        }
        read
    }

    /// Compares the picture of this camera with the truth, pixel by pixel of the truth, once the picture has not changed for a
    /// while.
    ///
    /// # Errors
    /// [`RenderError`] if the device failed or was lost.
    pub fn compare_at_rest(
        &mut self,
        pair: Pair,
        camera: &Camera,
        canvas: &mut Canvas,
        context: &Context,
    ) -> Result<(), RenderError> {
        let now = context.input(|input| input.time);
        let Some(shown) = canvas.shown() else { return Ok(()) };
        let since = match &self.resting {
            Some((resting, since)) if resting == shown => *since,
            _ => {
                self.resting = Some((shown.clone(), now));
                now
            }
        };
        let is_known = |compared: &Compared| compared.pair == pair && compared.shown == *shown;
        let Some(truth) = self.reader.get(pair) else { return Ok(()) };
        if self.compared.as_ref().is_some_and(is_known) {
            return Ok(());
        }
        if now < since + REST_SECS || canvas.is_busy() {
            context.request_repaint_after(Duration::from_secs_f64((since + REST_SECS - now).max(0.01)));
            return Ok(());
        }
        let [width, height] = truth.size();
        let shown = shown.clone();
        let picture = drawn(canvas, &PictureInputs { camera: camera.resized(width, height), ..shown.clone() })?;
        let difference = difference_image(truth.size(), &picture, &truth.view.rgba);
        self.compared = Some(Compared {
            pair,
            shown,
            psnr: psnr(&picture, &truth.view.rgba),
            has_mask: truth.has_mask(),
            reduced: truth.reduced,
            difference: context.load_texture("difference", difference, TextureOptions::LINEAR),
        });
        context.request_repaint();
        Ok(())
    }
}

/// A picture beside the one on the canvas, which must not be busy: row-major 8-bit display values.
pub(crate) fn drawn(canvas: &mut Canvas, inputs: &PictureInputs) -> Result<Vec<[u8; 3]>, RenderError> {
    let size = [inputs.camera.width, inputs.camera.height];
    let mut picture = Picture::bytes(size, Background::Color(inputs.background));
    let (gpu, drawing) = canvas.drawing();
    drawing.fill(gpu, inputs, &GaussianColors::Own, &mut picture)?;
    Ok(picture.to_rgba8().into_iter().map(|[r, g, b, _]| [r, g, b]).collect())
}

/// Where an image of a calibrated camera is in a view whose picture has this size: it fits into it.
pub fn image_region(rect: Rect, size: [u32; 2], camera: &Camera) -> Rect {
    let [width, height] = size.map(|edge| edge as f32);
    let (columns, rows) = (camera.width as f32, camera.height as f32);
    let scale = (width / columns).min(height / rows);
    let part = egui::vec2(columns * scale / width, rows * scale / height);
    Rect::from_center_size(rect.center(), part * rect.size())
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

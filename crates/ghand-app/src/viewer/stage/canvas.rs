//! The picture that the view shows: when it is rendered, its size, its figures, and what went wrong with it.
//!
//! [`Canvas`] owns the device and the picture on it. It does not know why a picture shows what it shows.

use std::time::Duration;

use egui::{Align, Align2, Area, Color32, FontId, Frame, Id, Layout, Rect, RichText, TextureId, Ui, vec2};
use ghand_render::{Gpu, RenderError};

use crate::viewer::document::subject::Subject;
use crate::viewer::rendering::drawing::{Drawing, GaussianColors};
use crate::viewer::rendering::frame::PictureInputs;
use crate::viewer::rendering::picture::{Picture, Progress};
use crate::viewer::stage::pace::Pace;
use crate::viewer::stage::resolution::{Change, Resolution};
use crate::viewer::stage::viewport::Viewport;
use crate::viewer::widgets::corner_label::corner_label;

/// Width of the plot of times, points.
const TIMES_WIDTH: f32 = 260.0;

/// The picture and the device.
pub struct Canvas {
    gpu: Gpu,
    picture: Picture,
    resolution: Resolution,
    pace: Pace,
    /// What the picture shows, if it is complete or in progress.
    shown: Option<PictureInputs>,
    texture: Option<TextureId>,
    failure: Option<RenderError>,
}

impl Canvas {
    /// A picture of a subject.
    ///
    /// # Errors
    /// [`RenderError`] if the device cannot hold the subject.
    pub fn new(gpu: &Gpu, subject: &Subject) -> Result<Canvas, RenderError> {
        let resolution = Resolution::new(gpu.is_cpu());
        Ok(Canvas {
            picture: picture_of(gpu, subject, &resolution)?,
            gpu: gpu.clone(),
            resolution,
            pace: Pace::default(),
            shown: None,
            texture: None,
            failure: None,
        })
    }

    /// Shows another subject, if the device can hold it.
    ///
    /// # Errors
    /// [`RenderError`] if it cannot; nothing changes then.
    pub fn replace(&mut self, subject: &Subject) -> Result<(), RenderError> {
        self.picture = picture_of(&self.gpu, subject, &self.resolution)?;
        (self.shown, self.failure) = (None, None);
        self.resolution.forget_limits();
        Ok(())
    }

    /// Shows the subject on a new device, because the old one is lost.
    ///
    /// # Errors
    /// [`RenderError`] or why there is no new device.
    pub fn renew(&mut self, subject: &Subject) -> anyhow::Result<()> {
        self.gpu = self.gpu.reopen()?;
        self.replace(subject)?;
        self.texture = None;
        self.pace.forget();
        Ok(())
    }

    /// The device.
    pub fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    /// What the picture shows, if it is complete or in progress.
    pub fn shown(&self) -> Option<&PictureInputs> {
        self.shown.as_ref()
    }

    /// Has the picture rendered again.
    pub fn redraw(&mut self) {
        self.shown = None;
    }

    /// Shows instead of the picture why there is none.
    pub fn fail(&mut self, failure: RenderError) {
        self.failure = Some(failure);
    }

    /// Why there is no picture; it is forgotten with this.
    pub fn take_failure(&mut self) -> Option<RenderError> {
        self.failure.take()
    }

    /// Times between pictures.
    pub fn pace_mut(&mut self) -> &mut Pace {
        &mut self.pace
    }

    /// Renders pictures all the time, to measure how fast that is, or stops.
    pub fn set_measured(&mut self, is_measured: bool) {
        self.picture.clear_times();
        self.pace.set_measured(is_measured);
    }

    /// Whether pictures are rendered all the time.
    pub fn is_measured(&self) -> bool {
        self.pace.is_measured()
    }

    /// Whether a picture is done since the device is a new one.
    pub fn has_times(&self) -> bool {
        self.picture.frame_ms().is_some()
    }

    /// Whether a picture is being rendered.
    pub fn is_busy(&self) -> bool {
        self.picture.is_busy()
    }

    /// Longest edge of a picture, pixels.
    pub fn largest_edge(&self) -> u32 {
        self.resolution.largest_edge()
    }

    /// Columns and rows of the last picture.
    pub fn texture_size(&self) -> Option<[u32; 2]> {
        self.picture.texture().map(|texture| [texture.width(), texture.height()])
    }

    /// Columns and rows of the next picture.
    pub fn size(&self, viewport: &Viewport) -> [u32; 2] {
        self.resolution.size(viewport.rect.size() * viewport.pixels_per_point, self.is_adaptive(viewport))
    }

    /// Whether a changing picture may have fewer pixels. Times are measured of whole pictures.
    fn is_adaptive(&self, viewport: &Viewport) -> bool {
        viewport.adaptive && !self.is_measured()
    }

    /// Handles a finished picture.
    pub fn collect(&mut self) -> Progress {
        let was_busy = self.picture.is_busy();
        let progress = self.picture.poll(&self.gpu).unwrap_or_else(|e| {
            self.failure.get_or_insert(e);
            Progress::Complete
        });
        let wanted = self.picture.intersections();
        if was_busy && progress == Progress::Complete {
            self.resolution.took(self.picture.last_ms());
            self.pace.picture_done();
        }
        match progress {
            Progress::Busy => {}
            Progress::Incomplete => self.shown = None,
            Progress::TooFine if self.resolution.coarsen(wanted) => self.shown = None,
            Progress::TooFine => {
                let problem = format!("the view needs {wanted} tile intersections, more than the device can hold");
                self.failure.get_or_insert(RenderError::Invalid(problem));
            }
            Progress::Complete => self.resolution.refine(wanted),
        }
        progress
    }

    /// Follows whether the picture changes.
    pub fn follow(&mut self, inputs: &PictureInputs, ui: &Ui) {
        match self.resolution.follow(inputs, ui.input(|input| input.time)) {
            Change::None(left) => {
                if let Some(left) = left {
                    ui.ctx().request_repaint_after(Duration::from_secs_f64(left.max(0.01)));
                }
            }
            Change::First => {}
            // Another picture may be possible.
            Change::Other => self.failure = None,
        }
    }

    /// Whether another picture must be rendered to show this.
    pub fn is_outdated(&self, inputs: &PictureInputs) -> bool {
        self.failure.is_none() && (self.is_measured() || self.shown.as_ref() != Some(inputs))
    }

    /// Begins to render a picture in these colours.
    ///
    /// # Errors
    /// [`RenderError`] if the device failed or was lost, or the inputs do not fit.
    pub fn render(
        &mut self,
        inputs: PictureInputs,
        colors: GaussianColors,
        viewport: &Viewport,
        renderer: &mut egui_wgpu::Renderer,
    ) -> Result<(), RenderError> {
        self.picture.colors = colors;
        if self.picture.render(&self.gpu, &inputs)? {
            self.show_texture(renderer);
        }
        self.resolution.picture_begun(self.is_adaptive(viewport));
        self.shown = Some(inputs);
        Ok(())
    }

    fn show_texture(&mut self, renderer: &mut egui_wgpu::Renderer) {
        let Some(view) = self.picture.view() else { return };
        let device = &self.gpu.device;
        let filter = wgpu::FilterMode::Linear;
        match self.texture {
            Some(id) => renderer.update_egui_texture_from_wgpu_texture(device, view, filter, id),
            None => self.texture = Some(renderer.register_native_texture(device, view, filter)),
        }
    }

    /// The colours of Gaussians in the last picture.
    pub fn colors(&self) -> &GaussianColors {
        &self.picture.colors
    }

    /// The device and the subject on it, to read it or to draw it beside the picture.
    pub fn drawing(&mut self) -> (&Gpu, &mut Drawing) {
        (&self.gpu, &mut self.picture.drawing)
    }

    /// Draws the picture.
    pub fn paint(&self, ui: &Ui, rect: Rect) {
        if let Some(texture) = self.texture {
            let whole = Rect::from_min_max(egui::pos2(0.0, 0.0), egui::pos2(1.0, 1.0));
            ui.painter().image(texture, rect, whole, Color32::WHITE);
        }
    }

    /// Says in the corner that the picture has fewer pixels for now.
    pub fn paint_scale(&self, ui: &Ui, rect: Rect) {
        let scale = self.resolution.drawn_scale();
        if scale < 1.0 {
            let text = format!("{:.0} % resolution while it moves", 100.0 * scale);
            corner_label(ui, rect.right_top(), Align2::RIGHT_TOP, &text);
        }
    }

    /// Says why there is no picture.
    pub fn paint_failure(&self, ui: &Ui, rect: Rect) {
        if let Some(failure) = &self.failure {
            let text = failure.to_string();
            let font = FontId::proportional(15.0);
            ui.painter().text(rect.center(), Align2::CENTER_CENTER, text, font, ui.visuals().error_fg_color);
        }
    }

    /// Shows over the view the times of the pictures that are measured, where they are seen however far the panel is scrolled.
    pub fn paint_times(&self, ui: &Ui, view: Rect, panel_shown: bool) {
        if !self.is_measured() {
            return;
        }
        let at = view.left_top() + if panel_shown { vec2(12.0, 12.0) } else { vec2(12.0, 44.0) };
        let area = Area::new(Id::unique("times")).fixed_pos(at).interactable(false);
        area.show(ui.ctx(), |ui| {
            let fill = ui.visuals().window_fill().gamma_multiply(0.92);
            Frame::popup(ui.style()).fill(fill).inner_margin(10.0).show(ui, |ui| {
                ui.set_width(TIMES_WIDTH.min(view.width() - 44.0));
                let median = self.picture.frame_ms().map_or("-".to_owned(), |ms| format!("{ms:.1} ms"));
                ui.label(format!("Picture: median {median}"));
                self.picture.times().show(ui);
                let (parts, count) = self.picture.subject_size();
                ui.label(RichText::new(format!("{}, {} {parts}", self.gpu.info.name, thousands(count))).weak());
            });
        });
    }

    /// The figures of the picture, on the panel.
    pub fn figures(&mut self, ui: &mut Ui) {
        let row = |ui: &mut Ui, name: &str, value: String| {
            ui.horizontal(|ui| {
                ui.label(name);
                ui.with_layout(Layout::right_to_left(Align::Center), |ui| ui.label(RichText::new(value).monospace()));
            });
        };
        let ms = |time: Option<f64>| time.map_or("-".to_owned(), |t| format!("{t:.1} ms"));
        row(ui, "Picture", ms(self.picture.frame_ms()));
        if self.is_measured() {
            row(ui, "Frame to frame", ms(self.pace.between_frames_ms()));
        }
        let (parts, count) = self.picture.subject_size();
        row(ui, parts, thousands(count));
        if self.picture.broken() > 0 {
            row(ui, "Skipped (not finite)", thousands(self.picture.broken() as usize));
        }
        if let Some([width, height]) = self.texture_size() {
            row(ui, "Pixels", format!("{width} x {height}"));
        }
        ui.label(RichText::new(&self.gpu.info.name).weak());
        let hover = "Renders continuously. Both times are medians of the last 60 pictures: the device's time per \
                     picture, and the time between pictures.";
        let mut is_measured = self.is_measured();
        if ui.checkbox(&mut is_measured, "measure").on_hover_text(hover).changed() {
            self.set_measured(is_measured);
        }
    }
}

fn picture_of(gpu: &Gpu, subject: &Subject, resolution: &Resolution) -> Result<Picture, RenderError> {
    Picture::new(gpu, subject.drawn().on_device(gpu, [resolution.largest_edge(); 2])?)
}

/// A number with its digits in groups of three.
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
impl Canvas {
    /// The picture.
    pub(crate) fn picture(&self) -> &Picture {
        &self.picture
    }

    /// The picture's size.
    pub(crate) fn resolution_mut(&mut self) -> &mut Resolution {
        &mut self.resolution
    }

    /// Why there is no picture.
    pub(crate) fn failure(&self) -> Option<&RenderError> {
        self.failure.as_ref()
    }

    /// When the last picture was begun.
    pub(crate) fn last_frame(&self) -> Option<std::time::Instant> {
        self.pace.last_frame()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn large_numbers_are_grouped() {
        assert_eq!([0, 999, 1000, 22010, 1234567].map(thousands), ["0", "999", "1,000", "22,010", "1,234,567"]);
    }
}

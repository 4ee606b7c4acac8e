//! The panel beside the view.

use egui::{Align, Area, Frame, Id, Layout, Rect, RichText, Ui, vec2};

use crate::viewer::app::{DARK_BACKGROUND, LIGHT_BACKGROUND, Viewer};

/// Width of the plot of times, points.
const TIMES_WIDTH: f32 = 260.0;

impl Viewer {
    /// The panel's content.
    pub(super) fn controls(&mut self, ui: &mut Ui) {
        ui.heading(self.subject.name());
        ui.label(RichText::new(&self.source).weak());
        ui.separator();
        if let Some(run) = &self.run {
            run.show(ui);
            ui.separator();
        }
        self.live_controls(ui);
        self.capture_controls(ui);
        self.layer_controls(ui);
        if self.subject.controls(ui) {
            ui.separator();
        }

        ui.label(RichText::new("View").strong());
        self.camera_controls(ui);
        ui.horizontal(|ui| {
            let mut color = self.background(ui);
            if ui.color_edit_button_srgb(&mut color).changed() {
                self.background = Some(color);
            }
            ui.label("background");
        });
        ui.horizontal(|ui| {
            if ui.button("Reset view").clicked() {
                self.reset_view();
            }
            if ui.button("Reset all").clicked() {
                self.reset_all();
            }
        });
        let hint = "Drag to rotate, right-drag to move, scroll to zoom. F1 lists all keys.";
        ui.label(RichText::new(hint).weak());
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
            self.clear_times();
        }
    }

    /// Shows over the view the times of the pictures that are measured, where they are seen however far the panel is scrolled.
    pub(super) fn draw_times(&self, ui: &Ui, view: Rect) {
        if !self.measure {
            return;
        }
        let at = view.left_top() + if self.settings.panel_shown { vec2(12.0, 12.0) } else { vec2(12.0, 44.0) };
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

    /// The colour behind the subject.
    pub(super) fn background(&self, ui: &Ui) -> [u8; 3] {
        let of_theme = if ui.visuals().dark_mode { DARK_BACKGROUND } else { LIGHT_BACKGROUND };
        self.background.unwrap_or(of_theme)
    }

    /// Forgets the times so far.
    pub(super) fn clear_times(&mut self) {
        self.picture.clear_times();
        self.between_frames_ms.clear();
        self.last_frame = None;
    }

    /// Everything as at the start.
    pub(super) fn reset_all(&mut self) {
        self.subject.reset();
        self.layers.reset();
        self.reset_view();
        self.background = None;
    }

    /// The initial view of the subject.
    pub(super) fn reset_view(&mut self) {
        self.camera = self.subject.first_view();
    }
}

/// A number with its digits in groups of three.
pub(super) fn thousands(number: usize) -> String {
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

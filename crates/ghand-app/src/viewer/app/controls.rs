//! The panel beside the view.

use egui::{RichText, Ui};

use crate::viewer::app::Viewer;

impl Viewer {
    /// The panel's content.
    pub(super) fn controls(&mut self, ui: &mut Ui) {
        self.document.heading(ui);
        self.live.controls(ui);
        self.capture_controls(ui);
        if let Some(hand) = self.document.hand() {
            self.stage.layers.controls(ui, hand);
        }
        if self.document.subject.controls(ui) {
            ui.separator();
        }

        ui.label(RichText::new("View").strong());
        self.stage.side_buttons(ui, &self.document.subject);
        self.saved_views(ui);
        self.stage.camera_controls(ui, &self.document.subject);
        ui.horizontal(|ui| {
            if ui.button("Reset view").clicked() {
                self.stage.reset_view(&self.document.subject);
            }
            if ui.button("Reset all").clicked() {
                self.reset_all();
            }
        });
        let hint = "Drag to rotate, right-drag to move, scroll to zoom. F1 lists all keys.";
        ui.label(RichText::new(hint).weak());
        ui.separator();
        self.stage.canvas.figures(ui);
    }

    /// The controls of a capture, if there is one.
    fn capture_controls(&mut self, ui: &mut Ui) {
        if self.document.capture().is_none() {
            return;
        }
        if self.document.capture_controls(ui) {
            self.look_through_camera();
        }
        if self.stage.truth_controls(ui, self.document.capture()) {
            self.look_through_camera();
        }
        ui.separator();
    }
}

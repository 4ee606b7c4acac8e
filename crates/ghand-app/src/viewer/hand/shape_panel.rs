//! The controls of the shape: a slider for each direction.

use egui::Ui;
use ghand_core::HandModel;

use crate::viewer::widgets::number_slider::number_slider;

/// Largest parameter, in standard deviations or the model's own units: beyond it hands stop looking like hands.
const LARGEST: f64 = 3.0;

/// The shape's controls for one hand model.
pub struct ShapePanel {
    names: Vec<String>,
}

impl ShapePanel {
    /// The controls for a model.
    pub fn new(model: &HandModel) -> ShapePanel {
        let name = |k: usize| model.shape_names.get(k).map_or_else(|| format!("shape {k}"), |n| n.replace('-', " "));
        ShapePanel { names: (0..model.shape_count()).map(name).collect() }
    }

    /// Shows the sliders.
    pub fn sliders(&self, ui: &mut Ui, shape: &mut [f64]) {
        for (name, value) in self.names.iter().zip(shape.iter_mut()) {
            // Above the slider: beside it, long names would not fit the panel.
            let label = ui.label(name).id;
            ui.add(number_slider(value, -LARGEST..=LARGEST, 1, "")).labelled_by(label);
        }
        if ui.button("Mean shape").clicked() {
            shape.fill(0.0);
        }
    }
}

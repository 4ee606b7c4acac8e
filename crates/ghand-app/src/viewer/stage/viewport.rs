//! Where the picture is in the window during a frame.

use egui::{Rect, Ui};

/// The place of the picture, and whether it may have fewer pixels in motion.
#[derive(Debug, Clone, Copy)]
pub struct Viewport {
    /// Its rectangle, points.
    pub rect: Rect,
    /// Pixels for each point.
    pub pixels_per_point: f32,
    /// Whether a changing picture has fewer pixels on a slow device.
    pub adaptive: bool,
}

impl Viewport {
    /// All that is left of a part of the window.
    pub fn of(ui: &Ui, adaptive: bool) -> Viewport {
        Viewport { rect: ui.max_rect(), pixels_per_point: ui.ctx().pixels_per_point(), adaptive }
    }
}

//! A word in a corner of an image.

use egui::{Align2, Color32, FontId, Pos2, Ui};

/// Colour of lines and words over an image, and of the dark edge with which they are seen on any image.
pub const LINE_COLOR: Color32 = Color32::WHITE;
/// See [`LINE_COLOR`].
pub const EDGE_COLOR: Color32 = Color32::from_black_alpha(170);

/// A word in a corner of an image.
pub fn corner_label(ui: &Ui, corner: Pos2, align: Align2, text: &str) {
    let offset = egui::vec2(if align == Align2::LEFT_TOP { 14.0 } else { -14.0 }, 12.0);
    let font = FontId::proportional(13.0);
    let galley = ui.painter().layout_no_wrap(text.into(), font, LINE_COLOR);
    let place = align.anchor_size(corner + offset, galley.size());
    ui.painter().rect_filled(place.expand2(egui::vec2(6.0, 3.0)), 4.0, EDGE_COLOR);
    ui.painter().galley(place.min, galley, LINE_COLOR);
}

//! A small plot of one number over the iterations of a run.

use egui::{Align2, FontId, Pos2, Role, Sense, Shape, Stroke, Ui, WidgetInfo, pos2, vec2};

/// Height of the plot, points.
const HEIGHT: f32 = 84.0;
/// Room inside its edges, points.
const MARGIN: f32 = 4.0;

/// Shows a curve of (iteration, value), in order, with its last value, its range and a name for screen readers.
pub fn curve_plot(ui: &mut Ui, name: &str, points: &[[f64; 2]], show: impl Fn(f64) -> String) {
    let Some([last_iteration, last]) = points.last().copied() else { return };
    let values = || points.iter().map(|[_, value]| *value);
    let (low, high) = (values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max));
    let first_iteration = points.first().map_or(0.0, |[iteration, _]| *iteration);
    ui.horizontal(|ui| {
        ui.label(name);
        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| ui.monospace(show(last)));
    });
    let (rect, response) = ui.allocate_exact_size(vec2(ui.available_width(), HEIGHT), Sense::hover());
    response.widget_info(|| {
        let text = format!("{name}: {} after {last_iteration} iterations", show(last));
        WidgetInfo::labeled(Role::Label, true, text)
    });
    let painter = ui.painter_at(rect);
    painter.rect_filled(rect, 3.0, ui.visuals().extreme_bg_color);
    let inner = rect.shrink(MARGIN);
    // A curve of equal values or of one point is in the middle.
    let part = |value: f64, [from, to]: [f64; 2]| if to > from { ((value - from) / (to - from)) as f32 } else { 0.5 };
    let place = |[iteration, value]: [f64; 2]| -> Pos2 {
        let x = inner.left() + part(iteration, [first_iteration, last_iteration]) * inner.width();
        pos2(x, inner.bottom() - part(value, [low, high]) * inner.height())
    };
    let color = ui.visuals().hyperlink_color;
    painter.add(Shape::line(points.iter().map(|point| place(*point)).collect(), Stroke::new(1.5, color)));
    painter.circle_filled(place([last_iteration, last]), 2.5, color);
    let text = |at: Pos2, align: Align2, text: String| {
        painter.text(at, align, text, FontId::proportional(10.0), ui.visuals().weak_text_color());
    };
    if high > low {
        text(inner.left_top(), Align2::LEFT_TOP, show(high));
        text(inner.left_bottom(), Align2::LEFT_BOTTOM, show(low));
    }
    text(inner.right_bottom(), Align2::RIGHT_BOTTOM, format!("{last_iteration}"));
}

//! The strip of a motion's keys: marks to drag, above the slider's positions.

use egui::{Color32, Id, Pos2, Rect, Role, Sense, Shape, Stroke, Ui, WidgetInfo, pos2, vec2};

use crate::viewer::hand::timeline::Timeline;

/// Height of the strip, and half the size of a mark, points.
const HEIGHT: f32 = 22.0;
const MARK: f32 = 6.0;
/// A key at the position and another one: the colours of the handles.
const HERE_COLOR: Color32 = Color32::from_rgb(255, 176, 46);
const EDGE_COLOR: Color32 = Color32::from_black_alpha(170);

/// Shows the keys of a motion. A click on a mark goes to its key, a drag moves it in time. Returns whether the position or
/// a key has changed.
pub fn key_strip(ui: &mut Ui, timeline: &mut Timeline) -> bool {
    let Some(keys) = timeline.keys() else { return false };
    let times: Vec<f64> = keys.keys().iter().map(|key| key.seconds).collect();
    let (strip, background) = ui.allocate_exact_size(vec2(ui.available_width(), HEIGHT), Sense::click_and_drag());
    background.widget_info(|| WidgetInfo::labeled(Role::Slider, true, "Keys of the motion"));
    let inner = strip.shrink2(vec2(MARK + 1.0, 0.0));
    let length = timeline.length();
    let x_of = |seconds: f64| inner.left() + (seconds / length) as f32 * inner.width();
    let time_at = |pos: Pos2| f64::from((pos.x - inner.left()) / inner.width()).clamp(0.0, 1.0) * length;

    let visuals = ui.visuals().clone();
    let line = Rect::from_x_y_ranges(inner.x_range(), strip.center().y - 2.0..=strip.center().y + 2.0);
    ui.painter().rect_filled(line, 2.0, visuals.widgets.inactive.bg_fill);
    let [from, to] = timeline.range();
    let repeated = Rect::from_x_y_ranges(x_of(from)..=x_of(to), line.y_range());
    ui.painter().rect_filled(repeated, 2.0, visuals.selection.bg_fill);

    let mut changed = false;
    if let Some(pos) = background.interact_pointer_pos().filter(|_| background.dragged() || background.clicked()) {
        timeline.go_to(time_at(pos));
        changed = true;
    }
    for (k, seconds) in times.iter().enumerate() {
        let center = pos2(x_of(*seconds), strip.center().y);
        let place = Rect::from_center_size(center, vec2(2.0 * MARK, HEIGHT));
        let mark = ui.interact(place, Id::unique(("key", k)), Sense::click_and_drag());
        mark.widget_info(|| WidgetInfo::labeled(Role::Button, true, format!("Key at {seconds:.2} s")));
        let is_here = (timeline.seconds() - seconds).abs() < 1e-6;
        let fill = if is_here { HERE_COLOR } else { visuals.text_color() };
        let size = if mark.hovered() || mark.dragged() { MARK + 1.0 } else { MARK };
        let corners = [vec2(0.0, -size), vec2(size, 0.0), vec2(0.0, size), vec2(-size, 0.0)].map(|by| center + by);
        ui.painter().add(Shape::convex_polygon(corners.to_vec(), fill, Stroke::new(1.0, EDGE_COLOR)));
        if mark.clicked() {
            timeline.go_to(*seconds);
            changed = true;
        }
        if let Some(pos) = mark.interact_pointer_pos().filter(|_| mark.dragged()) {
            let wanted = timeline.on_frame(time_at(pos));
            // Keys do not pass each other: the mark under the pointer stays the one that is dragged.
            let lowest = k.checked_sub(1).and_then(|before| times.get(before)).copied().unwrap_or(f64::NEG_INFINITY);
            let highest = times.get(k + 1).copied().unwrap_or(f64::INFINITY);
            if lowest < wanted - 1e-6 && wanted + 1e-6 < highest {
                if let Some(keys) = timeline.keys_mut() {
                    keys.move_to(k, wanted);
                }
                timeline.go_to(wanted);
                changed = true;
            }
        }
        mark.on_hover_text(format!("{seconds:.2} s"));
    }
    let x = x_of(timeline.seconds());
    ui.painter().vline(x, strip.y_range(), Stroke::new(1.5, HERE_COLOR));
    changed
}

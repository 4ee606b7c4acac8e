//! The controls of a motion: selection, playback, position and key frames.

use std::ops::RangeInclusive;

use egui::{Button, DragValue, Ui, Vec2};
use ghand_core::{HandModel, Pose};
use ghand_motion::motions::MOTION_NAMES;

use crate::viewer::hand::key_strip::key_strip;
use crate::viewer::hand::timeline::Timeline;
use crate::viewer::widgets::number_slider::number_slider;

/// Width of the button that starts and stops a motion, points.
const BUTTON_WIDTH: f32 = 52.0;
/// Range of the rate.
const RATES: [f64; 2] = [0.1, 4.0];

/// What the user asks for with the buttons of the keys.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum KeyRequest {
    /// A key with the present pose at the present position.
    Set,
    /// No key at the present position.
    Delete,
    /// To the key before the position.
    Previous,
    /// To the key after it.
    Next,
    /// The motion as a file.
    Save,
}

/// Shows the list of motions and the controls of the current one. Returns what the user asks of its keys.
pub fn timeline_panel(
    timeline: &mut Option<Timeline>,
    ui: &mut Ui,
    model: &HandModel,
    pose: &mut Pose,
) -> Option<KeyRequest> {
    ui.horizontal_wrapped(|ui| {
        for name in MOTION_NAMES {
            let chosen = timeline.as_ref().is_some_and(|timeline| timeline.title() == name);
            if ui.add(Button::new(name).selected(chosen)).clicked()
                && let Some(motion) = Timeline::named(name, model)
            {
                *timeline = Some(motion);
            }
        }
    });
    if let Some(timeline) = timeline {
        let mut moved = position(timeline, ui);
        moved |= key_strip(ui, timeline);
        if let (true, Some(now)) = (moved, timeline.pose()) {
            *pose = now;
        }
        playback(timeline, ui);
    }
    key_buttons(timeline.as_ref(), ui)
}

/// The button that plays and the slider of the position. Returns whether the position was changed.
fn position(timeline: &mut Timeline, ui: &mut Ui) -> bool {
    let mut moved = false;
    ui.horizontal(|ui| {
        // The same width for both words: otherwise the slider would move away under the pointer.
        let word = if timeline.is_playing() { "Pause" } else { "Play" };
        if ui.add(Button::new(word).min_size(Vec2::new(BUTTON_WIDTH, 0.0))).clicked() {
            timeline.play_or_pause();
        }
        ui.spacing_mut().slider_width = 110.0;
        let mut seconds = timeline.seconds();
        let response = ui.add(number_slider(&mut seconds, 0.0..=timeline.length(), 2, " s"));
        // Holding the slider or typing a time stops the motion.
        if response.changed() {
            timeline.go_to(seconds);
        } else if response.dragged() || response.gained_focus() {
            timeline.pause();
        }
        moved = response.on_hover_text("Position in the motion").changed();
    });
    moved
}

/// The rate and the part that repeats.
fn playback(timeline: &mut Timeline, ui: &mut Ui) {
    let end = timeline.end();
    if end <= 0.0 {
        return;
    }
    ui.horizontal(|ui| {
        let rate = DragValue::new(timeline.rate_mut()).range(RATES[0]..=RATES[1]).speed(0.01).suffix("×");
        ui.add(rate.max_decimals(2)).on_hover_text("Rate of the motion");
        let label = ui.label("repeat").id;
        let [mut from, mut to] = timeline.range();
        let (highest, lowest) = (to, from);
        let first = time(&mut from, 0.0..=highest);
        let first = ui.add(first).labelled_by(label).on_hover_text("Beginning of what repeats");
        ui.label("to");
        let last = ui.add(time(&mut to, lowest..=end)).labelled_by(label).on_hover_text("End of what repeats");
        if first.changed() || last.changed() {
            timeline.set_range([from, to]);
        }
    });
}

fn time(value: &mut f64, range: RangeInclusive<f64>) -> DragValue<'_> {
    DragValue::new(value).range(range).speed(0.02).fixed_decimals(2).suffix(" s")
}

fn key_buttons(timeline: Option<&Timeline>, ui: &mut Ui) -> Option<KeyRequest> {
    let keys = timeline.and_then(Timeline::keys);
    let seconds = timeline.map_or(0.0, Timeline::seconds);
    let is_key = keys.is_some_and(|keys| keys.at(seconds).is_some());
    let mut asked = None;
    ui.horizontal(|ui| {
        let mut button = |ui: &mut Ui, enabled: bool, text: &str, hover: &str, request| {
            if ui.add_enabled(enabled, Button::new(text)).on_hover_text(hover).clicked() {
                asked = Some(request);
            }
        };
        let set = if keys.is_some() { "Set key" } else { "Begin keys" };
        button(ui, true, set, "Keep the present pose at this position, as a key of a motion (K)", KeyRequest::Set);
        if keys.is_some() {
            button(ui, is_key, "Delete", "Delete the key at this position (Delete)", KeyRequest::Delete);
            button(ui, true, "<", "Go to the previous key ([)", KeyRequest::Previous);
            button(ui, true, ">", "Go to the next key (])", KeyRequest::Next);
        }
        if timeline.is_some_and(|timeline| timeline.end() > 0.0) {
            button(ui, true, "Save", "Save the motion as a file of poses (Ctrl+S)", KeyRequest::Save);
        }
    });
    asked
}

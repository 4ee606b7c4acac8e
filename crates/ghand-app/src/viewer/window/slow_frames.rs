//! Makes clicks on controls work when frames are slow.
//!
//! egui uses the pointer's position at the end of a frame's events, does not recognise a drag that begins and ends in
//! one frame, and uses the times of frames as those of events. With slow frames this loses clicks. So a press and its
//! release are delivered in two frames.

use egui::{Context, Event, Plugin, RawInput};

/// Longest click, seconds: more than a slow frame. egui's 0.8 distinguishes long touches, which have no meaning here.
const LONGEST_CLICK_SECS: f64 = 3.0;
/// Longest time between the clicks of a double click, seconds: as on most desktops, and more than most slow frames.
const DOUBLE_CLICK_SECS: f64 = 0.5;

/// Makes clicks work at any frame rate.
pub fn keep_clicks_in_slow_frames(context: &Context) {
    context.add_plugin(ClicksOverTwoFrames::default());
    context.options_mut(|options| {
        options.input_options.max_click_duration = LONGEST_CLICK_SECS;
        options.input_options.max_double_click_delay = DOUBLE_CLICK_SECS;
    });
}

/// If a press and its release came in the same frame, delays the events after the press until the next frame.
#[derive(Debug, Default)]
struct ClicksOverTwoFrames {
    held_back: Vec<Event>,
    /// Their time.
    time: Option<f64>,
}

impl Plugin for ClicksOverTwoFrames {
    fn debug_name(&self) -> &'static str {
        "clicks over two frames"
    }

    fn input_hook(&mut self, _: &Context, input: &mut RawInput) {
        if self.held_back.is_empty() {
            self.time = input.time;
        } else {
            input.time = self.time;
        }
        let mut events = std::mem::take(&mut self.held_back);
        events.append(&mut input.events);
        // A frame with events is followed by another at once, so nothing is delayed for long.
        self.held_back = events.split_off(end_of_frame(&events));
        input.events = events;
    }
}

/// How many of the events belong to this frame.
fn end_of_frame(events: &[Event]) -> usize {
    let is_button =
        |wanted: bool| move |e: &Event| matches!(e, Event::PointerButton { pressed, .. } if *pressed == wanted);
    let after_press = events.iter().position(is_button(true)).map(|press| press + 1);
    after_press.filter(|end| events.iter().skip(*end).any(is_button(false))).unwrap_or(events.len())
}

#[cfg(test)]
mod tests {
    use egui::{Button, Modifiers, PointerButton, Pos2, Rect, Slider, pos2, vec2};

    use super::*;

    fn button(pos: Pos2, pressed: bool) -> Event {
        Event::PointerButton { pos, button: PointerButton::Primary, pressed, modifiers: Modifiers::default() }
    }

    /// Shows a slider above a button in frames of one second each, with all events in the second frame. Returns the
    /// slider's value, and the button's clicks and double clicks.
    fn show(slow_frames: bool, events: &[Event]) -> (f64, [usize; 2]) {
        let context = Context::default();
        if slow_frames {
            keep_clicks_in_slow_frames(&context);
        }
        let mut value = 0.0;
        let mut clicks = [0; 2];
        for frame in 0..8 {
            let input = RawInput {
                screen_rect: Some(Rect::from_min_size(Pos2::ZERO, vec2(200.0, 100.0))),
                time: Some(f64::from(frame)),
                events: if frame == 1 { events.to_vec() } else { Vec::new() },
                ..Default::default()
            };
            let output = context.run_ui(input, |ui| {
                let slider = Slider::new(&mut value, 0.0..=1.0).show_value(false);
                ui.put(Rect::from_min_size(pos2(0.0, 0.0), vec2(200.0, 20.0)), slider);
                let button = ui.put(Rect::from_min_size(pos2(0.0, 50.0), vec2(60.0, 20.0)), Button::new("button"));
                clicks[0] += usize::from(button.clicked());
                clicks[1] += usize::from(button.double_clicked());
            });
            output.drop_without_applying_deltas();
        }
        (value, clicks)
    }

    #[test]
    fn a_slider_follows_a_click_or_drag_within_one_frame() {
        let at = pos2(50.0, 10.0);
        let click = [Event::PointerMoved(at), button(at, true), button(at, false)];
        assert_eq!(show(false, &click).0, 0.0, "egui does this itself now");
        let (clicked, _) = show(true, &click);
        assert!((0.3..0.7).contains(&clicked), "{clicked}");
        let end = pos2(90.0, 10.0);
        let drag = [Event::PointerMoved(at), button(at, true), Event::PointerMoved(end), button(end, false)];
        let (dragged, _) = show(true, &drag);
        assert!(dragged > clicked + 0.2, "{dragged}");
    }

    #[test]
    fn a_click_counts_even_if_the_pointer_moves_on_in_the_same_frame() {
        let at = pos2(30.0, 60.0);
        let click = [Event::PointerMoved(at), button(at, true), button(at, false)];
        let click_and_go = [&click[..], &[Event::PointerMoved(pos2(150.0, 90.0))]].concat();
        assert_eq!(show(false, &click_and_go).1, [0, 0], "egui does this itself now");
        assert_eq!(show(true, &click_and_go).1, [1, 0]);
        assert_eq!(show(true, &[click.clone(), click].concat()).1, [2, 1]);
    }
}

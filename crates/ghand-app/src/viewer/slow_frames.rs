//! Clicks that are shorter than a frame, for controls.
//!
//! egui looks where the pointer is at the end of a frame's events, and knows no drag that begins and ends in one frame. Where
//! frames are slow that loses clicks on sliders, and clicks after which the pointer went elsewhere. So that all controls work as
//! with fast frames, a press and its release come in two of them.

use egui::{Context, Event, Plugin, RawInput};

/// Holds back what follows a press whose release came in the same frame, until the next frame.
#[derive(Debug, Default)]
pub struct ClicksOverTwoFrames {
    held_back: Vec<Event>,
}

impl Plugin for ClicksOverTwoFrames {
    fn debug_name(&self) -> &'static str {
        "clicks over two frames"
    }

    fn input_hook(&mut self, _: &Context, input: &mut RawInput) {
        let mut events = std::mem::take(&mut self.held_back);
        events.append(&mut input.events);
        // After a frame with events comes another at once, so that nothing is held back for long.
        self.held_back = events.split_off(end_of_frame(&events));
        input.events = events;
    }
}

/// How many of the events may be in one frame.
fn end_of_frame(events: &[Event]) -> usize {
    let is_button = |wanted: bool| move |e: &Event| matches!(e, Event::PointerButton { pressed, .. } if *pressed == wanted);
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

    /// Shows a slider above a button in slow frames, all events in the first. Returns the slider's value and the clicks.
    fn show(plugin: Option<ClicksOverTwoFrames>, events: &[Event]) -> (f64, usize) {
        let context = Context::default();
        plugin.into_iter().for_each(|plugin| context.add_plugin(plugin));
        let (mut value, mut clicks) = (0.0, 0);
        for frame in 0..6 {
            let input = RawInput {
                screen_rect: Some(Rect::from_min_size(Pos2::ZERO, vec2(200.0, 100.0))),
                time: Some(0.4 * f64::from(frame)),
                events: if frame == 1 { events.to_vec() } else { Vec::new() },
                ..Default::default()
            };
            let output = context.run_ui(input, |ui| {
                let slider = Slider::new(&mut value, 0.0..=1.0).show_value(false);
                ui.put(Rect::from_min_size(pos2(0.0, 0.0), vec2(200.0, 20.0)), slider);
                let button = Button::new("button");
                clicks += usize::from(ui.put(Rect::from_min_size(pos2(0.0, 50.0), vec2(60.0, 20.0)), button).clicked());
            });
            output.drop_without_applying_deltas();
        }
        (value, clicks)
    }

    #[test]
    fn a_slider_goes_where_it_was_clicked_or_dragged_to_within_one_frame() {
        let at = pos2(50.0, 10.0);
        let click = [Event::PointerMoved(at), button(at, true), button(at, false)];
        assert_eq!(show(None, &click).0, 0.0, "egui does it by itself now");
        let (clicked, _) = show(Some(ClicksOverTwoFrames::default()), &click);
        assert!((0.3..0.7).contains(&clicked), "{clicked}");
        let end = pos2(90.0, 10.0);
        let drag = [Event::PointerMoved(at), button(at, true), Event::PointerMoved(end), button(end, false)];
        let (dragged, _) = show(Some(ClicksOverTwoFrames::default()), &drag);
        assert!(dragged > clicked + 0.2, "{dragged}");
    }

    #[test]
    fn a_button_is_clicked_though_the_pointer_went_on_within_the_frame() {
        let at = pos2(30.0, 60.0);
        let click = [Event::PointerMoved(at), button(at, true), button(at, false), Event::PointerMoved(pos2(150.0, 90.0))];
        assert_eq!(show(None, &click).1, 0, "egui does it by itself now");
        assert_eq!(show(Some(ClicksOverTwoFrames::default()), &click).1, 1);
        let twice = [&click[..], &click[..]].concat();
        assert_eq!(show(Some(ClicksOverTwoFrames::default()), &twice).1, 2);
    }
}

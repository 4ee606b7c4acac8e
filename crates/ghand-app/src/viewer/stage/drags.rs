//! Drags of the pointer, independent of the frame rate.
//!
//! All events during a frame arrive with the next one. On a slow device, press, movement and release may arrive in one
//! frame, in which egui does not recognise a drag. So drags are followed event by event here.

use egui::{Event, Modifiers, PointerButton, Pos2, Vec2};

/// A drag, or a part of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Drag {
    /// What it does.
    pub effect: Effect,
    /// How far it goes, points.
    pub by: Vec2,
}

/// What a drag does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Effect {
    /// The main button rotates the view.
    Turn,
    /// The other buttons, or the main button with Shift, move the view.
    Move,
    /// The main button drags the handle of this number, if it was pressed there.
    Handle(usize),
}

/// Follows drags from one frame to the next.
#[derive(Debug, Default)]
pub struct Drags {
    held: Option<Held>,
}

#[derive(Debug, Clone, Copy)]
struct Held {
    button: PointerButton,
    effect: Effect,
    last: Pos2,
}

impl Drags {
    /// The handle that is held.
    pub fn held_handle(&self) -> Option<usize> {
        match self.held?.effect {
            Effect::Handle(handle) => Some(handle),
            Effect::Turn | Effect::Move => None,
        }
    }

    /// The drags in a frame's events, in order; each is the sum of its movements. A drag begins in the view,
    /// perhaps at a handle there, and then continues wherever the pointer is. Keys pressed during a drag do not change
    /// what it does. `handle_at` is `None` outside the view, and in it the number of a handle, if there is one.
    pub fn follow(&mut self, events: &[Event], mut handle_at: impl FnMut(Pos2) -> Option<Option<usize>>) -> Vec<Drag> {
        let mut drags = Vec::new();
        let mut sum = Vec2::ZERO;
        for event in events {
            match *event {
                Event::PointerMoved(pos) => sum += self.move_to(pos),
                Event::PointerButton { pos, button, pressed: true, modifiers } => {
                    // A press of a button that is already held: the window missed the release.
                    if self.held.is_some_and(|held| held.button == button) {
                        drags.extend(self.drag(std::mem::take(&mut sum)));
                        self.held = None;
                    }
                    sum += self.move_to(pos);
                    if self.held.is_none()
                        && let Some(handle) = handle_at(pos)
                    {
                        self.held = Some(Held { button, effect: effect(button, modifiers, handle), last: pos });
                    }
                }
                Event::PointerButton { pos, button, pressed: false, .. } => {
                    sum += self.move_to(pos);
                    if self.held.is_some_and(|held| held.button == button) {
                        drags.extend(self.drag(std::mem::take(&mut sum)));
                        self.held = None;
                    }
                }
                _ => {}
            }
        }
        drags.extend(self.drag(sum));
        drags
    }

    fn move_to(&mut self, pos: Pos2) -> Vec2 {
        self.held.as_mut().map_or(Vec2::ZERO, |held| pos - std::mem::replace(&mut held.last, pos))
    }

    fn drag(&self, sum: Vec2) -> Option<Drag> {
        let held = self.held.filter(|_| sum != Vec2::ZERO)?;
        Some(Drag { effect: held.effect, by: sum })
    }
}

fn effect(button: PointerButton, modifiers: Modifiers, handle: Option<usize>) -> Effect {
    if button != PointerButton::Primary || modifiers.shift {
        return Effect::Move;
    }
    handle.map_or(Effect::Turn, Effect::Handle)
}

#[cfg(test)]
mod tests {
    use egui::{pos2, vec2};

    use super::*;

    const A: Pos2 = pos2(100.0, 50.0);

    fn button(pressed: bool, x: f32, button: PointerButton, modifiers: Modifiers) -> Event {
        Event::PointerButton { pos: pos2(x, 50.0), button, pressed, modifiers }
    }

    fn press(x: f32) -> Event {
        button(true, x, PointerButton::Primary, Modifiers::NONE)
    }

    fn release(x: f32) -> Event {
        button(false, x, PointerButton::Primary, Modifiers::NONE)
    }

    fn at(x: f32) -> Event {
        Event::PointerMoved(pos2(x, 50.0))
    }

    fn drag(effect: Effect, x: f32) -> Drag {
        Drag { effect, by: vec2(x, 0.0) }
    }

    fn turn(x: f32) -> Drag {
        drag(Effect::Turn, x)
    }

    /// Drags may begin at positions from 100; from 400 there is a handle.
    fn follow(drags: &mut Drags, events: &[Event]) -> Vec<Drag> {
        drags.follow(events, |pos| (pos.x >= A.x).then(|| (pos.x >= 400.0).then_some(7)))
    }

    #[test]
    fn only_the_main_button_without_shift_drags_a_handle() {
        let mut drags = Drags::default();
        assert_eq!(follow(&mut drags, &[press(410.0), at(430.0)]), [drag(Effect::Handle(7), 20.0)]);
        assert_eq!(drags.held_handle(), Some(7));
        assert_eq!(follow(&mut drags, &[at(50.0), release(50.0)]), [drag(Effect::Handle(7), -380.0)]);
        assert_eq!(drags.held_handle(), None);
        let shift = button(true, 410.0, PointerButton::Primary, Modifiers::SHIFT);
        assert_eq!(follow(&mut drags, &[shift, at(411.0), release(411.0)]), [drag(Effect::Move, 1.0)]);
        let other = button(true, 410.0, PointerButton::Secondary, Modifiers::NONE);
        assert_eq!(follow(&mut drags, &[other, at(412.0)]), [drag(Effect::Move, 2.0)]);
    }

    #[test]
    fn a_drag_does_not_depend_on_the_distribution_of_its_events_over_frames() {
        let events = [at(120.0), press(120.0), at(121.0), at(150.0), at(90.0), at(95.0), release(97.0), at(300.0)];
        for frames in 1..=events.len() {
            let mut drags = Drags::default();
            let mut sum = Vec2::ZERO;
            for frame in events.chunks(events.len().div_ceil(frames)) {
                for drag in follow(&mut drags, frame) {
                    assert_eq!(drag.effect, Effect::Turn);
                    sum += drag.by;
                }
            }
            assert_eq!(sum, vec2(-23.0, 0.0), "{frames} frames");
        }
    }

    #[test]
    fn both_of_two_drags_in_one_frame_are_returned() {
        let events = [press(110.0), at(130.0), release(130.0), at(200.0), press(200.0), at(190.0), release(185.0)];
        assert_eq!(follow(&mut Drags::default(), &events), [turn(20.0), turn(-15.0)]);
        let other = |pressed, x| button(pressed, x, PointerButton::Secondary, Modifiers::NONE);
        let events = [press(110.0), release(112.0), other(true, 112.0), at(118.0), other(false, 118.0)];
        assert_eq!(follow(&mut Drags::default(), &events), [turn(2.0), drag(Effect::Move, 6.0)]);
    }

    #[test]
    fn only_the_button_that_began_a_drag_ends_it() {
        let mut drags = Drags::default();
        let middle = |pressed, x| button(pressed, x, PointerButton::Middle, Modifiers::NONE);
        assert_eq!(
            follow(&mut drags, &[press(110.0), middle(true, 111.0), middle(false, 113.0), at(120.0)]),
            [turn(10.0)]
        );
        assert_eq!(follow(&mut drags, &[at(125.0), release(125.0), at(130.0)]), [turn(5.0)]);
        assert_eq!(follow(&mut drags, &[at(140.0)]), []);
    }

    #[test]
    fn a_press_elsewhere_or_without_movement_is_not_a_drag() {
        let mut drags = Drags::default();
        assert_eq!(follow(&mut drags, &[press(99.0), at(150.0)]), []);
        assert_eq!(follow(&mut drags, &[release(150.0), press(150.0), release(150.0)]), []);
    }

    #[test]
    fn only_shift_at_the_press_makes_a_drag_move_the_view() {
        let mut drags = Drags::default();
        let press = button(true, 100.0, PointerButton::Primary, Modifiers::SHIFT);
        assert_eq!(follow(&mut drags, &[press, at(110.0)]), [drag(Effect::Move, 10.0)]);
        assert_eq!(follow(&mut drags, &[at(111.0), release(111.0)]), [drag(Effect::Move, 1.0)]);
    }

    #[test]
    fn a_drag_whose_release_was_lost_ends_with_the_next_press() {
        let mut drags = Drags::default();
        assert_eq!(follow(&mut drags, &[press(110.0), at(115.0)]), [turn(5.0)]);
        assert_eq!(follow(&mut drags, &[press(300.0), at(301.0), release(301.0)]), [turn(1.0)]);
    }
}

//! Drags of the pointer, independent of the frame rate.
//!
//! All events during a frame arrive with the next one. On a slow device, press, movement and release may arrive in one
//! frame, in which egui does not recognise a drag. So drags are followed event by event here.

use egui::{Event, Modifiers, PointerButton, Pos2, Vec2};

/// What a drag does to the view; points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Drag {
    /// The main button rotates it.
    Turn(Vec2),
    /// The other buttons, or the main button with Shift, move it.
    Move(Vec2),
}

/// Follows drags from one frame to the next.
#[derive(Debug, Default)]
pub struct Drags {
    held: Option<Held>,
}

#[derive(Debug, Clone, Copy)]
struct Held {
    button: PointerButton,
    moves: bool,
    last: Pos2,
}

impl Drags {
    /// The drags in a frame's events, in order; each is the sum of its movements. A drag begins where `begins_at`
    /// allows it, and then continues wherever the pointer is. Keys pressed during a drag do not change what it does.
    pub fn follow(&mut self, events: &[Event], begins_at: impl Fn(Pos2) -> bool) -> Vec<Drag> {
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
                    if self.held.is_none() && begins_at(pos) {
                        self.held = Some(Held { button, moves: moves(button, modifiers), last: pos });
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
        Some(if held.moves { Drag::Move(sum) } else { Drag::Turn(sum) })
    }
}

fn moves(button: PointerButton, modifiers: Modifiers) -> bool {
    button != PointerButton::Primary || modifiers.shift
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

    fn turn(x: f32) -> Drag {
        Drag::Turn(vec2(x, 0.0))
    }

    /// Drags may begin at positions from 100.
    fn follow(drags: &mut Drags, events: &[Event]) -> Vec<Drag> {
        drags.follow(events, |pos| pos.x >= A.x)
    }

    #[test]
    fn a_drag_does_not_depend_on_the_distribution_of_its_events_over_frames() {
        let events = [at(120.0), press(120.0), at(121.0), at(150.0), at(90.0), at(95.0), release(97.0), at(300.0)];
        for frames in 1..=events.len() {
            let mut drags = Drags::default();
            let mut sum = Vec2::ZERO;
            for frame in events.chunks(events.len().div_ceil(frames)) {
                for drag in follow(&mut drags, frame) {
                    let Drag::Turn(by) = drag else { panic!("{drag:?}") };
                    sum += by;
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
        assert_eq!(follow(&mut Drags::default(), &events), [turn(2.0), Drag::Move(vec2(6.0, 0.0))]);
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
        assert_eq!(follow(&mut drags, &[press, at(110.0)]), [Drag::Move(vec2(10.0, 0.0))]);
        assert_eq!(follow(&mut drags, &[at(111.0), release(111.0)]), [Drag::Move(vec2(1.0, 0.0))]);
    }

    #[test]
    fn a_drag_whose_release_was_lost_ends_with_the_next_press() {
        let mut drags = Drags::default();
        assert_eq!(follow(&mut drags, &[press(110.0), at(115.0)]), [turn(5.0)]);
        assert_eq!(follow(&mut drags, &[press(300.0), at(301.0), release(301.0)]), [turn(1.0)]);
    }
}

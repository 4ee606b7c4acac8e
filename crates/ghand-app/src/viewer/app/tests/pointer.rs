//! The pointer rotates, moves and zooms the view at any frame rate.

use egui::{Modifiers, PointerButton, Pos2, pos2};

use super::*;
use crate::viewer::stage::ZOOM_PER_POINT;

const A: Pos2 = pos2(450.0, 200.0);
const B: Pos2 = pos2(520.0, 170.0);
const C: Pos2 = pos2(400.0, 260.0);

fn button(button: PointerButton, pressed: bool, pos: Pos2) -> Event {
    Event::PointerButton { pos, button, pressed, modifiers: Modifiers::default() }
}

/// A drag as a window receives it.
fn drag(pointer_button: PointerButton, from: Pos2, to: Pos2) -> Vec<Event> {
    let moved = (1..=7).map(|k| Event::PointerMoved(from + (to - from) * (k as f32 / 7.0)));
    [Event::PointerMoved(from), button(pointer_button, true, from)]
        .into_iter()
        .chain(moved)
        .chain([button(pointer_button, false, to)])
        .collect()
}

fn wheel(lines: f32) -> Event {
    Event::MouseWheel {
        unit: egui::MouseWheelUnit::Line,
        delta: vec2(0.0, lines),
        phase: egui::TouchPhase::Move,
        source: egui::MouseWheelSource::Unknown,
        modifiers: Modifiers::default(),
    }
}

fn by(from: Pos2, to: Pos2) -> DVec2 {
    DVec2::new((to.x - from.x).into(), (to.y - from.y).into())
}

/// The rotation, the translation and the focal length, as one list.
fn numbers(camera: &OrbitCamera) -> Vec<f64> {
    let camera = camera.camera([100, 100]);
    camera.rotation.to_cols_array().into_iter().chain(camera.translation.to_array()).collect()
}

fn assert_same(a: &OrbitCamera, b: &OrbitCamera, what: &str) {
    let worst = numbers(a).iter().zip(numbers(b)).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    // Pointer positions are f32.
    assert!(worst < 1e-5, "{what}: the views differ by {worst}");
}

fn viewer() -> Headless {
    let mut ui = Headless::new(small_scene(), SIZE, 0.3);
    ui.frame(Vec::new());
    ui
}

/// Advances time in small steps until animations have ended.
fn settle(ui: &mut Headless) {
    (0..20).for_each(|_| _ = ui.frame(Vec::new()));
}

#[test]
fn a_drag_moves_the_view_by_its_length_at_any_frame_rate() {
    let mut ui = viewer();
    let picture = ui.canvas().picture().texture().unwrap();
    let edge = f64::from(picture.width().min(picture.height()));
    for (pointer_button, turns) in
        [(PointerButton::Primary, true), (PointerButton::Secondary, false), (PointerButton::Middle, false)]
    {
        let mut expected = viewer().camera().clone();
        if turns {
            expected.orbit(by(A, B))
        } else {
            expected.pan(by(A, B), edge)
        }
        let events = drag(pointer_button, A, B);
        // From all events in one frame to one event per frame.
        for size in [events.len(), 5, 2, 1] {
            let mut ui = viewer();
            events.chunks(size).for_each(|frame| _ = ui.frame(frame.to_vec()));
            assert_same(ui.camera(), &expected, &format!("{pointer_button:?}, {size} events a frame"));
        }
    }
}

#[test]
fn two_drags_in_one_frame_both_count() {
    let mut ui = viewer();
    let mut expected = ui.camera().clone();
    expected.orbit(by(A, B));
    expected.orbit(by(C, A));
    ui.frame([drag(PointerButton::Primary, A, B), drag(PointerButton::Primary, C, A)].concat());
    assert_same(ui.camera(), &expected, "two drags");
}

#[test]
fn a_drag_that_begins_on_the_panel_does_not_change_the_view() {
    for one_frame in [true, false] {
        let mut ui = viewer();
        let before = ui.camera().clone();
        let events = drag(PointerButton::Primary, pos2(100.0, 380.0), B);
        events.chunks(if one_frame { events.len() } else { 1 }).for_each(|frame| _ = ui.frame(frame.to_vec()));
        ui.frame(vec![Event::PointerMoved(pos2(100.0, 380.0)), wheel(2.0)]);
        settle(&mut ui);
        assert_eq!(*ui.camera(), before);
    }
}

#[test]
fn a_drag_continues_over_the_panel_and_outside_the_window() {
    let mut ui = viewer();
    let mut expected = ui.camera().clone();
    expected.orbit(by(A, pos2(-20.0, 210.0)));
    ui.frame(vec![Event::PointerMoved(A), button(PointerButton::Primary, true, A)]);
    ui.frame(vec![Event::PointerMoved(pos2(100.0, 205.0))]);
    ui.frame(vec![Event::PointerGone, Event::PointerMoved(pos2(-20.0, 210.0))]);
    ui.frame(vec![button(PointerButton::Primary, false, pos2(-20.0, 210.0))]);
    ui.frame(vec![Event::PointerMoved(B)]);
    assert_same(ui.camera(), &expected, "outside");
}

#[test]
fn turns_of_the_wheel_add_up_between_frames() {
    // Without the panel, the middle of the view is that of the window.
    let viewer = || {
        let mut ui = viewer();
        ui.viewer().settings_mut().panel_shown = false;
        ui.frame(Vec::new());
        ui
    };
    let mut ui = viewer();
    let edge = ui.canvas().picture().texture().unwrap().height();
    let mut expected = ui.camera().clone();
    // A line is 40 points.
    let pointer = by((0.5 * SIZE).to_pos2(), A);
    expected.zoom_at((3.0 * 40.0 * ZOOM_PER_POINT).exp(), pointer, edge.into());
    for size in [4, 1] {
        let mut ui = viewer();
        let events = [wheel(1.0), wheel(1.0), wheel(-1.0), wheel(2.0)];
        ui.frame(vec![Event::PointerMoved(A)]);
        events.chunks(size).for_each(|frame| _ = ui.frame(frame.to_vec()));
        settle(&mut ui);
        assert_same(ui.camera(), &expected, &format!("{size} turns a frame"));
    }
}

#[test]
fn a_double_click_and_a_button_reset_the_view() {
    let mut ui = viewer();
    let first = ui.camera().clone();
    ui.frame(drag(PointerButton::Primary, A, B));
    assert!(*ui.camera() != first);
    ui.click("Reset view");
    assert_eq!(*ui.camera(), first);
    ui.frame(drag(PointerButton::Primary, A, B));
    let click = [button(PointerButton::Primary, true, A), button(PointerButton::Primary, false, A)];
    ui.frame([&[Event::PointerMoved(A)], &click[..], &click[..]].concat());
    assert_eq!(*ui.camera(), first);
}

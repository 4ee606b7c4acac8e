//! Views that are saved, taken and deleted, and the orthographic one.

use egui::{Key, Modifiers};

use super::pose::WIDE;
use super::*;
use ghand_avatar::orbit_camera::Projection;

fn viewer(size: Vec2) -> Headless {
    let mut ui = Headless::new(Subject::Hand(Box::new(small_hand())), size, 0.1);
    ui.frame(Vec::new());
    ui
}

#[test]
fn a_view_is_saved_in_the_settings_shown_again_and_deleted() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("viewer.json");
    let mut ui = viewer(vec2(760.0, 1200.0));
    ui.viewer().use_settings(Settings::default(), Some(path.clone()));
    ui.camera().orbit(DVec2::new(60.0, 20.0));
    let kept = ui.camera().view_point();
    ui.press(Modifiers::NONE, Key::V);
    // A name that cannot be kept asks again.
    ui.frame(vec![Event::Text("palm".into())]);
    ui.press(Modifiers::NONE, Key::Enter);
    assert!(ui.viewer().dialogs.asks_for_name() && ui.viewer().settings_mut().views.is_empty());
    ui.frame(vec![Event::Text("nails".into())]);
    ui.press(Modifiers::NONE, Key::Enter);
    assert!(!ui.viewer().dialogs.asks_for_name());
    assert_eq!(Settings::read(&path).views, ui.viewer().settings_mut().views);
    ui.press(Modifiers::NONE, Key::Home);
    assert_ne!(ui.camera().view_point(), kept);
    ui.click("nails");
    assert_eq!(ui.camera().view_point(), kept);
    // By name, as `--view` does.
    ui.viewer().go_to_view("palm").unwrap();
    assert_ne!(ui.camera().view_point(), kept);
    ui.viewer().go_to_view("nails").unwrap();
    assert_eq!(ui.camera().view_point(), kept);
    let error = ui.viewer().go_to_view("nail").unwrap_err().to_string();
    assert!(error.contains("nails") && error.contains("thumb-side"), "{error}");
    ui.click("×");
    assert!(ui.viewer().settings_mut().views.is_empty() && Settings::read(&path).views.is_empty());
}

#[test]
fn the_key_switches_to_an_orthographic_view_that_shows_the_same_hand() {
    let mut ui = viewer(WIDE);
    ui.press(Modifiers::NONE, Key::O);
    assert_eq!(ui.camera().projection(), Projection::Orthographic);
    for _ in 0..3 {
        ui.frame(Vec::new());
    }
    assert!(ui.canvas().failure().is_none() && ui.viewer().finish().unwrap());
    // A handle can still be dragged: the hand is where the picture shows it.
    let before = ui.hand().pose.clone();
    let tip = ui.landmarks()[8];
    let to = tip + vec2(0.0, 25.0);
    ui.drag(tip, to);
    assert_ne!(ui.hand().pose, before);
    assert!(ui.landmarks()[8].distance(to) < 5.0);
    ui.press(Modifiers::NONE, Key::O);
    assert_eq!(ui.camera().projection(), Projection::Perspective);
}

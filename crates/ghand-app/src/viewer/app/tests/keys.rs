//! Motions of key frames: made, changed, undone, played and saved.

use egui::{Key, Modifiers};
use ghand_core::Pose;
use ghand_motion::{PoseOptions, read_poses};

use super::*;

const POSITION: &str = "Position in the motion";

fn viewer() -> Headless {
    let mut ui = Headless::new(Subject::Hand(Box::new(small_hand())), vec2(760.0, 1000.0), 0.1);
    ui.frame(Vec::new());
    ui
}

impl Headless {
    fn named(&mut self, name: &str) -> Pose {
        pose_by_name(name, self.hand().model()).unwrap()
    }

    fn key_times(&mut self) -> Vec<f64> {
        let keys = self.hand().timeline.as_ref().and_then(|timeline| timeline.keys().cloned());
        keys.map(|keys| keys.keys().iter().map(|key| key.seconds).collect()).unwrap_or_default()
    }

    /// Keys of rest at 0 s, fist at 1 s and open at 2 s.
    fn make_keys(&mut self) {
        self.press(Modifiers::NONE, Key::K);
        for (seconds, pose) in [("1", "fist"), ("2", "open")] {
            self.enter(POSITION, seconds);
            self.click(pose);
            self.press(Modifiers::NONE, Key::K);
        }
    }
}

#[test]
fn keys_are_set_at_positions_and_the_motion_leads_from_one_to_the_next() {
    let mut ui = viewer();
    ui.make_keys();
    assert_eq!(ui.key_times(), [0.0, 1.0, 2.0]);
    let fist = ui.named("fist");
    let open = ui.named("open");
    ui.enter(POSITION, "1");
    assert_eq!(ui.hand().pose, fist);
    ui.enter(POSITION, "1.5");
    let between = ui.hand().pose.clone();
    assert!(between != fist && between != open);
    ui.press(Modifiers::NONE, Key::OpenBracket);
    assert_eq!(ui.hand().pose, fist);
    ui.press(Modifiers::NONE, Key::CloseBracket);
    assert_eq!(ui.hand().pose, open);
    ui.press(Modifiers::NONE, Key::Space);
    (0..4).for_each(|_| _ = ui.frame(Vec::new()));
    assert!(ui.hand().is_playing() && ui.hand().pose != open);
}

#[test]
fn keys_are_dragged_deleted_and_undone() {
    let mut ui = viewer();
    ui.make_keys();
    let before = ui.harness.get_by_label("Key at 1.00 s").rect().center();
    let target = ui.harness.get_by_label("Key at 2.00 s").rect().center();
    ui.drag(before, before.lerp(target, 0.5));
    assert_eq!(ui.key_times().len(), 3);
    assert!((ui.key_times()[1] - 1.5).abs() < 0.1, "{:?}", ui.key_times());
    let fist = ui.named("fist");
    assert_eq!(ui.hand().pose, fist, "the view shows the key that was dragged");
    // A key does not pass the next one.
    let dragged = ui.harness.get_by_label_contains("Key at 1.").rect().center();
    ui.drag(dragged, target + vec2(30.0, 0.0));
    assert!(ui.key_times()[1] < 2.0 && ui.key_times()[2] == 2.0);
    ui.press(Modifiers::NONE, Key::Delete);
    assert_eq!(ui.key_times(), [0.0, 2.0]);
    for expected in [3, 3, 3] {
        ui.press(Modifiers::COMMAND, Key::Z);
        assert_eq!(ui.key_times().len(), expected);
    }
    assert_eq!(ui.key_times(), [0.0, 1.0, 2.0], "a whole drag is one step");
    // Without a key there is no motion, and undo brings it back.
    for time in ["0", "1", "2"] {
        ui.enter(POSITION, time);
        ui.press(Modifiers::NONE, Key::Delete);
    }
    assert!(ui.hand().timeline.is_none());
    ui.press(Modifiers::COMMAND, Key::Z);
    assert_eq!(ui.key_times(), [2.0]);
}

#[test]
fn a_motion_of_keys_is_saved_as_poses_that_are_read_again() {
    let mut ui = viewer();
    ui.make_keys();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("motion.json");
    ui.viewer().document.save_motion(&path).unwrap();
    let model = small_hand().model().clone();
    let read = read_poses(&path, &model, &PoseOptions::default()).unwrap();
    assert_eq!((read.frames.len(), read.duration()), (61, 2.0));
    for (seconds, name) in [(0.0, "rest"), (1.0, "fist"), (2.0, "open")] {
        let now = read.pose_at(seconds).unwrap();
        let wanted = ui.named(name);
        let worst = now.rotations.iter().zip(&wanted.rotations).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
        assert!(worst < 1e-9, "{name}: {worst}");
    }
    // Opened again it has its keys, which can be changed.
    let mut again = viewer();
    again.open(&path);
    again.frame(Vec::new());
    assert_eq!(again.key_times(), [0.0, 1.0, 2.0]);
    for (seconds, between) in [("0.5", ui.hand().timeline.clone()), ("1.7", ui.hand().timeline.clone())] {
        again.enter(POSITION, seconds);
        let mut saved = between.unwrap();
        saved.go_to(seconds.parse().unwrap());
        let now = again.hand().pose.clone();
        let wanted = saved.pose().unwrap();
        let worst = now.rotations.iter().zip(&wanted.rotations).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
        assert!(worst < 1e-9, "{seconds} s: {worst}");
    }
    again.enter(POSITION, "1");
    again.press(Modifiers::NONE, Key::Delete);
    assert_eq!(again.key_times(), [0.0, 2.0]);
    let error = viewer().viewer().document.save_motion(&path).unwrap_err().to_string();
    assert!(error.contains("no motion"), "{error}");
}

#[test]
fn undo_brings_back_the_motion_that_keys_replaced() {
    let mut ui = viewer();
    ui.click("grasp");
    (0..3).for_each(|_| _ = ui.frame(Vec::new()));
    ui.click("Pause");
    ui.frame(Vec::new());
    let title = |ui: &mut Headless| ui.hand().timeline.as_ref().unwrap().title().to_owned();
    let paused = ui.hand().timeline.as_ref().unwrap().state();
    ui.press(Modifiers::NONE, Key::K);
    assert_eq!(title(&mut ui), "key frames");
    ui.press(Modifiers::COMMAND, Key::Z);
    assert_eq!(title(&mut ui), "grasp");
    assert_eq!(ui.hand().timeline.as_ref().unwrap().state(), paused);
    ui.press(Modifiers::COMMAND, Key::Y);
    assert_eq!((title(&mut ui), ui.key_times().len()), ("key frames".into(), 1));
}

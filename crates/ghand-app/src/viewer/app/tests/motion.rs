//! Motions play until the user stops them; sliders and numbers set poses.

use egui::accesskit::Role;
use egui::{Key, Modifiers, PointerButton, Pos2, pos2};
use ghand_motion::PoseSequence;

use super::*;
use crate::pose_choice::PoseReadingArgs;
use crate::viewer::screenshot::screenshot;

/// Name of the slider for the position in a motion.
const PLACE: &str = "Position in the motion";
const SMALL: Vec2 = vec2(400.0, 520.0);

/// What `--pose` gives for a name or a file.
fn poses(text: &str) -> PoseSequence {
    PoseReadingArgs::default().load(text, small_hand().model()).unwrap()
}

/// A file with 1.92 seconds of poses in which all joints rotate, at a rate without a finite decimal form.
fn pose_file(folder: &Path) -> String {
    let pose =
        |k: usize| (0..16).map(|joint| format!("[0,{},-0.0001]", 0.003 * (k + joint) as f64)).collect::<Vec<_>>();
    let frame = |k: usize| format!(r#"{{"id":"{k:04}","pose":[{}]}}"#, pose(k).join(","));
    let frames: Vec<String> = (0..25).map(frame).collect();
    let path = folder.join("poses.json");
    std::fs::write(&path, format!(r#"{{"fps":12.5,"frames":[{}]}}"#, frames.join(","))).unwrap();
    path.display().to_string()
}

/// A viewer that was opened with `--pose` for that sequence.
fn playing(sequence: PoseSequence, step_secs: f32) -> Headless {
    let mut hand = small_hand();
    hand.show("given".into(), sequence);
    Headless::new(Subject::Hand(Box::new(hand)), SMALL, step_secs)
}

impl Headless {
    /// The position in the motion, seconds, and whether it plays.
    fn place(&mut self) -> (f64, bool) {
        self.hand().timeline.as_ref().unwrap().state()
    }

    fn pointer(&mut self, pos: Pos2, pressed: Option<bool>) {
        let button = PointerButton::Primary;
        let modifiers = Modifiers::default();
        let press = pressed.map(|pressed| Event::PointerButton { pos, button, pressed, modifiers });
        self.frame([Event::PointerMoved(pos)].into_iter().chain(press).collect());
    }

    /// Types a number into a slider.
    pub(super) fn enter(&mut self, slider: &str, text: &str) {
        self.harness.get_by_role_and_label(Role::SpinButton, slider).click();
        (0..3).for_each(|_| self.harness.step());
        self.frame(vec![Event::Text(text.into())]);
        self.harness.key_press(Key::Enter);
        (0..3).for_each(|_| self.harness.step());
    }
}

#[test]
fn an_initial_motion_plays_at_its_own_speed_at_any_frame_rate() {
    let folder = tempfile::tempdir().unwrap();
    for text in ["count".to_owned(), pose_file(folder.path())] {
        let sequence = poses(&text);
        let end = sequence.duration();
        for step_secs in [1.0 / 16.0, 1.0 / 3.0, 1.0] {
            let mut ui = playing(sequence.clone(), step_secs);
            let (start, plays) = ui.place();
            assert!(plays, "{text} does not play when it is opened");
            let mut poses = Vec::new();
            for frame in 1..=(5.5 / f64::from(step_secs)).ceil() as usize {
                ui.frame(Vec::new());
                let (seconds, plays) = ui.place();
                assert!(plays, "{text}: stopped at {seconds} s, with {step_secs} s a frame");
                let expected = (start + frame as f64 * f64::from(step_secs)) % end;
                let off = (seconds - expected).abs();
                assert!(off.min(end - off) < 1e-3, "{text}: at {seconds} s instead of {expected} s");
                assert_eq!(Some(&ui.hand().pose), sequence.pose_at(seconds).as_ref());
                poses.push(ui.hand().pose.clone());
            }
            poses.dedup();
            assert!(poses.len() > 4, "{text}: {} different poses", poses.len());
        }
    }
}

#[test]
fn a_click_on_a_motion_plays_it_and_another_stops_it() {
    let mut ui = Headless::new(Subject::Hand(Box::new(small_hand())), SMALL, 0.1);
    ui.click("grasp");
    let (before, _) = ui.place();
    (0..3).for_each(|_| _ = ui.frame(Vec::new()));
    let (after, plays) = ui.place();
    assert!(plays && (after - before - 0.3).abs() < 1e-3, "{before} {after}");
    ui.click("Pause");
    let stopped = ui.place();
    ui.frame(Vec::new());
    assert_eq!((stopped.1, stopped), (false, ui.place()));
    // It continues where it was, however long the pause.
    ui.harness.input_mut().time = Some(1000.0);
    ui.click("Play");
    assert!(ui.place().1 && ui.place().0 - stopped.0 < 0.5, "{stopped:?} {:?}", ui.place());
}

#[test]
fn open_joint_sliders_neither_stop_a_motion_nor_round_its_poses() {
    let folder = tempfile::tempdir().unwrap();
    let sequence = poses(&pose_file(folder.path()));
    let mut ui = playing(sequence.clone(), 0.1);
    ui.click("Joints");
    ui.click("Wrist");
    (0..10).for_each(|_| _ = ui.frame(Vec::new()));
    let (seconds, plays) = ui.place();
    assert!(plays);
    assert_eq!(Some(&ui.hand().pose), sequence.pose_at(seconds).as_ref());
}

#[test]
fn the_time_slider_scrubs_and_stops() {
    let sequence = poses("count");
    let end = sequence.duration();
    let mut ui = playing(sequence.clone(), 0.1);
    ui.frame(Vec::new());
    let rail = ui.harness.get_by_role_and_label(Role::Slider, PLACE).rect();
    ui.pointer(rail.center(), Some(true));
    assert!((ui.place().0 - 0.5 * end).abs() < 0.1 * end);
    // A slider that is held still keeps its value.
    let held = ui.place();
    (0..5).for_each(|_| _ = ui.frame(Vec::new()));
    assert_eq!((held.1, held), (false, ui.place()));
    ui.pointer(pos2(rail.right() - 4.0, rail.center().y), None);
    ui.pointer(pos2(rail.right() - 4.0, rail.center().y), Some(false));
    let (seconds, plays) = ui.place();
    assert!(!plays && seconds > 0.9 * end, "{seconds}");
    assert_eq!(Some(&ui.hand().pose), sequence.pose_at(seconds).as_ref());
    ui.enter(PLACE, "1.25");
    assert_eq!(ui.place(), (1.25, false));
    ui.enter(PLACE, "nan");
    assert_eq!(ui.place(), (1.25, false));
}

#[test]
fn manual_posing_stops_the_motion_but_keeps_it() {
    let mut ui = playing(poses("count"), 0.1);
    ui.click("fist");
    let fist = pose_by_name("fist", ui.hand().model()).unwrap();
    let stopped = ui.place();
    (0..3).for_each(|_| _ = ui.frame(Vec::new()));
    assert_eq!((stopped.1, stopped), (false, ui.place()));
    assert_eq!(ui.hand().pose, fist);
    ui.click("Play");
    ui.frame(Vec::new());
    assert!(ui.place().1 && ui.hand().pose != fist);
    ui.click("Joints");
    ui.click("Wrist");
    assert!(ui.place().1);
    ui.enter("x", "30");
    assert!(!ui.place().1);
    assert!((ui.hand().pose.rotations[0].x.to_degrees() - 30.0).abs() < 1e-9);
}

#[test]
fn joint_sliders_show_no_minus_zero_and_accept_only_angles() {
    let mut hand = small_hand();
    hand.pose.rotations[0] = glam::DVec3::new(-0.001, 0.0, -1.0);
    let mut ui = Headless::new(Subject::Hand(Box::new(hand)), vec2(400.0, 900.0), 0.1);
    ui.click("Joints");
    ui.click("Wrist");
    let shown = |ui: &Headless, axis: &str| ui.harness.get_by_role_and_label(Role::SpinButton, axis).value().unwrap();
    assert_eq!(["x", "y", "z"].map(|axis| shown(&ui, axis)), ["0°", "0°", "-57°"]);
    let before = ui.hand().pose.clone();
    for text in ["nan", "inf", "-inf", "200", "-1e9", "fist", ""] {
        ui.enter("x", text);
        assert_eq!(ui.hand().pose, before, "{text:?} was accepted");
    }
    ui.enter("x", "-12");
    assert!((ui.hand().pose.rotations[0].x.to_degrees() + 12.0).abs() < 1e-9);
    assert_eq!(ui.hand().pose.rotations[0].z, before.rotations[0].z, "only x was typed");
    assert_eq!(shown(&ui, "x"), "-12°");
}

#[test]
fn a_screenshot_shows_the_first_frame_of_a_motion() {
    let mut hand = small_hand();
    let sequence = poses("count");
    hand.show("count".into(), sequence.clone());
    let gpu = Gpu::new(&AdapterChoice::from_env()).unwrap_or_else(|e| panic!("{e}"));
    let mut viewer = Viewer::new(&gpu, Subject::Hand(Box::new(hand)), "test".into()).unwrap();
    let file = tempfile::Builder::new().suffix(".png").tempfile().unwrap();
    screenshot(&mut viewer, [300, 200], 1.0, file.path()).unwrap();
    assert_eq!(viewer.subject_mut().pose(), Some(&sequence.frames[0].pose));
}

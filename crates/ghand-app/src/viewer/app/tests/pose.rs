//! Poses are undone, copied, blended and dragged.

use egui::accesskit::Role;
use egui::{Key, Modifiers, PointerButton, Pos2};
use ghand_core::Pose;
use ghand_motion::RestSkeleton;
use ghand_motion::ik::HandIk;

use super::*;
use crate::viewer::rendering::screen::Screen;
use crate::viewer::stage::viewport::Viewport;

pub(super) const WIDE: Vec2 = vec2(760.0, 500.0);

fn viewer() -> Headless {
    let mut ui = Headless::new(Subject::Hand(Box::new(small_hand())), WIDE, 0.1);
    ui.frame(Vec::new());
    ui
}

impl Headless {
    fn pose(&mut self) -> Pose {
        self.hand().pose.clone()
    }

    /// Where the landmarks are on the screen.
    pub(super) fn landmarks(&mut self) -> Vec<Pos2> {
        let ik = HandIk::new(&RestSkeleton::of(self.hand().model()).unwrap());
        let pose = self.pose();
        let rect = egui::Rect::from_min_max(egui::pos2(260.0, 0.0), WIDE.to_pos2());
        let size = [rect.width() as u32, rect.height() as u32];
        let screen = Screen { rect, camera: self.camera().camera(size) };
        ik.landmarks(&pose).iter().map(|place| screen.project(*place).unwrap().0).collect()
    }

    /// Drags from one place to another with the main button.
    pub(super) fn drag(&mut self, from: Pos2, to: Pos2) {
        let button = |pos, pressed| Event::PointerButton {
            pos,
            button: PointerButton::Primary,
            pressed,
            modifiers: Modifiers::default(),
        };
        self.frame(vec![Event::PointerMoved(from)]);
        self.frame(vec![button(from, true)]);
        for k in 1..=8 {
            self.frame(vec![Event::PointerMoved(from.lerp(to, k as f32 / 8.0))]);
        }
        self.frame(vec![button(to, false)]);
        self.frame(Vec::new());
    }
}

#[test]
fn poses_are_undone_and_redone() {
    let mut ui = viewer();
    let rest = ui.pose();
    ui.click("fist");
    let fist = ui.pose();
    ui.click("ok");
    let ok = ui.pose();
    for expected in [&fist, &rest, &rest] {
        ui.press(Modifiers::COMMAND, Key::Z);
        assert_eq!(&ui.pose(), expected);
    }
    ui.press(Modifiers::COMMAND | Modifiers::SHIFT, Key::Z);
    assert_eq!(ui.pose(), fist);
    ui.press(Modifiers::COMMAND, Key::Y);
    assert_eq!(ui.pose(), ok);
    // A motion is one step.
    ui.click("grasp");
    (0..5).for_each(|_| _ = ui.frame(Vec::new()));
    assert_ne!(ui.pose(), ok);
    ui.press(Modifiers::COMMAND, Key::Z);
    assert_eq!(ui.pose(), ok);
    assert!(!ui.hand().timeline.as_ref().unwrap().state().1);
}

#[test]
fn a_copied_pose_can_be_pasted_and_other_text_changes_nothing() {
    let mut ui = viewer();
    ui.click("victory");
    let victory = ui.pose();
    let text = ui.hand().pose_json();
    ui.click("rest");
    ui.frame(vec![Event::Paste(text.clone())]);
    let off = |(a, b): (&glam::DVec3, &glam::DVec3)| a.distance(*b);
    let worst = |a: &Pose, b: &Pose| a.rotations.iter().zip(&b.rotations).map(off).fold(0.0, f64::max);
    assert!(worst(&ui.pose(), &victory) < 1e-12);
    for bad in ["", "good morning", "{}", &text[..text.len() / 2], r#"{"pose":[[0,0,"a"]]}"#] {
        let before = ui.pose();
        ui.frame(vec![Event::Paste(bad.into())]);
        ui.frame(Vec::new());
        assert_eq!(ui.pose(), before, "{bad}");
        assert!(ui.harness.query_all_by_label_contains("clipboard").next().is_some(), "no message for {bad:?}");
        ui.viewer().session.forget_messages();
    }
    ui.frame(vec![Event::Copy]);
    ui.frame(Vec::new());
    assert!(ui.harness.query_by_label("The pose is on the clipboard.").is_some());
}

#[test]
fn a_dragged_fingertip_follows_the_pointer_and_other_fingers_stay() {
    let mut ui = viewer();
    let before = ui.pose();
    let tip = ui.landmarks()[8];
    let knuckle = ui.landmarks()[5];
    let to = tip.lerp(knuckle, 0.3);
    ui.drag(tip, to);
    let reached = ui.landmarks()[8];
    assert!(reached.distance(to) < 4.0, "{reached:?} instead of {to:?}");
    let now = ui.pose();
    let names = ui.hand().model().joint_names.clone();
    let changed = |joint: &usize| now.rotations[*joint] != before.rotations[*joint];
    let moved: Vec<&String> = (0..names.len()).filter(changed).map(|joint| &names[joint]).collect();
    assert!(!moved.is_empty() && moved.iter().all(|name| name.starts_with("index")), "{moved:?}");
    // The whole drag is one step.
    ui.press(Modifiers::COMMAND, Key::Z);
    assert_eq!(ui.pose(), before);
    // The wrist moves the hand, a knuckle turns it; the view stays.
    let camera = ui.camera().clone();
    let wrist = ui.landmarks()[0];
    ui.drag(wrist, wrist + vec2(20.0, -10.0));
    assert!(ui.landmarks()[0].distance(wrist + vec2(20.0, -10.0)) < 1.0);
    assert_eq!(ui.pose().rotations, before.rotations);
    let wrist = ui.landmarks()[0];
    let knuckle = ui.landmarks()[9];
    ui.drag(knuckle, knuckle + vec2(30.0, 10.0));
    assert_ne!(ui.pose().rotations[0], before.rotations[0]);
    assert!(ui.landmarks()[0].distance(wrist) < 0.1);
    assert_eq!(*ui.camera(), camera);
}

#[test]
fn without_handles_a_drag_on_a_finger_turns_the_view() {
    let mut ui = viewer();
    let before = ui.pose();
    let camera = ui.camera().clone();
    ui.press(Modifiers::NONE, Key::H);
    let tip = ui.landmarks()[8];
    ui.drag(tip, tip + vec2(20.0, 20.0));
    assert_eq!(ui.pose(), before);
    assert_ne!(*ui.camera(), camera);
}

#[test]
fn a_named_pose_is_blended_in() {
    let mut ui = viewer();
    ui.enter("Blend with the named pose", "50");
    let fist = pose_by_name("fist", ui.hand().model()).unwrap();
    let rest = Pose::rest(fist.rotations.len());
    assert_eq!(ui.pose(), ghand_motion::pose_sequence::between(&rest, &fist, 0.5));
}

#[test]
fn the_joint_of_the_slider_under_the_pointer_is_known() {
    let mut ui = Headless::new(Subject::Hand(Box::new(small_hand())), vec2(500.0, 1400.0), 0.1);
    ui.click("Joints");
    ui.click("Wrist");
    assert_eq!(ui.hand().pointed_at(), None);
    let slider = ui.harness.get_by_role_and_label(Role::Slider, "x").rect();
    (0..2).for_each(|_| _ = ui.frame(vec![Event::PointerMoved(slider.center())]));
    assert_eq!(ui.hand().pointed_at(), Some(0));
}

#[test]
fn a_shape_is_undone_and_a_shaped_fingertip_follows_the_pointer() {
    let model = builtin_hand(Side::Right).unwrap();
    let mut ui = Headless::new(Subject::bare_hand(model), vec2(760.0, 1600.0), 0.1);
    ui.frame(Vec::new());
    ui.click("Shape");
    let name = ui.hand().model().shape_names[0].replace('-', " ");
    let [mean, shaped] = ["0", "2"].map(|value| {
        ui.enter(&name, value);
        ui.frame(Vec::new());
        let hand = ui.hand();
        hand.posed_vertices()
    });
    let apart = mean.iter().zip(&shaped).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
    assert!(apart > 1e-3, "the shape moves nothing: {apart} m");
    assert_eq!(ui.hand().shape[0], 2.0);
    // The handles are those of the shape.
    let view = egui::Rect::from_min_max(egui::pos2(260.0, 0.0), egui::pos2(760.0, 1600.0));
    let screen = ui.viewer().stage.screen(&Viewport { rect: view, pixels_per_point: 1.0, adaptive: true });
    let pose = ui.pose();
    let tip = |ui: &mut Headless, pose: &Pose| ui.hand().handles().unwrap().place(pose, &screen, 8).unwrap();
    let from = tip(&mut ui, &pose);
    let to = from + vec2(-6.0, 30.0);
    ui.drag(from, to);
    let moved = ui.pose();
    assert_ne!(moved, pose);
    let reached = tip(&mut ui, &moved);
    assert!(reached.distance(to) < 5.0, "{reached:?} instead of {to:?}");
    ui.press(Modifiers::COMMAND, Key::Z);
    assert_eq!((ui.pose(), ui.hand().shape[0]), (pose, 2.0));
    ui.press(Modifiers::COMMAND, Key::Z);
    assert_eq!(ui.hand().shape[0], 0.0);
    ui.press(Modifiers::COMMAND, Key::Y);
    assert_eq!(ui.hand().shape[0], 2.0);
}

#[test]
fn an_avatar_says_why_it_has_no_sliders_of_shape() {
    let mut ui = viewer();
    ui.frame(Vec::new());
    assert!(ui.harness.query_by_label("Shape: as trained").is_some());
}

//! Commands by menu, key and palette.

use egui::accesskit::Role;
use egui::{Key, Modifiers};
use egui_kittest::kittest::NodeT;

use super::*;
use ghand_avatar::view_side::ViewSide;

fn viewer() -> Headless {
    let mut ui = Headless::new(Subject::Hand(Box::new(small_hand())), vec2(SIZE.x, 460.0), 0.1);
    ui.frame(Vec::new());
    ui
}

impl Headless {
    /// Opens a menu, or one in it.
    pub(super) fn open_menu(&mut self, title: &str) {
        let is_button = |node: &egui_kittest::Node| node.accesskit_node().role() == Role::Button;
        let found = self.harness.query_all_by_label_contains(title).find(is_button);
        found.unwrap_or_else(|| panic!("no menu {title}")).click();
        (0..2).for_each(|_| self.harness.step());
    }

    /// Presses a key and shows two frames.
    pub(super) fn press(&mut self, modifiers: Modifiers, key: Key) {
        self.harness.key_press_modifiers(modifiers, key);
        self.harness.step();
        self.harness.step();
    }
}

#[test]
fn a_menu_runs_commands() {
    let mut ui = viewer();
    let mut palm = ui.camera().clone();
    let pose = ui.hand().pose.clone();
    palm.look_from(ViewSide::Palm, ui.hand().model(), &pose);
    palm.frame(&ui.hand().posed_vertices());
    ui.harness.get_by_role_and_label(Role::Button, "View").click();
    (0..2).for_each(|_| ui.harness.step());
    ui.harness.get_by_label_contains("From the palm").click();
    (0..2).for_each(|_| ui.harness.step());
    assert_eq!(*ui.camera(), palm);
}

#[test]
fn keys_run_commands_but_not_while_text_is_typed() {
    let mut ui = viewer();
    ui.press(Modifiers::NONE, Key::N);
    assert!(!ui.viewer().settings_mut().panel_shown);
    ui.press(Modifiers::NONE, Key::N);
    assert!(ui.viewer().settings_mut().panel_shown);
    ui.click("grasp");
    let plays = |ui: &mut Headless| ui.hand().timeline.as_ref().unwrap().state().1;
    assert!(plays(&mut ui));
    ui.press(Modifiers::NONE, Key::Space);
    assert!(!plays(&mut ui));
    ui.press(Modifiers::COMMAND, Key::K);
    ui.press(Modifiers::NONE, Key::N);
    assert!(ui.viewer().settings_mut().panel_shown && ui.viewer().dialogs.has_palette());
}

#[test]
fn the_palette_finds_poses_and_commands() {
    let mut ui = viewer();
    for key in [Key::K, Key::P] {
        ui.viewer().subject_mut().reset();
        ui.press(Modifiers::COMMAND, key);
        ui.frame(vec![Event::Text("fist".into())]);
        ui.press(Modifiers::NONE, Key::Enter);
        let fist = pose_by_name("fist", ui.hand().model()).unwrap();
        assert_eq!(ui.hand().pose, fist);
        assert!(!ui.viewer().dialogs.has_palette());
    }
    ui.press(Modifiers::COMMAND, Key::K);
    ui.press(Modifiers::NONE, Key::Escape);
    assert!(!ui.viewer().dialogs.has_palette());
}

#[test]
fn the_help_lists_every_command() {
    let mut ui = Headless::new(small_scene(), vec2(1000.0, 800.0), 0.1);
    for key in [Key::F1, Key::Questionmark] {
        ui.press(Modifiers::NONE, key);
        for command in crate::viewer::command::COMMANDS {
            assert!(ui.harness.query_all_by_label(command.title).next().is_some(), "{}", command.title);
        }
        ui.press(Modifiers::NONE, Key::F1);
        assert!(!ui.viewer().dialogs.has_help());
    }
}

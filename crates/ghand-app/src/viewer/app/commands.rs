//! Runs commands, from the menu, the keyboard or the palette.

use std::path::PathBuf;

use egui::{Button, Context, MenuBar, Ui, ViewportCommand};
use ghand_hand_model::named_poses::POSE_NAMES;
use ghand_motion::motions::MOTION_NAMES;

use crate::cli::choice_name;
use crate::viewer::app::Viewer;
use crate::viewer::command::{COMMANDS, Command, CommandId, Menu, Pressed, pressed};
use crate::viewer::dialogs::command_palette::Entry;
use crate::viewer::dialogs::output_dialog::OutputKind;
use crate::viewer::document::file_reader::file_name;
use crate::viewer::hand::Hand;
use crate::viewer::hand::timeline_panel::KeyRequest;
use crate::viewer::session::saved_view::SavedView;
use ghand_avatar::view_side::ViewSide;

/// What an entry of the palette does.
#[derive(Debug, Clone, PartialEq)]
enum Action {
    Run(CommandId),
    Pose(&'static str),
    Motion(&'static str),
    Open(PathBuf),
    View(String),
    DeleteView(String),
}

impl Viewer {
    /// Runs the commands whose keys were pressed, unless the palette or the help is open.
    pub(super) fn run_pressed(&mut self, context: &Context) {
        let taken = self.dialogs.take_keys();
        for asked in pressed(context) {
            match asked {
                asked if taken => self.dialogs.close_by_key(&asked),
                Pressed::Command(id) => self.run(id, context),
                Pressed::Pasted(text) => self.paste(&text),
            }
        }
    }

    /// Runs a command, if it is available now.
    pub fn run(&mut self, id: CommandId, context: &Context) {
        if !self.is_available(id) {
            return;
        }
        let document = &mut self.document;
        let stage = &mut self.stage;
        let session = &mut self.session;
        let subject = &document.subject;
        match id {
            CommandId::Open => self.dialogs.ask_for_file(context),
            CommandId::SavePicture => self.ask_for_output(OutputKind::Picture),
            CommandId::SaveFilm => {
                let has_motion = document.has_motion();
                self.ask_for_output(if has_motion { OutputKind::Motion } else { OutputKind::Turntable });
            }
            CommandId::Quit => context.send_viewport_cmd(ViewportCommand::Close),
            CommandId::Undo => document.edit_hand(Hand::undo),
            CommandId::Redo => document.edit_hand(Hand::redo),
            CommandId::CopyPose => {
                if let Some(hand) = document.hand() {
                    context.copy_text(hand.pose_json());
                    session.note("The pose is on the clipboard.");
                }
            }
            CommandId::PastePose => context.send_viewport_cmd(ViewportCommand::RequestPaste),
            CommandId::ShowHandles => toggle(&mut session.settings.handles_shown),
            CommandId::ShowThumbnails => toggle(&mut session.settings.thumbnails_shown),
            CommandId::Play => document.edit_hand(Hand::play_or_pause),
            CommandId::SetKey => self.set_key(),
            CommandId::DeleteKey => document.edit_hand(Hand::delete_key),
            CommandId::PreviousKey => document.edit_hand(|hand| hand.step_key(-1)),
            CommandId::NextKey => document.edit_hand(|hand| hand.step_key(1)),
            CommandId::SaveMotion => self.dialogs.ask_for_motion_file(context),
            CommandId::LivePoses => {
                if let Err(error) = self.live.start_or_stop() {
                    session.error(&error);
                }
            }
            CommandId::Webcam => {
                if let Err(error) = self.live.start_or_stop_webcam() {
                    session.error(&error);
                }
            }
            CommandId::ResetAll => self.reset_all(),
            CommandId::Frame => stage.frame(subject),
            CommandId::ResetView => stage.reset_view(subject),
            CommandId::ViewBack => stage.look_from(ViewSide::Back, subject),
            CommandId::ViewPalm => stage.look_from(ViewSide::Palm, subject),
            CommandId::ViewThumbSide => stage.look_from(ViewSide::ThumbSide, subject),
            CommandId::ViewLittleFingerSide => stage.look_from(ViewSide::LittleFingerSide, subject),
            CommandId::ViewFingertips => stage.look_from(ViewSide::Fingertips, subject),
            CommandId::SwitchProjection => stage.switch_projection(),
            CommandId::SaveView => self.dialogs.ask_for_name(),
            CommandId::Turntable => stage.set_turning(!stage.is_turning()),
            CommandId::PreviousCamera => self.step_camera(-1),
            CommandId::NextCamera => self.step_camera(1),
            CommandId::Measure => {
                let is_measured = stage.canvas.is_measured();
                stage.canvas.set_measured(!is_measured);
            }
            CommandId::AdaptDetail => toggle(&mut session.settings.adaptive),
            CommandId::SwitchTheme => {
                let theme = session.settings.theme.next();
                session.settings.theme = theme;
                session.note(format!("Theme: {}", choice_name(theme)));
            }
            CommandId::ShowPanel => toggle(&mut session.settings.panel_shown),
            CommandId::ShowLayer(layer) => self.show_layer(layer),
            CommandId::DrawOverlay(overlay) => self.toggle_overlay(overlay),
            CommandId::Compare(comparison) => self.compare(comparison),
            CommandId::CapturePoses => self.switch_capture_poses(),
            CommandId::ShowPalette => self.dialogs.open_palette(),
            CommandId::ShowHelp => self.dialogs.open_help(),
        }
    }

    /// Whether a command can do anything now.
    fn is_available(&self, id: CommandId) -> bool {
        let document = &self.document;
        let hand = document.hand();
        match id {
            CommandId::Open => !self.dialogs.asks_for_file(),
            // One at a time.
            CommandId::SavePicture | CommandId::SaveFilm => self.output.is_none() && !self.dialogs.asks_where_to_save(),
            CommandId::Undo => hand.is_some_and(|hand| hand.can_undo_and_redo()[0]),
            CommandId::Redo => hand.is_some_and(|hand| hand.can_undo_and_redo()[1]),
            CommandId::CopyPose
            | CommandId::PastePose
            | CommandId::ShowHandles
            | CommandId::ShowThumbnails
            | CommandId::SetKey
            | CommandId::LivePoses
            | CommandId::Webcam
            | CommandId::ViewBack
            | CommandId::ViewPalm
            | CommandId::ViewThumbSide
            | CommandId::ViewLittleFingerSide
            | CommandId::ViewFingertips
            | CommandId::DrawOverlay(_) => hand.is_some(),
            CommandId::PreviousCamera | CommandId::NextCamera => document.capture().is_some(),
            CommandId::ShowLayer(_) => document.avatar().is_some(),
            CommandId::Compare(_) => self.stage.is_comparable(document.capture()),
            CommandId::CapturePoses => document.capture().is_some_and(|capture| capture.poses().has_trained()),
            CommandId::DeleteKey => hand.is_some_and(|hand| hand.has_keys_and_one_here()[1]),
            CommandId::PreviousKey | CommandId::NextKey => hand.is_some_and(|hand| hand.has_keys_and_one_here()[0]),
            CommandId::SaveMotion => !self.dialogs.asks_where_to_save() && document.has_motion(),
            CommandId::Play => hand.is_some_and(|hand| hand.timeline.is_some()),
            _ => true,
        }
    }

    fn paste(&mut self, text: &str) {
        let Some(hand) = self.document.hand_mut() else { return };
        match hand.paste(text) {
            Ok(remarks) => remarks.into_iter().for_each(|remark| self.session.note(remark)),
            Err(error) => self.session.error(&error),
        }
    }

    /// Keeps the pose as a key; says so if another motion had to go for it.
    fn set_key(&mut self) {
        if let Some(title) = self.document.set_key() {
            self.session
                .note(format!("Key frames have begun, in place of {title}. Move in time, pose the hand, press K."));
        }
    }

    /// Does what the buttons of the keys ask for.
    pub(super) fn follow_key_buttons(&mut self, context: &Context) {
        let command = match self.document.hand_mut().and_then(Hand::take_key_request) {
            None => return,
            Some(KeyRequest::Set) => CommandId::SetKey,
            Some(KeyRequest::Delete) => CommandId::DeleteKey,
            Some(KeyRequest::Previous) => CommandId::PreviousKey,
            Some(KeyRequest::Next) => CommandId::NextKey,
            Some(KeyRequest::Save) => CommandId::SaveMotion,
        };
        self.run(command, context);
    }

    /// The menus.
    pub(super) fn menu_bar(&mut self, ui: &mut Ui) {
        ui.add_space(2.0);
        MenuBar::new().ui(ui, |ui| {
            for menu in Menu::ALL {
                // A scene has neither a pose nor a motion.
                if menu == Menu::Pose && self.document.hand().is_none() {
                    continue;
                }
                ui.menu_button(menu.title(), |ui| {
                    for command in COMMANDS.iter().filter(|command| command.menu == menu) {
                        self.menu_item(ui, command);
                        if command.id == CommandId::Open {
                            self.recent_menu(ui);
                        }
                        if command.id == CommandId::Webcam {
                            self.webcam_menu(ui);
                        }
                    }
                });
            }
        });
    }

    fn menu_item(&mut self, ui: &mut Ui, command: &Command) {
        let button = Button::new(command.title).shortcut_text(command.shortcut_text(ui.ctx()));
        let button = match self.is_on(command.id) {
            Some(on) => button.selected(on),
            None => button,
        };
        if ui.add_enabled(self.is_available(command.id), button).on_hover_text(command.summary).clicked() {
            ui.close();
            let context = ui.ctx().clone();
            self.run(command.id, &context);
        }
    }

    /// The menu of cameras, if there are several.
    fn webcam_menu(&mut self, ui: &mut Ui) {
        let cameras = self.live.cameras(ui.ctx());
        if cameras.len() < 2 {
            return;
        }
        ui.menu_button("Choose webcam", |ui| {
            for camera in cameras {
                let name = camera.name();
                let is_open = self.live.webcam_name() == Some(&name);
                if ui.add(Button::new(name).selected(is_open)).clicked() {
                    ui.close();
                    if let Err(error) = self.live.open_webcam(camera) {
                        self.session.error(&error);
                    }
                }
            }
        });
    }

    /// The state of a command that switches something on and off.
    fn is_on(&self, id: CommandId) -> Option<bool> {
        let stage = &self.stage;
        let settings = &self.session.settings;
        match id {
            CommandId::Measure => Some(stage.canvas.is_measured()),
            CommandId::AdaptDetail => Some(settings.adaptive),
            CommandId::ShowPanel => Some(settings.panel_shown),
            CommandId::ShowThumbnails => Some(settings.thumbnails_shown),
            CommandId::ShowHandles => Some(settings.handles_shown),
            CommandId::SwitchProjection => Some(stage.is_orthographic()),
            CommandId::Turntable => Some(stage.is_turning()),
            CommandId::ShowLayer(layer) => Some(stage.layers.layer(self.document.avatar()) == layer),
            CommandId::DrawOverlay(overlay) => Some(stage.layers.has_overlay(overlay)),
            CommandId::Compare(comparison) => Some(stage.truth.comparison() == comparison),
            CommandId::CapturePoses => {
                Some(self.document.capture().is_some_and(|capture| capture.poses().are_of_training()))
            }
            CommandId::LivePoses => Some(self.live.is_open()),
            CommandId::Webcam => Some(self.live.webcam_name().is_some()),
            _ => None,
        }
    }

    /// Shows the questions and the help that are open, and messages.
    pub(super) fn overlays(&mut self, context: &Context) {
        if self.dialogs.has_palette() {
            let entries = self.palette_entries(context);
            match self.dialogs.show_palette(context, &entries) {
                None => {}
                Some(Action::Run(id)) => self.run(id, context),
                Some(Action::Pose(name)) => self.document.edit_hand(|hand| hand.take_pose(name)),
                Some(Action::Motion(name)) => self.document.edit_hand(|hand| hand.play(name)),
                Some(Action::Open(path)) => self.open(&path),
                Some(Action::View(name)) => self.show_view(&name),
                Some(Action::DeleteView(name)) => self.session.delete_view(&name),
            }
        }
        if let Some(name) = self.dialogs.show_name(context) {
            self.save_view(&name);
        }
        self.show_output(context);
        self.dialogs.show_help(context);
        self.session.show_messages(context);
        self.document.show_reading(context);
    }

    fn palette_entries(&self, context: &Context) -> Vec<Entry<Action>> {
        let is_listed = |command: &&Command| command.id != CommandId::ShowPalette && self.is_available(command.id);
        let mut entries: Vec<Entry<Action>> = COMMANDS
            .iter()
            .filter(is_listed)
            .map(|command| Entry {
                title: command.title.into(),
                remark: command.shortcut_text(context),
                summary: command.summary.into(),
                action: Action::Run(command.id),
            })
            .collect();
        if self.document.hand().is_some() {
            let entry = |kind: &str, name: &str, summary: &str, action| Entry {
                title: format!("{kind}: {name}"),
                remark: String::new(),
                summary: summary.into(),
                action,
            };
            let poses = POSE_NAMES.iter().map(|name| entry("Pose", name, "Takes this pose.", Action::Pose(name)));
            let motions =
                MOTION_NAMES.iter().map(|name| entry("Motion", name, "Plays this motion.", Action::Motion(name)));
            entries.extend(poses.chain(motions));
        }
        for SavedView { name, .. } in &self.session.settings.views {
            let entry = |title: String, summary: &str, action| Entry {
                title,
                remark: String::new(),
                summary: summary.into(),
                action,
            };
            entries.push(entry(format!("View: {name}"), "Shows this saved view.", Action::View(name.clone())));
            let delete = Action::DeleteView(name.clone());
            entries.push(entry(format!("Delete view: {name}"), "Deletes this saved view.", delete));
        }
        entries.extend(self.session.settings.recent.iter().map(|path| Entry {
            title: format!("Open: {}", file_name(path)),
            remark: String::new(),
            summary: path.display().to_string(),
            action: Action::Open(path.clone()),
        }));
        entries
    }
}

fn toggle(on: &mut bool) {
    *on = !*on;
}

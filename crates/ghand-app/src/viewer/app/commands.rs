//! Runs commands, from the menu, the keyboard or the palette.

use std::path::PathBuf;

use egui::{Button, Context, MenuBar, Ui, ViewportCommand};
use ghand_hand_model::named_poses::POSE_NAMES;
use ghand_motion::motions::MOTION_NAMES;

use crate::viewer::app::Viewer;
use crate::viewer::command::{COMMANDS, Command, CommandId, Menu, Pressed, pressed};
use crate::viewer::dialogs::command_palette::{Choice, CommandPalette, Entry};
use crate::viewer::dialogs::file_dialog::FileDialog;
use crate::viewer::dialogs::help_overlay::help_overlay;
use crate::viewer::dialogs::name_dialog::NameDialog;
use crate::viewer::dialogs::output_dialog::OutputKind;
use crate::viewer::document::file_reader::file_name;
use crate::viewer::document::subject::Subject;
use crate::viewer::hand::Hand;
use crate::viewer::rendering::camera::Projection;
use crate::viewer::rendering::view_side::ViewSide;
use crate::viewer::session::saved_view::SavedView;

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
        if self.palette.is_some() || self.help_shown || self.naming_view.is_some() || self.output_dialog.is_some() {
            // The same keys close them.
            for asked in pressed(context) {
                match asked {
                    Pressed::Command(CommandId::ShowHelp) => self.help_shown = false,
                    Pressed::Command(CommandId::ShowPalette) => self.palette = None,
                    Pressed::Command(_) | Pressed::Pasted(_) => {}
                }
            }
            return;
        }
        for asked in pressed(context) {
            match asked {
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
        match id {
            CommandId::Open => self.file_dialog = Some(FileDialog::open(context)),
            CommandId::SavePicture => self.ask_for_output(OutputKind::Picture),
            CommandId::SaveFilm => {
                self.ask_for_output(if self.has_motion() { OutputKind::Motion } else { OutputKind::Turntable });
            }
            CommandId::Quit => context.send_viewport_cmd(ViewportCommand::Close),
            CommandId::Undo => self.edit_hand(Hand::undo),
            CommandId::Redo => self.edit_hand(Hand::redo),
            CommandId::CopyPose => {
                if let Subject::Hand(hand) = &self.subject {
                    context.copy_text(hand.pose_json());
                    self.toasts.note("The pose is on the clipboard.");
                }
            }
            CommandId::PastePose => context.send_viewport_cmd(ViewportCommand::RequestPaste),
            CommandId::ShowHandles => self.settings.handles_shown = !self.settings.handles_shown,
            CommandId::ShowThumbnails => self.settings.thumbnails_shown = !self.settings.thumbnails_shown,
            CommandId::Play => self.edit_hand(|hand| hand.play_or_pause()),
            CommandId::SetKey => self.set_key(),
            CommandId::DeleteKey => self.edit_hand(Hand::delete_key),
            CommandId::PreviousKey => self.edit_hand(|hand| hand.step_key(-1)),
            CommandId::NextKey => self.edit_hand(|hand| hand.step_key(1)),
            CommandId::SaveMotion => self.choose_motion_file(context),
            CommandId::LivePoses => self.start_or_stop_live(),
            CommandId::ResetAll => self.reset_all(),
            CommandId::Frame => self.frame_subject(),
            CommandId::ResetView => self.reset_view(),
            CommandId::ViewBack => self.look_from(ViewSide::Back),
            CommandId::ViewPalm => self.look_from(ViewSide::Palm),
            CommandId::ViewThumbSide => self.look_from(ViewSide::ThumbSide),
            CommandId::ViewLittleFingerSide => self.look_from(ViewSide::LittleFingerSide),
            CommandId::ViewFingertips => self.look_from(ViewSide::Fingertips),
            CommandId::SwitchProjection => self.camera.switch_projection(),
            CommandId::SaveView => self.naming_view = Some(NameDialog::default()),
            CommandId::Turntable => self.turntable = !self.turntable,
            CommandId::PreviousCamera => self.step_camera(-1),
            CommandId::NextCamera => self.step_camera(1),
            CommandId::Measure => {
                self.measure = !self.measure;
                self.clear_times();
            }
            CommandId::AdaptDetail => self.settings.adaptive = !self.settings.adaptive,
            CommandId::SwitchTheme => {
                self.settings.theme = self.settings.theme.next();
                self.toasts.note(format!("Theme: {}", self.settings.theme.name()));
            }
            CommandId::ShowPanel => self.settings.panel_shown = !self.settings.panel_shown,
            CommandId::ShowLayer(layer) => self.show_layer(layer),
            CommandId::DrawOverlay(overlay) => self.toggle_overlay(overlay),
            CommandId::Compare(comparison) => self.compare(comparison),
            CommandId::CapturePoses => self.switch_capture_poses(),
            CommandId::ShowPalette => self.palette = Some(CommandPalette::default()),
            CommandId::ShowHelp => self.help_shown = true,
        }
    }

    /// Whether a command can do anything now.
    fn is_available(&self, id: CommandId) -> bool {
        match id {
            CommandId::Open => self.file_dialog.is_none(),
            // One at a time.
            CommandId::SavePicture | CommandId::SaveFilm => self.output.is_none() && self.save_dialog.is_none(),
            CommandId::Undo => matches!(&self.subject, Subject::Hand(hand) if hand.can_undo_and_redo()[0]),
            CommandId::Redo => matches!(&self.subject, Subject::Hand(hand) if hand.can_undo_and_redo()[1]),
            CommandId::CopyPose
            | CommandId::PastePose
            | CommandId::ShowHandles
            | CommandId::ShowThumbnails
            | CommandId::LivePoses
            | CommandId::ViewBack
            | CommandId::ViewPalm
            | CommandId::ViewThumbSide
            | CommandId::ViewLittleFingerSide
            | CommandId::ViewFingertips => self.subject.pose().is_some(),
            CommandId::PreviousCamera | CommandId::NextCamera => self.capture.is_some(),
            CommandId::ShowLayer(_) => self.avatar().is_some(),
            CommandId::DrawOverlay(_) => self.subject.pose().is_some(),
            CommandId::Compare(_) => self.comparable().is_some(),
            CommandId::CapturePoses => self.capture.as_ref().is_some_and(|capture| capture.poses().has_trained()),
            CommandId::SetKey => self.subject.pose().is_some(),
            CommandId::DeleteKey => matches!(&self.subject, Subject::Hand(hand) if hand.has_keys_and_one_here()[1]),
            CommandId::PreviousKey | CommandId::NextKey => {
                matches!(&self.subject, Subject::Hand(hand) if hand.has_keys_and_one_here()[0])
            }
            CommandId::SaveMotion => self.save_dialog.is_none() && self.has_motion(),
            CommandId::Play => matches!(&self.subject, Subject::Hand(hand) if hand.timeline.is_some()),
            _ => true,
        }
    }

    fn paste(&mut self, text: &str) {
        let Subject::Hand(hand) = &mut self.subject else { return };
        match hand.paste(text) {
            Ok(remarks) => remarks.into_iter().for_each(|remark| self.toasts.note(remark)),
            Err(error) => self.toasts.error(&error),
        }
    }

    fn edit_hand(&mut self, edit: impl FnOnce(&mut Hand)) {
        if let Subject::Hand(hand) = &mut self.subject {
            edit(hand);
        }
    }

    /// The menus.
    pub(super) fn menu_bar(&mut self, ui: &mut Ui) {
        ui.add_space(2.0);
        MenuBar::new().ui(ui, |ui| {
            for menu in Menu::ALL {
                // A scene has neither a pose nor a motion.
                if menu == Menu::Pose && self.subject.pose().is_none() {
                    continue;
                }
                ui.menu_button(menu.title(), |ui| {
                    for command in COMMANDS.iter().filter(|command| command.menu == menu) {
                        self.menu_item(ui, command);
                        if command.id == CommandId::Open {
                            self.recent_menu(ui);
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

    /// The state of a command that switches something on and off.
    fn is_on(&self, id: CommandId) -> Option<bool> {
        match id {
            CommandId::Measure => Some(self.measure),
            CommandId::AdaptDetail => Some(self.settings.adaptive),
            CommandId::ShowPanel => Some(self.settings.panel_shown),
            CommandId::ShowThumbnails => Some(self.settings.thumbnails_shown),
            CommandId::ShowHandles => Some(self.settings.handles_shown),
            CommandId::SwitchProjection => Some(self.camera.projection() == Projection::Orthographic),
            CommandId::Turntable => Some(self.turntable),
            CommandId::ShowLayer(layer) => Some(self.layer() == layer),
            CommandId::DrawOverlay(overlay) => Some(self.has_overlay(overlay)),
            CommandId::Compare(comparison) => Some(self.truth.comparison == comparison),
            CommandId::CapturePoses => {
                Some(self.capture.as_ref().is_some_and(|capture| capture.poses().are_of_training()))
            }
            CommandId::LivePoses => Some(self.live.is_some()),
            _ => None,
        }
    }

    /// Shows the palette and the help, if they are open.
    pub(super) fn overlays(&mut self, context: &Context) {
        if let Some(mut palette) = self.palette.take() {
            match palette.show(context, &self.palette_entries(context)) {
                Choice::Open => self.palette = Some(palette),
                Choice::Closed => {}
                Choice::Chosen(Action::Run(id)) => self.run(id, context),
                Choice::Chosen(Action::Pose(name)) => self.edit_hand(|hand| hand.take_pose(name)),
                Choice::Chosen(Action::Open(path)) => self.open(&path),
                Choice::Chosen(Action::View(name)) => self.show_view(&name),
                Choice::Chosen(Action::DeleteView(name)) => self.delete_view(&name),
                Choice::Chosen(Action::Motion(name)) => self.edit_hand(|hand| hand.play(name)),
            }
        }
        self.name_view(context);
        self.show_output(context);
        self.help_shown = self.help_shown && help_overlay(context);
        self.toasts.show(context);
        self.files.show(context);
        if self.files.is_busy() {
            // A file that was opened after the others were looked at is read in the next frame.
            context.request_repaint();
        }
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
        if self.subject.pose().is_some() {
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
        for SavedView { name, .. } in &self.settings.views {
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
        entries.extend(self.settings.recent.iter().map(|path| Entry {
            title: format!("Open: {}", file_name(path)),
            remark: String::new(),
            summary: path.display().to_string(),
            action: Action::Open(path.clone()),
        }));
        entries
    }
}

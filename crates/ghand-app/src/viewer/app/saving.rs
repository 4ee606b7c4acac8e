//! Saves to the files that the user chooses.

use std::path::Path;

use anyhow::{Context as _, anyhow};
use egui::Context;
use ghand_files::atomic_file::write_atomically;

use crate::viewer::app::Viewer;
use crate::viewer::command::CommandId;
use crate::viewer::dialogs::file_dialog::{Answer, FileDialog, NO_DIALOG};
use crate::viewer::dialogs::output_dialog::OutputDialog;
use crate::viewer::document::file_reader::file_name;
use crate::viewer::document::subject::Subject;
use crate::viewer::hand::timeline_panel::KeyRequest;

/// What is saved to the chosen file.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Saving {
    /// The present motion as a file of poses.
    Motion,
    /// A picture or a film of the view.
    Output(OutputDialog),
}

impl Viewer {
    /// Keeps the pose as a key; says so if another motion had to go for it.
    pub(super) fn set_key(&mut self) {
        let Subject::Hand(hand) = &mut self.subject else { return };
        let other = hand.timeline.as_ref().filter(|timeline| timeline.keys().is_none());
        let replaced = other.map(|timeline| timeline.title().to_owned());
        hand.set_key();
        if let Some(title) = replaced {
            self.toasts
                .note(format!("Key frames have begun, in place of {title}. Move in time, pose the hand, press K."));
        }
    }

    /// Does what the buttons of the keys ask for.
    pub(super) fn follow_key_buttons(&mut self, context: &Context) {
        let Subject::Hand(hand) = &mut self.subject else { return };
        let command = match hand.take_key_request() {
            None => return,
            Some(KeyRequest::Set) => CommandId::SetKey,
            Some(KeyRequest::Delete) => CommandId::DeleteKey,
            Some(KeyRequest::Previous) => CommandId::PreviousKey,
            Some(KeyRequest::Next) => CommandId::NextKey,
            Some(KeyRequest::Save) => CommandId::SaveMotion,
        };
        self.run(command, context);
    }

    /// Asks where to save the motion.
    pub(super) fn choose_motion_file(&mut self, context: &Context) {
        let dialog = FileDialog::save(context, "motion.json", "Poses", &["json"]);
        self.save_dialog = Some((dialog, Saving::Motion));
    }

    /// Saves to the file that was chosen.
    pub(super) fn save_chosen(&mut self, context: &Context) {
        let Some(answer) = self.save_dialog.as_ref().and_then(|(dialog, _)| dialog.poll()) else { return };
        let Some((_, what)) = self.save_dialog.take() else { return };
        let path = match answer {
            Answer::Chosen(path) => path,
            Answer::Closed => {
                self.toasts.note("No file was chosen; nothing is saved.");
                return;
            }
            Answer::Missing => {
                self.toasts.error(&anyhow!("nothing is saved: {NO_DIALOG}"));
                return;
            }
        };
        let saved = match what {
            Saving::Motion => self.save_motion(&path).map(|()| Some(format!("{} is saved.", file_name(&path)))),
            // It says so when it is done.
            Saving::Output(asked) => self.save_output(&asked, &path, context).map(|()| None),
        };
        match saved {
            Ok(note) => note.into_iter().for_each(|note| self.toasts.note(note)),
            Err(error) => self.toasts.error(&error),
        }
    }

    /// Saves the motion as a file of poses.
    ///
    /// # Errors
    /// One sentence if there is none or the file cannot be written.
    pub fn save_motion(&self, path: &Path) -> anyhow::Result<()> {
        let Subject::Hand(hand) = &self.subject else { anyhow::bail!("a scene has no motion") };
        let json = hand.motion_json().context("there is no motion to save")?;
        write_atomically(path, json.as_bytes()).with_context(|| format!("{}: cannot be written", path.display()))
    }
}

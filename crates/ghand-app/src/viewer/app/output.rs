//! Saves motions, pictures and films to the files that the user chooses.

use std::path::Path;

use anyhow::anyhow;
use egui::Context;

use crate::viewer::app::Viewer;
use crate::viewer::dialogs::Saving;
use crate::viewer::dialogs::file_dialog::{Answer, NO_DIALOG};
use crate::viewer::dialogs::output_dialog::{OutputDialog, OutputKind};
use crate::viewer::document::file_reader::file_name;
use crate::viewer::output::{OutputJob, OutputPlan};

/// Size of pictures and films that are offered if there is no picture yet, pixels.
const SIZE: [u32; 2] = [1280, 800];

impl Viewer {
    /// Asks what to save of the view.
    pub(super) fn ask_for_output(&mut self, kind: OutputKind) {
        self.dialogs.ask_for_output(kind, self.stage.canvas.texture_size().unwrap_or(SIZE));
    }

    /// Saves to the file that was chosen.
    pub(super) fn save_chosen(&mut self, context: &Context) {
        let Some((answer, what)) = self.dialogs.file_to_save() else { return };
        let path = match answer {
            Answer::Chosen(path) => path,
            Answer::Closed => {
                self.session.note("No file was chosen; nothing is saved.");
                return;
            }
            Answer::Missing => {
                self.session.error(&anyhow!("nothing is saved: {NO_DIALOG}"));
                return;
            }
        };
        let saved = match what {
            Saving::Motion => {
                self.document.save_motion(&path).map(|()| Some(format!("{} is saved.", file_name(&path))))
            }
            // It says so when it is done.
            Saving::Output(asked) => self.save_output(&asked, &path, context).map(|()| None),
        };
        match saved {
            Ok(note) => note.into_iter().for_each(|note| self.session.note(note)),
            Err(error) => self.session.error(&error),
        }
    }

    /// Begins to save a picture or a film of the view, in the background: to a file, which gets its ending if it has none, or
    /// a film's pictures to a folder.
    ///
    /// # Errors
    /// One sentence if that is impossible.
    pub fn save_output(&mut self, asked: &OutputDialog, path: &Path, context: &Context) -> anyhow::Result<()> {
        let plan = OutputPlan::new(asked, &self.document, &self.stage);
        self.output = Some(OutputJob::start(self.gpu(), plan, &asked.completed(path), context)?);
        Ok(())
    }

    /// Shows the question what to save, and the progress of what is being saved.
    pub(super) fn show_output(&mut self, context: &Context) {
        self.dialogs.show_output(context, &self.document);
        if let Some(job) = self.output.take_if(|job| job.show_progress(context)) {
            self.session.note(format!("{} is not saved.", file_name(job.path())));
        }
        let Some(result) = self.output.as_ref().and_then(OutputJob::poll) else { return };
        self.output = None;
        match result {
            Ok(text) => self.session.note(format!("Saved {text}.")),
            Err(error) => self.session.error(&error),
        }
    }
}

//! Opens files, in a window that stays usable: dropped ones, chosen ones, recent ones, and those that change on disk.

use std::path::Path;

use anyhow::anyhow;
use egui::{Context, Ui};

use crate::lighting::Lighting;
use crate::viewer::app::Viewer;
use crate::viewer::dialogs::file_dialog::{Answer, NO_DIALOG};
use crate::viewer::document::file_reader::{Contents, ReadFile, Reason, file_name};
use crate::viewer::document::subject::Subject;
use crate::viewer::document::training_run::TrainingRun;

impl Viewer {
    /// Reads the subject again, in this light, whenever this file changes.
    pub fn watch(&mut self, path: &Path, light: &Lighting) {
        self.document.watch(path, light);
    }

    /// Shows beside the avatar how the run goes that trains it, and follows the run to its result.
    pub fn follow_run(&mut self, run: TrainingRun) {
        self.document.follow_run(run);
    }

    /// Opens a file of any kind, once it has been read beside the user interface: an avatar, a hand model or a scene
    /// becomes the subject, poses are shown by the present hand, a capture's cameras are offered. If it cannot be opened, a
    /// message says why and nothing changes.
    pub fn open(&mut self, path: &Path) {
        self.document.open(path);
    }

    /// Opens files that were dropped or chosen, and the watched one if it has changed.
    pub(super) fn open_files(&mut self, context: &Context) {
        let dropped = context.input_mut(|input| std::mem::take(&mut input.raw.dropped_files));
        for file in dropped {
            self.open(file.path());
        }
        match self.dialogs.file_to_open() {
            None => {}
            Some(Answer::Chosen(path)) => self.open(&path),
            Some(Answer::Closed) => {
                self.session.note("No file was chosen. Files can also be dropped onto this window.");
            }
            Some(Answer::Missing) => self.session.error(&anyhow!("{NO_DIALOG}. Or drop files onto this window")),
        }
        self.document.look_for_changes(context);
        if let Some(read) = self.document.take_read(context) {
            self.take_file(read);
        }
    }

    /// Waits until all files have been read that were opened or have changed.
    pub fn wait_for_files(&mut self) {
        while let Some(read) = self.document.wait_for_read() {
            self.take_file(read);
        }
    }

    /// Shows what a file holds.
    fn take_file(&mut self, read: ReadFile) {
        let ReadFile { path, reason, contents } = read;
        let shown = contents.and_then(|contents| match reason {
            Reason::Opened => self.show_contents(contents, &path),
            Reason::Changed => self.show_changed(contents, &path),
        });
        if let Err(error) = shown {
            self.session.error(&error);
        }
    }

    fn show_contents(&mut self, contents: Contents, path: &Path) -> anyhow::Result<()> {
        match contents {
            Contents::Subject(subject, source, run) => {
                self.show_subject(*subject, &source)?;
                self.document.begin(&source, run);
                self.stage.reset_view(&self.document.subject);
            }
            Contents::Capture(capture) => self.show_capture(*capture),
            Contents::Poses(sequence, keys) => {
                for warning in &sequence.warnings {
                    self.session.note(warning);
                }
                self.document.show_poses(path, sequence, keys);
            }
        }
        self.session.add_recent(path);
        Ok(())
    }

    /// Shows the watched file as it is now.
    fn show_changed(&mut self, contents: Contents, path: &Path) -> anyhow::Result<()> {
        // Something else may have been opened since.
        if !self.document.is_watched(path) {
            return Ok(());
        }
        self.show_again(contents, path)?;
        // Training changes it all the time.
        if !self.document.is_training() {
            self.session.note(format!("{} has changed and was read again.", file_name(path)));
        }
        Ok(())
    }

    /// Shows another file of what is shown; pose, shape, motion and view stay.
    fn show_again(&mut self, contents: Contents, path: &Path) -> anyhow::Result<()> {
        let Contents::Subject(mut subject, ..) = contents else { return Ok(()) };
        subject.continue_from(&self.document.subject);
        self.show_subject(*subject, path)?;
        if let Err(error) = self.document.renew_trained_poses() {
            self.session.note(format!("{error:#}"));
        }
        Ok(())
    }

    /// Shows another subject, if the device can hold it.
    fn show_subject(&mut self, subject: Subject, path: &Path) -> anyhow::Result<()> {
        self.stage.replace(&subject)?;
        self.live.subject_changed(&subject);
        self.document.replace(subject, path);
        Ok(())
    }

    /// The menu of recent files.
    pub(super) fn recent_menu(&mut self, ui: &mut Ui) {
        let recent = self.session.settings.recent.clone();
        ui.add_enabled_ui(!recent.is_empty(), |ui| {
            ui.menu_button("Open recent", |ui| {
                for path in recent {
                    if ui.button(file_name(&path)).on_hover_text(path.display().to_string()).clicked() {
                        ui.close();
                        self.open(&path);
                    }
                }
            });
        });
    }
}

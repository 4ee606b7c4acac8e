//! Opens files, in a window that stays usable: dropped ones, chosen ones, recent ones, and those that change on disk.

use std::path::Path;
use std::time::Duration;

use anyhow::anyhow;
use egui::{Align2, Color32, Context, FontId, Rect, Ui};
use ghand_core::HandModel;
use ghand_motion::{KeyFrames, PoseSequence};

use crate::hand_model_file::is_hand_name;
use crate::lighting::Lighting;
use crate::viewer::app::Viewer;
use crate::viewer::dialogs::file_dialog::{Answer, FileDialog, NO_DIALOG};
use crate::viewer::document::file_reader::{Contents, ReadFile, Reason, file_name};
use crate::viewer::document::subject::Subject;
use crate::viewer::document::training_run::TrainingRun;
use crate::viewer::document::watched_file::WatchedFile;
use crate::viewer::rendering::picture::Picture;

/// Interval of looks at the watched file.
const LOOK: Duration = Duration::from_secs(1);

impl Viewer {
    /// Reads the subject again, in this light, whenever this file changes.
    pub fn watch(&mut self, path: &Path, light: &Lighting) {
        self.light = light.clone();
        self.watched = (!is_hand_name(path)).then(|| WatchedFile::new(path));
    }

    /// Shows beside the avatar how the run goes that trains it, and follows the run to its result.
    pub fn follow_run(&mut self, run: TrainingRun) {
        self.run = Some(run);
    }

    /// Shows the newest avatar of the run, and reads how it goes.
    fn look_at_run(&mut self, context: &Context) {
        let Some(run) = &mut self.run else { return };
        context.request_repaint_after(LOOK);
        if !run.look(context) {
            return;
        }
        let newest = run.avatar();
        if let Some(path) = newest.filter(|path| self.watched.as_ref().is_none_or(|watched| watched.path() != path)) {
            let light = self.light.clone();
            self.watch(&path, &light);
            self.reload();
        }
    }

    /// Opens files that were dropped or chosen, and the watched one if it has changed.
    pub(super) fn open_files(&mut self, context: &Context) {
        let dropped = context.input_mut(|input| std::mem::take(&mut input.raw.dropped_files));
        for file in dropped {
            self.open(file.path());
        }
        if let Some(answer) = self.file_dialog.as_ref().and_then(FileDialog::poll) {
            self.file_dialog = None;
            match answer {
                Answer::Chosen(path) => self.open(&path),
                Answer::Closed => self.toasts.note("No file was chosen. Files can also be dropped onto this window."),
                Answer::Missing => {
                    self.toasts.error(&anyhow!("{NO_DIALOG}. Or drop files onto this window"));
                }
            }
        }
        self.look_at_run(context);
        let now = context.input(|input| input.time);
        if let Some(watched) = &mut self.watched {
            context.request_repaint_after(LOOK);
            if !self.files.is_busy() && watched.has_changed(now) {
                self.reload();
            }
        }
        if let Some(read) = self.files.poll(model_of(&self.subject), context) {
            self.take_file(read);
        }
    }

    /// Waits until all files have been read that were opened or have changed.
    pub fn wait_for_files(&mut self) {
        while let Some(read) = self.files.wait(model_of(&self.subject)) {
            self.take_file(read);
        }
    }

    /// Opens a file of any kind, once it has been read beside the user interface: an avatar, a hand model or a scene
    /// becomes the subject, poses are shown by the present hand, a capture's cameras are offered. If it cannot be opened, a
    /// message says why and nothing changes.
    pub fn open(&mut self, path: &Path) {
        self.files.ask(path, Reason::Opened, &self.light);
    }

    /// Reads the watched file again.
    fn reload(&mut self) {
        if let Some(watched) = &self.watched {
            self.files.ask(watched.path(), Reason::Changed, &self.light);
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
            self.toasts.error(&error);
        }
    }

    fn show_contents(&mut self, contents: Contents, path: &Path) -> anyhow::Result<()> {
        match contents {
            Contents::Subject(subject, source, run) => {
                self.show_subject(*subject, &source)?;
                self.watch(&source, &Lighting::default());
                (self.capture, self.run) = (None, run);
                self.reset_view();
            }
            Contents::Capture(capture) => self.show_capture(*capture),
            Contents::Poses(sequence, keys) => self.show_poses(path, sequence, keys),
        }
        self.settings.add_recent(path);
        self.save_settings();
        Ok(())
    }

    fn show_poses(&mut self, path: &Path, sequence: PoseSequence, keys: Option<KeyFrames>) {
        for warning in &sequence.warnings {
            self.toasts.note(warning);
        }
        let Subject::Hand(hand) = &mut self.subject else { return };
        match keys {
            Some(keys) => hand.show_keys(file_name(path), sequence, keys),
            None => hand.show(file_name(path), sequence),
        }
    }

    /// Shows the watched file as it is now.
    fn show_changed(&mut self, contents: Contents, path: &Path) -> anyhow::Result<()> {
        // Something else may have been opened since.
        if self.watched.as_ref().is_none_or(|watched| watched.path() != path) {
            return Ok(());
        }
        self.show_again(contents, path)?;
        // Training changes it all the time.
        if !self.run.as_ref().is_some_and(TrainingRun::is_going_on) {
            self.toasts.note(format!("{} has changed and was read again.", file_name(path)));
        }
        Ok(())
    }

    /// Shows another file of what is shown; pose, shape, motion and view stay.
    fn show_again(&mut self, contents: Contents, path: &Path) -> anyhow::Result<()> {
        let Contents::Subject(mut subject, ..) = contents else { return Ok(()) };
        subject.continue_from(&self.subject);
        self.show_subject(*subject, path)?;
        self.renew_trained_poses();
        Ok(())
    }

    /// Shows another subject, if the device can hold it.
    fn show_subject(&mut self, subject: Subject, path: &Path) -> anyhow::Result<()> {
        let picture = Picture::new(&self.gpu, subject.on_device(&self.gpu, [self.largest_edge; 2])?)?;
        self.picture = picture;
        self.subject = subject;
        self.live_subject_changed();
        self.source = path.display().to_string();
        (self.shown, self.failure, self.handle_drag) = (None, None, None);
        self.truth.forget_comparison();
        self.layers.forget_subject();
        (self.detail, self.too_many) = (1.0, u32::MAX);
        Ok(())
    }

    /// The menu of recent files.
    pub(super) fn recent_menu(&mut self, ui: &mut Ui) {
        let recent = self.settings.recent.clone();
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

    /// Says over the view what dropping files does, while they are held there.
    pub(super) fn drop_hint(&self, ui: &Ui, rect: Rect) {
        if ui.input(|input| input.raw.hovered_files.is_empty()) {
            return;
        }
        ui.painter().rect_filled(rect, 0.0, Color32::from_black_alpha(160));
        let text = "Drop an avatar, hand model, scene, poses, capture or run of training";
        ui.painter().text(rect.center(), Align2::CENTER_CENTER, text, FontId::proportional(20.0), Color32::WHITE);
    }
}

/// The hand model of a subject that has one.
fn model_of(subject: &Subject) -> Option<&HandModel> {
    match subject {
        Subject::Hand(hand) => Some(hand.model()),
        Subject::Scene { .. } => None,
    }
}

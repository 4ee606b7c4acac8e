//! Opens files, in a window that stays usable: dropped ones, chosen ones, recent ones, and those that change on disk.

use std::path::Path;
use std::time::Duration;

use anyhow::Context as _;
use egui::{Align2, Color32, Context, FontId, Rect, Ui};
use ghand_motion::KeyFrames;
use ghand_motion::pose_sequence::{DEFAULT_FPS, ghand::key_ids};

use crate::capture_args::CaptureOptions;
use crate::file_kind::{FileKind, file_kind};
use crate::hand_model_file::is_hand_name;
use crate::light_args::LightArgs;
use crate::pose_choice::PoseReadingArgs;
use crate::quality::Quality;
use crate::viewer::app::Viewer;
use crate::viewer::capture_panel::CapturePanel;
use crate::viewer::file_dialog::FileDialog;
use crate::viewer::picture::Picture;
use crate::viewer::quality_choice::QualityChoice;
use crate::viewer::subject::Subject;
use crate::viewer::training_run::TrainingRun;
use crate::viewer::watched_file::WatchedFile;

/// Interval of looks at the watched file.
const LOOK: Duration = Duration::from_secs(1);

impl Viewer {
    /// Reads the subject again, in this light, whenever this file changes.
    pub fn watch(&mut self, path: &Path, light: &LightArgs) {
        self.light = light.clone();
        self.watched = (!is_hand_name(path)).then(|| WatchedFile::new(path));
        self.quality = QualityChoice::exact((file_kind(path) == FileKind::Avatar).then_some(path));
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
        // What is shown may be a baked avatar.
        let newest = run.avatar();
        if let Some(path) = newest.filter(|path| self.watched.as_ref().is_none_or(|watched| watched.path() != path)) {
            let light = self.light.clone();
            self.watch(&path, &light);
            self.reload();
        }
    }

    /// Says in which preset the watched avatar is shown.
    pub fn play_as(&mut self, quality: QualityChoice) {
        self.quality = quality;
    }

    /// Prepares the avatar for a preset, beside the user interface.
    pub(super) fn choose_quality(&mut self, quality: Quality, context: &Context) {
        self.quality.choose(&self.gpu, quality, context);
        self.toasts.note(format!("Preparing `{}` ...", quality.name()));
    }

    /// Shows the avatar as it was prepared for a preset; pose, shape, motion and view stay.
    pub(super) fn take_quality(&mut self) {
        let shown = self.quality.poll().and_then(|prepared| {
            let Some(prepared) = prepared else { return Ok(false) };
            if let Some(path) = &prepared.file {
                let mut subject = Subject::read(path, &self.light)?;
                subject.continue_from(&self.subject);
                self.show_subject(subject, path)?;
                self.renew_trained_poses();
            }
            self.quality.show(&prepared);
            Ok(true)
        });
        match shown {
            Ok(false) => {}
            Ok(true) => self.toasts.note(format!("Played as `{}`.", self.quality.chosen().name())),
            Err(error) => self.toasts.error(&error),
        }
    }

    /// Opens files that were dropped or chosen, and the watched one if it has changed.
    pub(super) fn open_files(&mut self, context: &Context) {
        let dropped = context.input_mut(|input| std::mem::take(&mut input.raw.dropped_files));
        for file in dropped {
            self.open(file.path());
        }
        if let Some(chosen) = self.file_dialog.as_ref().and_then(FileDialog::poll) {
            self.file_dialog = None;
            match chosen {
                Some(path) => self.open(&path),
                // A desktop without a dialog cannot be told from one whose dialog was closed.
                None => self.toasts.note("No file was chosen. Files can also be dropped onto this window."),
            }
        }
        self.look_at_run(context);
        let now = context.input(|input| input.time);
        if let Some(watched) = &mut self.watched {
            context.request_repaint_after(LOOK);
            if watched.has_changed(now) {
                match self.quality.chosen() {
                    Quality::Exact => self.reload(),
                    baked => self.choose_quality(baked, context),
                }
            }
        }
    }

    /// Opens a file of any kind: an avatar, a hand model or a scene becomes the subject, poses are shown by the present
    /// hand, a capture's cameras are offered. If it cannot be opened, a message says why and nothing changes.
    pub fn open(&mut self, path: &Path) {
        match self.try_open(path) {
            Ok(()) => {
                self.settings.add_recent(path);
                self.save_settings();
            }
            Err(error) => self.toasts.error(&error),
        }
    }

    fn try_open(&mut self, path: &Path) -> anyhow::Result<()> {
        let is_capture = path.is_dir() || path.file_name().is_some_and(|name| name == "capture.json");
        if let Some(run) = TrainingRun::open(path)
            && let Some(avatar) = run.avatar()
        {
            self.open_subject(&avatar)?;
            self.follow_run(run);
            return Ok(());
        }
        match file_kind(path) {
            _ if is_capture => self.open_capture(path),
            FileKind::Avatar | FileKind::Ply => self.open_subject(path),
            // An archive or a pickle may also have poses.
            FileKind::HandModel => match self.open_subject(path) {
                Ok(()) => Ok(()),
                Err(error) => self.open_poses(path).map_err(|_| error),
            },
            FileKind::Other => self.open_poses(path),
        }
    }

    fn open_capture(&mut self, path: &Path) -> anyhow::Result<()> {
        let Subject::Hand(hand) = &self.subject else { anyhow::bail!("a scene has no place in a capture") };
        let capture = CapturePanel::open(path, &CaptureOptions::default(), hand.model())?;
        self.show_capture(capture);
        Ok(())
    }

    fn open_poses(&mut self, path: &Path) -> anyhow::Result<()> {
        let Subject::Hand(hand) = &mut self.subject else {
            anyhow::bail!("{}: a scene of Gaussians cannot be posed; open an avatar first", path.display())
        };
        let text = path.to_str().context("the file's name is not text")?;
        let sequence = PoseReadingArgs::default().load(text, hand.model())?;
        for warning in &sequence.warnings {
            self.toasts.note(warning);
        }
        let name = path.file_name().map_or_else(|| text.to_owned(), |name| name.to_string_lossy().into_owned());
        // Keys are on frames of this rate.
        let keys = if sequence.fps == DEFAULT_FPS { key_ids(path) } else { Vec::new() };
        match KeyFrames::of_sequence(&sequence, &keys) {
            Some(keys) => hand.show_keys(name, sequence, keys),
            None => hand.show(name, sequence),
        }
        Ok(())
    }

    fn open_subject(&mut self, path: &Path) -> anyhow::Result<()> {
        let subject = Subject::read(path, &LightArgs::default())?;
        self.show_subject(subject, path)?;
        self.watch(path, &LightArgs::default());
        (self.capture, self.run) = (None, None);
        self.reset_view();
        Ok(())
    }

    /// Reads the watched file again; pose, shape, motion and view stay.
    fn reload(&mut self) {
        let Some(path) = self.watched.as_ref().map(|watched| watched.path().to_owned()) else { return };
        let reloaded = Subject::read(&path, &self.light).and_then(|mut subject| {
            subject.continue_from(&self.subject);
            self.show_subject(subject, &path)
        });
        match reloaded {
            Ok(()) => {
                self.renew_trained_poses();
                // Training changes it all the time.
                if !self.run.as_ref().is_some_and(TrainingRun::is_going_on) {
                    self.toasts.note(format!("{} has changed and was read again.", file_name(&path)));
                }
            }
            Err(error) => self.toasts.error(&error),
        }
    }

    /// Shows another subject, if the device can hold it.
    fn show_subject(&mut self, subject: Subject, path: &Path) -> anyhow::Result<()> {
        let picture = Picture::new(&self.gpu, &subject, [self.largest_edge; 2])?;
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

/// The last part of a path.
pub(super) fn file_name(path: &Path) -> String {
    path.file_name().map_or_else(|| path.display().to_string(), |name| name.to_string_lossy().into_owned())
}

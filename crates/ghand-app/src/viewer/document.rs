//! What is open: the subject and where it is from, the run that trains it, and the capture beside it.
//!
//! [`Document`] owns these and reads files. It knows neither the screen nor the device, and returns what the user should
//! read instead of showing it.

pub mod capture_panel;
pub mod capture_poses;
pub mod file_reader;
pub mod scene;
pub mod subject;
pub mod training_run;
pub mod watched_file;

use std::path::Path;
use std::time::Duration;

use anyhow::{Context as _, bail};
use egui::{Context, RichText, Ui};
use ghand_avatar::Avatar;
use ghand_core::{Camera, HandModel};
use ghand_files::atomic_file::write_atomically;
use ghand_motion::{KeyFrames, PoseSequence};
use glam::DVec3;

use crate::hand_model_file::is_hand_name;
use crate::lighting::Lighting;
use crate::viewer::document::capture_panel::CapturePanel;
use crate::viewer::document::file_reader::{FileReader, ReadFile, Reason, file_name};
use crate::viewer::document::subject::Subject;
use crate::viewer::document::training_run::TrainingRun;
use crate::viewer::document::watched_file::WatchedFile;
use crate::viewer::hand::Hand;

/// Interval of looks at the watched file.
const LOOK: Duration = Duration::from_secs(1);
/// Endings of the files of subjects.
const FILE_ENDINGS: [&str; 8] = ["ghand", "ply", "spz", "splat", "glb", "gltf", "pkl", "npz"];

/// What is open.
pub struct Document {
    pub(in crate::viewer) subject: Subject,
    source: String,
    /// The file that is read again whenever it changes.
    watched: Option<WatchedFile>,
    /// The light in which the watched file is read.
    light: Lighting,
    /// The run of training whose avatar is shown.
    run: Option<TrainingRun>,
    capture: Option<CapturePanel>,
    /// Files that are being read.
    reader: FileReader,
}

impl Document {
    /// A subject; `source` says where it is from.
    pub fn new(subject: Subject, source: String) -> Document {
        Document {
            subject,
            source,
            watched: None,
            light: Lighting::default(),
            run: None,
            capture: None,
            reader: FileReader::default(),
        }
    }

    /// Where the subject is from.
    pub fn source(&self) -> &str {
        &self.source
    }

    /// The hand, if the subject is one.
    pub fn hand(&self) -> Option<&Hand> {
        match &self.subject {
            Subject::Hand(hand) => Some(hand),
            Subject::Scene { .. } => None,
        }
    }

    /// The hand, to change it.
    pub fn hand_mut(&mut self) -> Option<&mut Hand> {
        match &mut self.subject {
            Subject::Hand(hand) => Some(hand),
            Subject::Scene { .. } => None,
        }
    }

    /// The avatar, if the subject is one.
    pub fn avatar(&self) -> Option<&Avatar> {
        self.hand().and_then(Hand::avatar)
    }

    /// The capture beside the subject.
    pub fn capture(&self) -> Option<&CapturePanel> {
        self.capture.as_ref()
    }

    /// The subject's name without the ending of its file.
    pub fn stem(&self) -> String {
        let name = self.subject.name();
        match name.rsplit_once('.') {
            Some((rest, ending)) if FILE_ENDINGS.iter().any(|known| known.eq_ignore_ascii_case(ending)) => rest.into(),
            _ => name,
        }
    }

    /// Shows what is open and how the run goes that trains it.
    pub fn heading(&self, ui: &mut Ui) {
        ui.heading(self.subject.name());
        ui.label(RichText::new(&self.source).weak());
        ui.separator();
        if let Some(run) = &self.run {
            run.show(ui);
            ui.separator();
        }
    }
}

/// Files.
impl Document {
    /// Reads the subject again, in this light, whenever this file changes.
    pub fn watch(&mut self, path: &Path, light: &Lighting) {
        self.light = light.clone();
        self.watched = (!is_hand_name(path)).then(|| WatchedFile::new(path));
    }

    /// Whether this is the file that is read again whenever it changes.
    pub fn is_watched(&self, path: &Path) -> bool {
        self.watched.as_ref().is_some_and(|watched| watched.path() == path)
    }

    /// Begins to read a file of any kind.
    pub fn open(&mut self, path: &Path) {
        self.reader.ask(path, Reason::Opened, &self.light);
    }

    /// Reads the newest avatar of the run and the watched file again, if they have changed.
    pub fn look_for_changes(&mut self, context: &Context) {
        self.look_at_run(context);
        let now = context.input(|input| input.time);
        if let Some(watched) = &mut self.watched {
            context.request_repaint_after(LOOK);
            if !self.reader.is_busy() && watched.has_changed(now) {
                self.read_again();
            }
        }
    }

    /// Follows the newest avatar of the run, and reads how it goes.
    fn look_at_run(&mut self, context: &Context) {
        let Some(run) = &mut self.run else { return };
        context.request_repaint_after(LOOK);
        if !run.look(context) {
            return;
        }
        if let Some(path) = run.avatar().filter(|path| !self.is_watched(path)) {
            let light = self.light.clone();
            self.watch(&path, &light);
            self.read_again();
        }
    }

    /// Reads the watched file again.
    fn read_again(&mut self) {
        if let Some(watched) = &self.watched {
            self.reader.ask(watched.path(), Reason::Changed, &self.light);
        }
    }

    /// The file that has been read, if one has; the user interface is drawn again once the next one has been.
    pub fn take_read(&mut self, context: &Context) -> Option<ReadFile> {
        self.reader.poll(model_of(&self.subject), context)
    }

    /// As [`Document::take_read`], but waits; `None` if there are no files to read.
    pub fn wait_for_read(&mut self) -> Option<ReadFile> {
        self.reader.wait(model_of(&self.subject))
    }

    /// Whether files are being read or wait for it.
    pub fn is_reading(&self) -> bool {
        self.reader.is_busy()
    }

    /// Says over the view which file is being read.
    pub fn show_reading(&self, context: &Context) {
        self.reader.show(context);
        if self.reader.is_busy() {
            // A file that was opened after the others were looked at is read in the next frame.
            context.request_repaint();
        }
    }

    /// Another subject, from a file.
    pub fn replace(&mut self, subject: Subject, path: &Path) {
        self.subject = subject;
        self.source = path.display().to_string();
    }

    /// Watches the file of a subject that was opened; it has this run and no capture.
    pub fn begin(&mut self, source: &Path, run: Option<TrainingRun>) {
        self.watch(source, &Lighting::default());
        (self.capture, self.run) = (None, run);
    }
}

/// The run of training.
impl Document {
    /// Follows this run to its result.
    pub fn follow_run(&mut self, run: TrainingRun) {
        self.run = Some(run);
    }

    /// Whether the run goes on.
    pub fn is_training(&self) -> bool {
        self.run.as_ref().is_some_and(TrainingRun::is_going_on)
    }

    /// Forgets pictures of a user interface that has ended.
    pub fn forget_pictures(&mut self) {
        if let Some(hand) = self.hand_mut() {
            hand.forget_thumbnails();
        }
        self.run.iter_mut().for_each(TrainingRun::forget_pictures);
    }
}

/// The capture.
impl Document {
    /// Takes a capture, with the poses that training found. Returns remarks for the user.
    pub fn take_capture(&mut self, mut capture: CapturePanel) -> Vec<String> {
        let problem = self.read_trained_poses(&mut capture).err().map(|error| format!("{error:#}"));
        let remarks = problem.into_iter().chain(capture.remarks.iter().cloned()).collect();
        self.capture = Some(capture);
        remarks
    }

    /// Reads the poses that training found, if the avatar is from a file and they are beside it.
    fn read_trained_poses(&self, capture: &mut CapturePanel) -> anyhow::Result<()> {
        match (&self.watched, self.hand()) {
            (Some(watched), Some(hand)) if hand.avatar().is_some() => {
                capture.read_trained_poses(watched.path(), hand.model())
            }
            _ => Ok(()),
        }
    }

    /// Reads the poses of training again, because the avatar's file has changed. A hand in the pose of the frame follows it.
    ///
    /// # Errors
    /// One sentence that names the file of poses if it is broken or belongs to another capture.
    pub fn renew_trained_poses(&mut self) -> anyhow::Result<()> {
        let Some(mut capture) = self.capture.take() else { return Ok(()) };
        let follows = capture.chosen().map(|(_, pose)| pose) == self.subject.pose();
        let read = self.read_trained_poses(&mut capture);
        if let (true, Some(hand), Some((_, pose))) = (follows, self.hand_mut(), capture.chosen()) {
            hand.pose.clone_from(pose);
        }
        self.capture = Some(capture);
        read
    }

    /// Chooses the capture's poses as given instead of those of training, or the other way round.
    pub fn switch_capture_poses(&mut self) {
        if let Some(capture) = &mut self.capture {
            capture.choose_poses(!capture.poses().are_of_training());
        }
    }

    /// Chooses the camera that many further.
    pub fn step_camera(&mut self, by: isize) {
        if let Some(capture) = &mut self.capture {
            capture.step_camera(by);
        }
    }

    /// Shows the choice of camera and frame. Returns whether the user chose.
    pub fn capture_controls(&mut self, ui: &mut Ui) -> bool {
        self.capture.as_mut().is_some_and(|capture| capture.show(ui))
    }

    /// Takes the pose of the capture's chosen frame. Returns the chosen camera and the depth of the subject's middle, metres.
    pub fn take_captured_pose(&mut self) -> Option<(Camera, f64)> {
        let (camera, pose) = self.capture.as_ref().and_then(CapturePanel::chosen)?;
        let mut middle = DVec3::ZERO;
        if let Subject::Hand(hand) = &mut self.subject {
            hand.pause();
            hand.pose.clone_from(pose);
            middle = ghand_avatar::framing::middle(&hand.posed_vertices());
        }
        Some((camera.clone(), camera.camera_from_world(middle).z))
    }
}

/// The pose and the motion.
impl Document {
    /// Changes the hand, if the subject is one.
    pub fn edit_hand(&mut self, edit: impl FnOnce(&mut Hand)) {
        if let Some(hand) = self.hand_mut() {
            edit(hand);
        }
    }

    /// Shows poses of a file.
    pub fn show_poses(&mut self, path: &Path, sequence: PoseSequence, keys: Option<KeyFrames>) {
        let Some(hand) = self.hand_mut() else { return };
        match keys {
            Some(keys) => hand.show_keys(file_name(path), sequence, keys),
            None => hand.show(file_name(path), sequence),
        }
    }

    /// Keeps the pose as a key. Returns the name of the other motion that had to go for it.
    pub fn set_key(&mut self) -> Option<String> {
        let hand = self.hand_mut()?;
        let other = hand.timeline.as_ref().filter(|timeline| timeline.keys().is_none());
        let replaced = other.map(|timeline| timeline.title().to_owned());
        hand.set_key();
        replaced
    }

    /// Whether there is a motion to save: one key alone is a pose.
    pub fn has_motion(&self) -> bool {
        self.hand().and_then(|hand| hand.timeline.as_ref()).is_some_and(|timeline| timeline.end() > 0.0)
    }

    /// Saves the motion as a file of poses.
    ///
    /// # Errors
    /// One sentence if there is none or the file cannot be written.
    pub fn save_motion(&self, path: &Path) -> anyhow::Result<()> {
        let Some(hand) = self.hand() else { bail!("a scene has no motion") };
        let json = hand.motion_json().context("there is no motion to save")?;
        write_atomically(path, json.as_bytes()).with_context(|| format!("{}: cannot be written", path.display()))
    }
}

/// The hand model of a subject that has one.
fn model_of(subject: &Subject) -> Option<&HandModel> {
    match subject {
        Subject::Hand(hand) => Some(hand.model()),
        Subject::Scene { .. } => None,
    }
}

#[cfg(test)]
impl Document {
    /// The file that is read again whenever it changes.
    pub(crate) fn watched(&self) -> Option<&Path> {
        self.watched.as_ref().map(|watched| watched.path())
    }
}

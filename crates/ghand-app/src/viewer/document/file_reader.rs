//! Reads files beside the user interface, one after the other: large ones take seconds.

use std::collections::VecDeque;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, TryRecvError, channel};

use anyhow::{Context as _, anyhow};
use egui::{Align2, Area, Context, Frame, Id, Spinner, vec2};
use ghand_core::HandModel;
use ghand_files::value::ValueError;
use ghand_motion::pose_sequence::DEFAULT_FPS;
use ghand_motion::pose_sequence::formats::ghand::key_ids;
use ghand_motion::{KeyFrames, PoseError, PoseSequence};

use crate::capture_source::CaptureReading;
use crate::file_kind::{FileKind, file_kind};
use crate::lighting::Lighting;
use crate::pose_choice::PoseReadingArgs;
use crate::viewer::document::capture_panel::CapturePanel;
use crate::viewer::document::subject::Subject;
use crate::viewer::document::training_run::TrainingRun;

/// What a file holds.
pub enum Contents {
    /// An avatar, a hand model or a scene, with its path and the run that trains it.
    Subject(Box<Subject>, PathBuf, Option<TrainingRun>),
    /// A capture, for the hand that was shown.
    Capture(Box<CapturePanel>),
    /// Poses for that hand, with the keys among them.
    Poses(PoseSequence, Option<KeyFrames>),
}

/// Why a file is read.
pub enum Reason {
    /// Somebody opened it.
    Opened,
    /// It is shown, and has changed.
    Changed,
}

/// A file that was read.
pub struct ReadFile {
    /// The path that was given.
    pub path: PathBuf,
    /// Why it was read.
    pub reason: Reason,
    /// What it holds, or why it cannot be read.
    pub contents: anyhow::Result<Contents>,
}

struct Wanted {
    path: PathBuf,
    reason: Reason,
    light: Lighting,
}

/// Files that are read, in their order.
#[derive(Default)]
pub struct FileReader {
    waiting: VecDeque<Wanted>,
    /// The one that is being read.
    reading: Option<(PathBuf, Receiver<ReadFile>)>,
}

impl FileReader {
    /// Reads a file after those before it; avatars are put into this light.
    pub fn ask(&mut self, path: &Path, reason: Reason, light: &Lighting) {
        self.waiting.push_back(Wanted { path: path.to_owned(), reason, light: light.clone() });
    }

    /// Whether files are being read or wait for it.
    pub fn is_busy(&self) -> bool {
        self.reading.is_some() || !self.waiting.is_empty()
    }

    /// The file that has been read, if one has; begins with the next one. `model` is the hand that is shown. The user
    /// interface is drawn again once the file has been read.
    pub fn poll(&mut self, model: Option<&HandModel>, context: &Context) -> Option<ReadFile> {
        let done = match &self.reading {
            None => None,
            Some((path, done)) => match done.try_recv() {
                Err(TryRecvError::Empty) => return None,
                read => Some(read_or_failed(path, read.ok())),
            },
        };
        if done.is_some() {
            self.reading = None;
            // What it holds may be the hand for which the next one is read.
            context.request_repaint();
            return done;
        }
        let context = context.clone();
        self.start(model, move || context.request_repaint());
        None
    }

    /// As [`FileReader::poll`], but waits; `None` if there are no files to read.
    pub fn wait(&mut self, model: Option<&HandModel>) -> Option<ReadFile> {
        if self.reading.is_none() {
            self.start(model, || {});
        }
        let (path, done) = self.reading.take()?;
        Some(read_or_failed(&path, done.recv().ok()))
    }

    fn start(&mut self, model: Option<&HandModel>, when_done: impl FnOnce() + Send + 'static) {
        let Some(Wanted { path, reason, light }) = self.waiting.pop_front() else { return };
        let (sender, done) = channel();
        self.reading = Some((path.clone(), done));
        let model = model.cloned();
        std::thread::spawn(move || {
            let contents = match reason {
                Reason::Opened => read(&path, model.as_ref()),
                Reason::Changed => read_subject(&path, &light),
            };
            // A closed channel means that the viewer no longer waits.
            let _ = sender.send(ReadFile { path, reason, contents });
            when_done();
        });
    }

    /// Says in the middle of the window's top which file is being read.
    pub fn show(&self, context: &Context) {
        let Some((path, _)) = &self.reading else { return };
        let area = Area::new(Id::unique("reading")).anchor(Align2::CENTER_TOP, vec2(0.0, 12.0)).interactable(false);
        area.show(context, |ui| {
            Frame::popup(ui.style()).show(ui, |ui| {
                ui.horizontal(|ui| {
                    ui.add(Spinner::new());
                    ui.label(format!("Reading {} ...", file_name(path)));
                });
            });
        });
    }
}

/// A thread that ended without an answer has panicked.
fn read_or_failed(path: &Path, read: Option<ReadFile>) -> ReadFile {
    read.unwrap_or_else(|| ReadFile {
        path: path.to_owned(),
        reason: Reason::Opened,
        contents: Err(anyhow::anyhow!("{}: cannot be read", path.display())),
    })
}

/// Reads a file of any kind; `model` is the hand that is shown.
fn read(path: &Path, model: Option<&HandModel>) -> anyhow::Result<Contents> {
    let light = Lighting::default();
    if let Some(run) = TrainingRun::open(path)
        && let Some(avatar) = run.avatar()
    {
        return Ok(Contents::Subject(Box::new(Subject::read(&avatar, &light)?), avatar, Some(run)));
    }
    if path.is_dir() || path.file_name().is_some_and(|name| name == "capture.json") {
        let model = model.context("a scene has no place in a capture")?;
        return Ok(Contents::Capture(Box::new(CapturePanel::open(path, &CaptureReading::default(), model)?)));
    }
    match file_kind(path) {
        FileKind::Avatar | FileKind::Scene => read_subject(path, &light),
        // An archive or a pickle may also have poses.
        FileKind::HandModel => read_subject(path, &light).or_else(|error| read_poses(path, model).map_err(|_| error)),
        FileKind::Other => read_poses(path, model).map_err(|error| match error.downcast_ref() {
            Some(PoseError::File { source: ValueError::UnknownKind, .. }) => anyhow!(
                "{}: is neither an avatar (.ghand), nor a scene (.ply), nor a hand model (.glb, .gltf, .pkl, .npz), nor \
                 poses (.json, .jsonl, .npz, .npy, .pkl)",
                path.display()
            ),
            _ => error,
        }),
    }
}

fn read_subject(path: &Path, light: &Lighting) -> anyhow::Result<Contents> {
    Ok(Contents::Subject(Box::new(Subject::read(path, light)?), path.to_owned(), None))
}

fn read_poses(path: &Path, model: Option<&HandModel>) -> anyhow::Result<Contents> {
    let unposable = || format!("{}: a scene of Gaussians cannot be posed; open an avatar first", path.display());
    let model = model.with_context(unposable)?;
    let text = path.to_str().context("the file's name is not text")?;
    let sequence = PoseReadingArgs::default().load(text, model)?;
    // Keys are on frames of this rate.
    let keys = if sequence.fps == DEFAULT_FPS { key_ids(path) } else { Vec::new() };
    let keys = KeyFrames::of_sequence(&sequence, &keys);
    Ok(Contents::Poses(sequence, keys))
}

/// The last part of a path.
pub fn file_name(path: &Path) -> String {
    path.file_name().map_or_else(|| path.display().to_string(), |name| name.to_string_lossy().into_owned())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

    use egui_kittest::Harness;
    use egui_kittest::kittest::Queryable;

    use super::*;

    #[test]
    fn a_file_is_named_while_it_is_read_and_no_longer() {
        let (sender, done) = channel();
        let reader = FileReader { reading: Some(("a/large.ghand".into(), done)), ..FileReader::default() };
        let mut ui = Harness::new_ui_state(
            |ui, reader: &mut FileReader| {
                let _ = reader.poll(None, ui.ctx());
                reader.show(ui.ctx());
            },
            reader,
        );
        let named = |ui: &Harness<'_, FileReader>| ui.query_by_label("Reading large.ghand ...").is_some();
        ui.run_steps(3);
        assert!(named(&ui) && ui.state().is_busy());
        let contents = Err(anyhow::anyhow!("broken"));
        sender.send(ReadFile { path: "a/large.ghand".into(), reason: Reason::Opened, contents }).unwrap();
        ui.run_steps(2);
        assert!(!named(&ui) && !ui.state().is_busy());
    }

    #[test]
    fn a_reader_that_panics_is_an_error() {
        let (sender, done) = channel();
        drop(sender);
        let mut reader = FileReader { reading: Some(("a.ghand".into(), done)), ..FileReader::default() };
        let read = reader.wait(None).unwrap();
        assert_eq!(read.contents.err().unwrap().to_string(), "a.ghand: cannot be read");
        assert!(reader.wait(None).is_none());
    }
}

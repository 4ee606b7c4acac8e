//! Saves pictures and films of the view, beside the user interface.

use std::f64::consts::TAU;
use std::path::{Path, PathBuf};

use egui::{Align2, Area, Context, Frame, Id, Order, ProgressBar};
use ghand_motion::pose_sequence::DEFAULT_FPS;
use ghand_pictures::{Background, LONGEST_TURN_SECONDS};

use crate::viewer::app::Viewer;
use crate::viewer::app::saving::Saving;
use crate::viewer::dialogs::file_dialog::FileDialog;
use crate::viewer::dialogs::output_dialog::{Asked, OutputDialog, OutputKind};
use crate::viewer::document::file_reader::file_name;
use crate::viewer::document::subject::Subject;
use crate::viewer::document::training_run::TrainingRun;
use crate::viewer::live::Live;
use crate::viewer::output::{OutputJob, OutputPlan};
use crate::viewer::rendering::drawing::GaussianColors;
use crate::viewer::rendering::drawn_subject::DrawnSubject;
use crate::viewer::rendering::frame::PictureInputs;
use crate::viewer::rendering::picture::Progress;

/// Size of pictures and films that are offered if there is no picture yet, pixels.
const SIZE: [u32; 2] = [1280, 800];
/// Endings of the files of subjects.
const FILE_ENDINGS: [&str; 8] = ["ghand", "ply", "spz", "splat", "glb", "gltf", "pkl", "npz"];

impl Viewer {
    /// Asks what to save of the view.
    pub(super) fn ask_for_output(&mut self, kind: OutputKind) {
        let size = self.picture.texture().map_or(SIZE, |texture| [texture.width(), texture.height()]);
        self.output_dialog = Some(OutputDialog::new(kind, size));
    }

    /// Whether there is a motion to save: one key alone is a pose.
    pub(super) fn has_motion(&self) -> bool {
        let Subject::Hand(hand) = &self.subject else { return false };
        hand.timeline.as_ref().is_some_and(|timeline| timeline.end() > 0.0)
    }

    /// Shows the question what to save, and the progress of what is being saved.
    pub(super) fn show_output(&mut self, context: &Context) {
        let has_motion = self.has_motion();
        if let Some(mut dialog) = self.output_dialog.take() {
            match dialog.show(context, has_motion) {
                Asked::Open => self.output_dialog = Some(dialog),
                Asked::Closed => {}
                Asked::Save => {
                    let chooser = match dialog.ending() {
                        None => FileDialog::folder(context),
                        Some(ending) => {
                            let name = format!("{}.{ending}", without_ending(&self.subject.name()));
                            FileDialog::save(context, &name, "Pictures and films", &[ending])
                        }
                    };
                    self.save_dialog = Some((chooser, Saving::Output(dialog)));
                }
            }
        }
        self.show_progress(context);
        let Some(result) = self.output.as_ref().and_then(OutputJob::poll) else { return };
        self.output = None;
        match result {
            Ok(text) => self.toasts.note(format!("Saved {text}.")),
            Err(error) => self.toasts.error(&error),
        }
    }

    /// Begins to save a picture or a film of the view, in the background: to a file, which gets its ending if it has none, or
    /// a film's pictures to a folder.
    ///
    /// # Errors
    /// One sentence if that is impossible.
    pub fn save_output(&mut self, asked: &OutputDialog, path: &Path, context: &Context) -> anyhow::Result<()> {
        let mut path = path.as_os_str().to_owned();
        match asked.ending() {
            // A name with a dot is a folder's, too.
            None => path.push(std::path::MAIN_SEPARATOR_STR),
            Some(ending) if !asked.fits(Path::new(&path)) => path.push(format!(".{ending}")),
            Some(_) => {}
        }
        let path = PathBuf::from(path);
        let plan = self.output_plan(asked);
        self.output = Some(OutputJob::start(&self.gpu, plan, &path, context)?);
        Ok(())
    }

    fn output_plan(&self, asked: &OutputDialog) -> OutputPlan {
        let [r, g, b] = self.shown.as_ref().map_or([0.0; 3], |shown| shown.background);
        let background = if asked.transparent { Background::Transparent } else { Background::Color([r, g, b]) };
        let inputs = |camera| PictureInputs {
            pose: self.subject.pose().cloned(),
            shape: self.subject.shape().to_vec(),
            light: self.subject.light().cloned(),
            camera,
            background: background.color(),
        };
        let (size, camera) = (asked.size, &self.camera);
        let mut fps = DEFAULT_FPS;
        let pictures = match asked.kind {
            OutputKind::Picture => vec![inputs(camera.camera(size))],
            OutputKind::Turntable => {
                let count = (LONGEST_TURN_SECONDS * DEFAULT_FPS) as usize;
                let at = |k: usize| {
                    let mut turned = camera.clone();
                    turned.turn(k as f64 / count as f64 * TAU);
                    inputs(turned.camera(size))
                };
                (0..count).map(at).collect()
            }
            OutputKind::Motion => {
                let Subject::Hand(hand) = &self.subject else { return self.empty_plan(background) };
                let Some((sequence, [from, to])) = hand.motion() else { return self.empty_plan(background) };
                fps = sequence.fps;
                let frames = (from * fps).round() as usize..=(to * fps).round() as usize;
                let view = camera.camera(size);
                let at = |k: usize| {
                    let frame = sequence.frames.get(k)?;
                    Some(PictureInputs { pose: Some(frame.pose.clone()), ..inputs(view.clone()) })
                };
                frames.filter_map(at).collect()
            }
        };
        let colors = match (self.picture.colors(), asked.kind) {
            // The colours of numbers are those of this pose.
            (GaussianColors::Given(_), OutputKind::Motion) => GaussianColors::Own,
            (colors, _) => colors.clone(),
        };
        OutputPlan { subject: self.subject.drawn(), pictures, colors, background, fps }
    }

    fn empty_plan(&self, background: Background) -> OutputPlan {
        let subject = self.subject.drawn();
        OutputPlan { subject, pictures: Vec::new(), colors: GaussianColors::Own, background, fps: DEFAULT_FPS }
    }

    /// Has pictures of the named poses made while nothing moves.
    pub(super) fn follow_thumbnails(&mut self, context: &Context, progress: Progress) {
        let is_shown = self.settings.thumbnails_shown && self.settings.panel_shown;
        let is_busy = progress == Progress::Busy
            || self.shown.is_none()
            || self.turntable
            || self.measure
            || self.live.as_ref().is_some_and(Live::is_receiving)
            || self.run.as_ref().is_some_and(TrainingRun::is_going_on)
            || context.input(|input| input.pointer.any_down());
        if let Subject::Hand(hand) = &mut self.subject {
            let is_busy = is_busy || hand.is_playing();
            hand.follow_thumbnails(&self.gpu, is_shown, is_busy, context);
        }
    }

    fn show_progress(&mut self, context: &Context) {
        let Some(job) = &self.output else { return };
        let (made, count) = job.progress();
        let name = file_name(job.path());
        let mut stopped = false;
        let area = Area::new(Id::unique("output progress")).order(Order::Foreground);
        area.anchor(Align2::CENTER_BOTTOM, [0.0, -14.0]).show(context, |ui| {
            Frame::popup(ui.style()).inner_margin(10.0).show(ui, |ui| {
                ui.set_max_width(360.0f32.min(context.content_rect().width() - 40.0));
                ui.horizontal(|ui| {
                    ui.label(format!("Saving {name}"));
                    let part = made as f32 / count.max(1) as f32;
                    ui.add(ProgressBar::new(part).desired_width(110.0).text(format!("{made} of {count}")));
                    stopped = ui.button("Stop").clicked();
                });
            });
        });
        if stopped {
            self.output = None;
            self.toasts.note(format!("{name} is not saved."));
        }
    }
}

/// A subject's name without the ending of its file.
fn without_ending(name: &str) -> &str {
    match name.rsplit_once('.') {
        Some((rest, ending)) if FILE_ENDINGS.iter().any(|known| known.eq_ignore_ascii_case(ending)) => rest,
        _ => name,
    }
}

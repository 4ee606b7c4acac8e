//! Pictures and films of what the viewer shows, made in the background.
//!
//! [`OutputPlan`] is what to make of the view; [`OutputJob`] makes it on a device of its own.

use std::f64::consts::TAU;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, TryRecvError, channel};

use anyhow::Context as _;
use egui::{Align2, Area, Context, Frame, Id, Order, ProgressBar};
use ghand_motion::pose_sequence::DEFAULT_FPS;
use ghand_pictures::{Background, Destination, LONGEST_TURN_SECONDS, Series, Shot};
use ghand_render::Gpu;
use ghand_render::splat::band_rows;

use crate::viewer::dialogs::output_dialog::{OutputDialog, OutputKind};
use crate::viewer::document::Document;
use crate::viewer::document::file_reader::file_name;
use crate::viewer::hand::Hand;
use crate::viewer::rendering::drawing::GaussianColors;
use crate::viewer::rendering::drawn_subject::DrawnSubject;
use crate::viewer::rendering::frame::PictureInputs;
use crate::viewer::stage::{self, Stage};

/// What is to be made.
pub struct OutputPlan {
    /// What the pictures show.
    pub subject: DrawnSubject,
    /// Everything else, for each picture; all of one size.
    pub pictures: Vec<PictureInputs>,
    /// The colours of its Gaussians.
    pub colors: GaussianColors,
    /// What is behind it.
    pub background: Background,
    /// Pictures per second of a film.
    pub fps: f64,
}

impl OutputPlan {
    /// The pictures that were asked for of what is on the stage.
    pub fn new(asked: &OutputDialog, document: &Document, stage: &Stage) -> OutputPlan {
        let behind = stage.canvas.shown().map_or([0.0; 3], |shown| shown.background);
        let background = if asked.transparent { Background::Transparent } else { Background::Color(behind) };
        let inputs = |camera| stage::inputs(&document.subject, camera, background.color());
        let size = asked.size;
        let camera = &stage.camera;
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
            OutputKind::Motion => match document.hand().and_then(Hand::motion) {
                None => Vec::new(),
                Some((sequence, [from, to])) => {
                    fps = sequence.fps;
                    let frames = (from * fps).round() as usize..=(to * fps).round() as usize;
                    let view = camera.camera(size);
                    let at = |k: usize| {
                        let frame = sequence.frames.get(k)?;
                        Some(PictureInputs { pose: Some(frame.pose.clone()), ..inputs(view.clone()) })
                    };
                    frames.filter_map(at).collect()
                }
            },
        };
        let colors = match (stage.canvas.colors(), asked.kind) {
            // The colours of numbers are those of this pose.
            (GaussianColors::Given(_), OutputKind::Motion) => GaussianColors::Own,
            (colors, _) => colors.clone(),
        };
        OutputPlan { subject: document.subject.drawn(), pictures, colors, background, fps }
    }
}

/// Pictures that are being made. Dropping it stops them after the next picture; a film is then not written.
pub struct OutputJob {
    path: PathBuf,
    count: usize,
    made: Arc<AtomicUsize>,
    stop: Arc<AtomicBool>,
    done: Receiver<anyhow::Result<String>>,
}

impl OutputJob {
    /// Begins to make a picture or a film, as the file's name says, on another device of the same adapter. The user interface is drawn again after each picture.
    ///
    /// # Errors
    /// One sentence if the file's name is not that of a picture or a film, or it cannot be written.
    pub fn start(gpu: &Gpu, plan: OutputPlan, path: &Path, context: &Context) -> anyhow::Result<OutputJob> {
        let destination = Destination::new(path, None, "film")?;
        let made = Arc::new(AtomicUsize::new(0));
        let stop = Arc::new(AtomicBool::new(false));
        let (sender, done) = channel();
        let job =
            OutputJob { path: path.into(), count: plan.pictures.len(), made: made.clone(), stop: stop.clone(), done };
        let gpu = gpu.clone();
        let context = context.clone();
        std::thread::spawn(move || {
            // A device of its own: the window's cannot be resized while another thread keeps it busy.
            let result = gpu.reopen().map_err(anyhow::Error::from).and_then(|gpu| {
                make(&gpu, &plan, &destination, &stop, || {
                    made.fetch_add(1, Ordering::Relaxed);
                    context.request_repaint();
                })
            });
            // A closed channel means that the viewer no longer waits.
            let _ = sender.send(result);
            context.request_repaint();
        });
        Ok(job)
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// How many pictures are made, and how many there will be.
    fn progress(&self) -> (usize, usize) {
        (self.made.load(Ordering::Relaxed), self.count)
    }

    /// Shows how many pictures are made. Returns whether the user stops it.
    pub fn show_progress(&self, context: &Context) -> bool {
        let (made, count) = self.progress();
        let name = file_name(&self.path);
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
        stopped
    }

    /// What was written, once it is, as a sentence.
    ///
    /// # Errors
    /// Why it could not be made.
    pub fn poll(&self) -> Option<anyhow::Result<String>> {
        match self.done.try_recv() {
            Ok(result) => Some(result),
            Err(TryRecvError::Empty) => None,
            Err(TryRecvError::Disconnected) => Some(Err(anyhow::anyhow!("the pictures could not be made"))),
        }
    }
}

impl Drop for OutputJob {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
    }
}

fn make(
    gpu: &Gpu,
    plan: &OutputPlan,
    destination: &Destination,
    stop: &AtomicBool,
    mut made_one: impl FnMut(),
) -> anyhow::Result<String> {
    let first = plan.pictures.first().context("there is nothing to show")?;
    let size = [first.camera.width, first.camera.height];
    let shots: Vec<Shot> = (0..plan.pictures.len()).map(|k| Shot { frame: Some(k), ..Shot::default() }).collect();
    let mut series = Series::new(destination, &shots, size, plan.background, plan.fps)?;
    let mut drawing = plan.subject.on_device(gpu, [size[0], band_rows(gpu, size)])?;
    while let Some(inputs) = series.next().and_then(|number| plan.pictures.get(number)) {
        if stop.load(Ordering::Relaxed) {
            anyhow::bail!("stopped; nothing was written");
        }
        let mut picture = series.blank();
        drawing.fill(gpu, inputs, &plan.colors, &mut picture)?;
        series.add(picture.in_linear_light())?;
        made_one();
    }
    Ok(series.finish()?)
}

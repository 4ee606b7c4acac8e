//! Pictures and films of what the viewer shows, made in the background.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, TryRecvError, channel};

use anyhow::Context as _;
use egui::Context;
use ghand_pictures::{Background, Destination, Series, Shot};
use ghand_render::Gpu;
use ghand_render::splat::band_rows;

use crate::format_args::FormatArgs;
use crate::viewer::rendering::drawing::GaussianColors;
use crate::viewer::rendering::drawn_subject::DrawnSubject;
use crate::viewer::rendering::frame::PictureInputs;

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
        let destination = FormatArgs::default().destination(path, "film")?;
        let (made, stop) = (Arc::new(AtomicUsize::new(0)), Arc::new(AtomicBool::new(false)));
        let (sender, done) = channel();
        let job =
            OutputJob { path: path.into(), count: plan.pictures.len(), made: made.clone(), stop: stop.clone(), done };
        let (gpu, context) = (gpu.clone(), context.clone());
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
    pub fn progress(&self) -> (usize, usize) {
        (self.made.load(Ordering::Relaxed), self.count)
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

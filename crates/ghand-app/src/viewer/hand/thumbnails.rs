//! Small pictures of the named poses, made once in the background.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, TryRecvError, channel};
use std::time::Duration;

use egui::{ColorImage, Context, TextureHandle, TextureOptions};
use ghand_avatar::framing::posed_vertices;
use ghand_core::{HandModel, Pose};
use ghand_pictures::{Background, Picture};
use ghand_render::{Gpu, RenderError};

use crate::viewer::rendering::drawing::GaussianColors;
use crate::viewer::rendering::drawn_subject::DrawnSubject;
use crate::viewer::rendering::frame::PictureInputs;
use ghand_avatar::orbit_camera::OrbitCamera;

/// Edge of a picture, pixels: twice its points, for displays of high resolution.
const EDGE: u32 = 112;
/// Interval of looks whether the view rests.
const LOOK: Duration = Duration::from_millis(50);
/// Longest time to wait for one picture: a software rasteriser needs about a tenth of a second.
const LONGEST_WAIT: Duration = Duration::from_secs(60);

/// The pictures, as far as they are made.
#[derive(Default)]
pub struct Thumbnails {
    textures: Vec<Option<TextureHandle>>,
    job: Option<Job>,
}

struct Job {
    made: Receiver<(usize, ColorImage)>,
    /// Whether the device is needed for the view.
    is_paused: Arc<AtomicBool>,
    stop: Arc<AtomicBool>,
}

impl Drop for Job {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
    }
}

impl Thumbnails {
    /// The picture of a pose, once it is made.
    pub fn get(&self, pose: usize) -> Option<&TextureHandle> {
        self.textures.get(pose)?.as_ref()
    }

    /// Whether they have been begun.
    pub fn is_begun(&self) -> bool {
        !self.textures.is_empty()
    }

    /// Begins to make the pictures of a hand in poses, on another device of the same adapter. Each new one is shown at once.
    pub fn begin(&mut self, gpu: &Gpu, subject: DrawnSubject, model: &HandModel, poses: Vec<Pose>, context: &Context) {
        self.textures = vec![None; poses.len()];
        let (sender, made) = channel();
        let is_paused = Arc::new(AtomicBool::new(false));
        let stop = Arc::new(AtomicBool::new(false));
        self.job = Some(Job { made, is_paused: is_paused.clone(), stop: stop.clone() });
        let gpu = gpu.clone();
        let model = model.clone();
        let context = context.clone();
        std::thread::spawn(move || {
            // A device of its own: the window's cannot be resized while another thread keeps it busy. One that is lost or full
            // makes no pictures; the buttons have their names.
            let Ok(gpu) = gpu.reopen() else { return };
            let Ok(mut drawing) = subject.on_device(&gpu, [EDGE; 2]) else { return };
            for (number, pose) in poses.into_iter().enumerate() {
                while is_paused.load(Ordering::Relaxed) && !stop.load(Ordering::Relaxed) {
                    std::thread::sleep(LOOK);
                }
                let mut draw = || -> Result<ColorImage, RenderError> {
                    let inputs = inputs(&model, pose.clone());
                    let mut picture = Picture::bytes([EDGE; 2], Background::Transparent);
                    drawing.fill(&gpu, &inputs, &GaussianColors::Own, &mut picture)?;
                    let size = [EDGE as usize; 2];
                    Ok(ColorImage::from_rgba_unmultiplied(size, picture.to_rgba8().as_flattened()))
                };
                let Ok(image) = draw() else { return };
                if stop.load(Ordering::Relaxed) || sender.send((number, image)).is_err() {
                    return;
                }
                context.request_repaint();
            }
        });
    }

    /// Takes the pictures that were made since; while `is_busy`, no more are begun.
    pub fn advance(&mut self, is_busy: bool, context: &Context) {
        let Some(job) = &self.job else { return };
        job.is_paused.store(is_busy, Ordering::Relaxed);
        loop {
            match job.made.try_recv() {
                Ok((number, image)) => put(&mut self.textures, number, image, context),
                Err(TryRecvError::Empty) => return,
                Err(TryRecvError::Disconnected) => break,
            }
        }
        self.job = None;
    }

    /// Waits until all are made, if they are begun. Returns whether there was nothing to wait for.
    pub fn wait(&mut self, context: &Context) -> bool {
        let Some(job) = self.job.take() else { return self.is_begun() };
        job.is_paused.store(false, Ordering::Relaxed);
        loop {
            match job.made.recv_timeout(LONGEST_WAIT) {
                Ok((number, image)) => put(&mut self.textures, number, image, context),
                Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => return false,
            }
        }
    }
}

fn put(textures: &mut [Option<TextureHandle>], number: usize, image: ColorImage, context: &Context) {
    if let Some(texture) = textures.get_mut(number) {
        *texture = Some(context.load_texture(format!("pose {number}"), image, TextureOptions::LINEAR));
    }
}

/// A pose as it is seen at the start.
fn inputs(model: &HandModel, pose: Pose) -> PictureInputs {
    let camera = OrbitCamera::facing(model, &pose, &posed_vertices(model, &pose));
    PictureInputs {
        pose: Some(pose),
        shape: Vec::new(),
        light: None,
        camera: camera.camera([EDGE; 2]),
        background: Background::Transparent.color(),
    }
}

//! How masks are made for images without any, and where they are kept.

use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, OnceLock};

use super::aligned::posed;
use super::guide::Guide;
use super::learn::{frames_to_learn, key, learn};
use super::segment::Colors;
use super::{Facts, cache};
use crate::capture::Capture;
use crate::error::CaptureError;

/// How masks are made.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MaskMethod {
    /// The filled outline of the posed model without pixels too dark or too bright for skin, as HandAvatar does.
    Outline,
    /// By what hand and surroundings look like over all frames of a camera, near the posed model.
    Colors,
}

/// Masks made for images that have none.
#[derive(Debug, Clone)]
pub struct MadeMasks {
    /// How they are made.
    pub method: MaskMethod,
    /// The capture's folder, and where they are kept in its folder of masks.
    root: PathBuf,
    place: PathBuf,
    folder: Arc<OnceLock<PathBuf>>,
    learned: Arc<Mutex<HashMap<(usize, u64), Slot>>>,
}

/// The colours of a camera, once they are learned; `None` if that failed.
type Slot = Arc<OnceLock<Option<Arc<Colors>>>>;

impl PartialEq for MadeMasks {
    /// What was already learned does not count.
    fn eq(&self, other: &MadeMasks) -> bool {
        (self.method, &self.root, &self.place) == (other.method, &other.root, &other.place)
    }
}

impl MadeMasks {
    /// Masks made in a way, for the capture in a folder. They are kept in a folder `ghand-masks` in it, or in the user's
    /// cache if that cannot be written, in `place` there.
    pub fn new(method: MaskMethod, root: PathBuf, place: PathBuf) -> MadeMasks {
        MadeMasks { method, root, place, folder: Arc::default(), learned: Arc::default() }
    }

    /// Where they are kept. The folder is made.
    pub fn folder(&self) -> PathBuf {
        self.folder.get_or_init(|| cache::mask_folder(&self.root)).join(&self.place)
    }

    /// The colours of a camera, which are learned once. They are `None` if that failed, which [`Capture::load_view`] of
    /// the images tells.
    fn colors(&self, capture: &Capture, camera: usize, frames: &[usize], key: u64) -> Option<Arc<Colors>> {
        let slot = self.learned.lock().ok()?.entry((camera, key)).or_default().clone();
        let learn = || {
            let learned = learn(capture, camera, frames);
            learned.inspect_err(|error| log::warn!("masks cannot be made: {error}")).ok().map(Arc::new)
        };
        slot.get_or_init(|| apart(learn).flatten()).clone()
    }
}

/// Runs a function on threads of its own. One of rayon's that waited for others could begin another task meanwhile, which
/// may wait for this one.
fn apart<T: Send>(run: impl FnOnce() -> T + Send) -> Option<T> {
    let pool = rayon::ThreadPoolBuilder::new().build().ok()?;
    std::thread::scope(|scope| scope.spawn(|| pool.install(run)).join().ok())
}

/// The mask of an image by its colours, from the cache or made: 255 on the hand. `file` are the bytes of the image's file
/// and `rgba` its undistorted pixels, with alpha 0 outside what the camera sees.
pub(crate) fn mask_by_colors(
    capture: &Capture,
    made: &MadeMasks,
    camera: usize,
    frame: usize,
    file: &[u8],
    rgba: &[[u8; 4]],
) -> Result<Vec<u8>, CaptureError> {
    let frames = frames_to_learn(capture, camera);
    let key = key(capture, camera, &frames)?;
    let (model, vertices, poses) = posed(capture, frame)?;
    let place = cache::MaskFile::new(capture, camera, frame, file, None, key)?;
    if let Some(mask) = place.read().and_then(|stored| stored.mask()) {
        return Ok(mask);
    }
    let (view_camera, _) = capture.camera_and_frame(camera, frame)?;
    let guide = Guide::new(view_camera, model, &vertices, poses.reach());
    let colors = guide.as_ref().and_then(|_| made.colors(capture, camera, &frames, key));
    let mask: Vec<u8> = match guide.zip(colors) {
        Some((guide, colors)) => {
            let mask = colors.mask(rgba, view_camera.width as usize, &guide, poses);
            mask.into_iter().map(|inside| if inside { 255 } else { 0 }).collect()
        }
        None => vec![0; rgba.len()],
    };
    place.write(&Facts::of(rgba, &mask), Some(&mask));
    Ok(mask)
}

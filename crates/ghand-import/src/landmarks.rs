//! Where the hands are in all footage: as the tracker finds them, or as given. What was found is kept: tracking takes most
//! of an import's time.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;

use ghand_core::{Camera, Side};
use ghand_files::atomic_file::write_atomically;
use ghand_footage::Footage;
use ghand_motion::image_landmarks::{MEDIAPIPE_BESIDE, MEDIAPIPE_TIP_INSET, SeenPixels, read_image_landmarks};
use glam::{DVec2, DVec3};
use serde::{Deserialize, Serialize};

use crate::ImportError;
use crate::progress::{OnProgress, Progress, Step};
use crate::rig::LANDMARKS;
use crate::sources::Source;
use crate::track::{Hands, Tracking};

/// Changes when tracking does, so that what earlier versions kept is not used.
const VERSION: u32 = 2;
/// Frames between reports of progress.
const REPORT_EVERY: usize = 10;

/// Where a tracker's landmarks lie.
#[derive(Debug, Clone, Copy)]
pub struct LandmarkPlaces {
    /// How far those of fingertips lie before the ends of the fingers, metres.
    pub tip_inset: f64,
    /// Those of the palm that lie beside their joints, as in [`FitOptions`](ghand_motion::image_landmarks::FitOptions).
    pub beside: &'static [(usize, DVec3)],
}

impl LandmarkPlaces {
    /// Those of the tracker that comes with ghand.
    pub const TRACKER: LandmarkPlaces = LandmarkPlaces { tip_inset: MEDIAPIPE_TIP_INSET, beside: &MEDIAPIPE_BESIDE };
}

/// What is kept of a camera.
#[derive(Serialize, Deserialize)]
struct Kept {
    made_from: String,
    hands: Hands,
    missing: usize,
}

/// The hands of a camera's footage.
pub struct Tracked {
    /// All hands.
    pub hands: Hands,
    /// Frames that could not be decoded.
    pub missing: usize,
}

/// Landmarks of one hand from another tracker.
pub struct GivenLandmarks {
    /// Which hand.
    pub side: Side,
    /// Where the tracker's landmarks lie.
    pub places: LandmarkPlaces,
    /// By camera and frame; a hand with a missing landmark is `None`.
    pub pixels: Vec<Vec<Option<[DVec2; LANDMARKS]>>>,
    /// What tells them from others.
    identity: String,
}

impl GivenLandmarks {
    /// Reads the files: one for all cameras, or one for each. Their frames are those of the footage, in order.
    ///
    /// # Errors
    /// If a file is not of a known layout, is of other cameras, has no hand of this side, or more frames than the footage.
    pub fn read(
        paths: &[PathBuf],
        side: Side,
        sources: &[Source],
        cameras: &[Camera],
        remarks: &mut Vec<String>,
    ) -> Result<GivenLandmarks, ImportError> {
        let ids: Vec<String> = sources.iter().map(|source| source.id.clone()).collect();
        let found = read_image_landmarks(paths, &ids, side)?;
        remarks.extend(found.remarks.iter().cloned());
        let whole = |pixels: SeenPixels| -> Option<[DVec2; LANDMARKS]> {
            pixels.into_iter().collect::<Option<Vec<DVec2>>>()?.try_into().ok()
        };
        let seen = found.by_camera(cameras)?;
        let mut pixels = vec![];
        for (source, views) in sources.iter().zip(seen) {
            let frames = source.footage.times().len();
            if views.len() > frames {
                return Err(ImportError::Unusable(format!(
                    "--landmarks: have {} frames, but {} has {frames}; give those of this footage",
                    views.len(),
                    source.footage.path().display()
                )));
            }
            let some = views.iter().filter(|view| view.iter().any(Option::is_some)).count();
            let mut whole: Vec<_> = views.into_iter().map(whole).collect();
            whole.resize(frames, None);
            let kept = whole.iter().flatten().count();
            if kept < some {
                remarks.push(format!(
                    "{}: {} of {some} given hands lack a landmark, and are not used",
                    source.id,
                    some - kept
                ));
            }
            pixels.push(whole);
        }
        let identity = paths.iter().map(|path| identity(path)).collect::<Vec<_>>().join("; ");
        let identity = format!("landmarks of a {side:?} hand in {identity}");
        let places = LandmarkPlaces { tip_inset: found.tip_inset, beside: found.beside };
        Ok(GivenLandmarks { side, places, pixels, identity })
    }
}

/// The hands of all cameras, tracked unless their landmarks are given; or what was kept in `folder` if the footage is the
/// same.
///
/// # Errors
/// If footage cannot be decoded, what is found not be kept, or the caller stops it.
pub fn track_all(
    sources: &[Source],
    given: Option<&GivenLandmarks>,
    folder: &Path,
    on_progress: &mut OnProgress,
) -> Result<Vec<Tracked>, ImportError> {
    let mut all = vec![];
    for (k, source) in sources.iter().enumerate() {
        let file = folder.join(format!("tracked-{}.json", source.id));
        let made_from = match given {
            Some(given) => format!("version {VERSION}: {}; {}", identity(source.footage.path()), given.identity),
            None => format!("version {VERSION}: {}", identity(source.footage.path())),
        };
        let kept = fs::read(&file).ok().and_then(|bytes| serde_json::from_slice::<Kept>(&bytes).ok());
        let kept = match kept.filter(|kept| kept.made_from == made_from) {
            Some(kept) => kept,
            None => {
                let pixels = given.map(|given| (given.side, &given.pixels[k][..]));
                let (hands, missing) = track(source, pixels, on_progress)?;
                let kept = Kept { made_from, hands, missing };
                let bytes = serde_json::to_vec(&kept).map_err(|error| ImportError::write(&file)(error.into()))?;
                write_atomically(&file, &bytes).map_err(ImportError::write(&file))?;
                kept
            }
        };
        all.push(Tracked { hands: kept.hands, missing: kept.missing });
    }
    Ok(all)
}

fn track(
    source: &Source,
    given: Option<(Side, &[Option<[DVec2; LANDMARKS]>])>,
    on_progress: &mut OnProgress,
) -> Result<(Hands, usize), ImportError> {
    let footage: &Footage = &source.footage;
    let (width, height) = footage.size();
    let total = footage.times().len();
    let mut tracking = Tracking::new();
    let mut frames = footage.frames()?;
    let mut rgb = vec![];
    let mut next = 0;
    while let Some(number) = frames.next_into(&mut rgb)? {
        // Frames that could not be decoded have no hand.
        (next..number).for_each(|_| tracking.skip());
        match given {
            Some((side, pixels)) => {
                tracking.add_given(&rgb, width, height, pixels.get(number).and_then(Option::as_ref), side)?;
            }
            None => tracking.add(&rgb, width, height)?,
        }
        next = number + 1;
        if next % REPORT_EVERY == 0 || next == total {
            let progress = Progress { step: Step::Tracking, subject: source.id.clone(), done: next, total };
            if !on_progress(&progress) {
                return Err(ImportError::Stopped);
            }
        }
    }
    (next..total).for_each(|_| tracking.skip());
    Ok((tracking.finish(), frames.missing()))
}

/// What tells one footage from another: path, and for each file its size and time of change.
fn identity(path: &Path) -> String {
    let mut files: Vec<PathBuf> = match fs::read_dir(path) {
        Ok(entries) => entries.filter_map(|entry| Some(entry.ok()?.path())).collect(),
        Err(_) => vec![path.into()],
    };
    files.sort();
    let of_file = |file: &PathBuf| {
        let metadata = fs::metadata(file).ok();
        let size = metadata.as_ref().map_or(0, fs::Metadata::len);
        let changed =
            metadata.and_then(|m| m.modified().ok()?.duration_since(UNIX_EPOCH).ok()).map_or(0, |t| t.as_nanos());
        format!("{} {size} {changed}", file.display())
    };
    let list: Vec<String> = files.iter().map(of_file).collect();
    list.join("; ")
}

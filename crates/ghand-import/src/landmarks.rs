//! Tracks the hands of all footage, and keeps what was found: tracking takes most of an import's time.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;

use ghand_files::atomic_file::write_atomically;
use ghand_footage::Footage;
use serde::{Deserialize, Serialize};

use crate::ImportError;
use crate::progress::{OnProgress, Progress, Step};
use crate::sources::Source;
use crate::track::{Hands, Tracking};

/// Changes when tracking does, so that what earlier versions kept is not used.
const VERSION: u32 = 1;
/// Frames between reports of progress.
const REPORT_EVERY: usize = 10;

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

/// Tracks the hands of all cameras, or reads what was kept in `folder` if the footage is the same.
///
/// # Errors
/// If footage cannot be decoded, what is found not be kept, or the caller stops it.
pub fn track_all(sources: &[Source], folder: &Path, on_progress: &mut OnProgress) -> Result<Vec<Tracked>, ImportError> {
    let mut all = vec![];
    for source in sources {
        let file = folder.join(format!("tracked-{}.json", source.id));
        let made_from = identity(source.footage.path());
        let kept = fs::read(&file).ok().and_then(|bytes| serde_json::from_slice::<Kept>(&bytes).ok());
        let kept = match kept.filter(|kept| kept.made_from == made_from) {
            Some(kept) => kept,
            None => {
                let (hands, missing) = track(source, on_progress)?;
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

fn track(source: &Source, on_progress: &mut OnProgress) -> Result<(Hands, usize), ImportError> {
    let footage: &Footage = &source.footage;
    let (width, height) = footage.size();
    let total = footage.times().len();
    let mut tracking = Tracking::new()?;
    let mut frames = footage.frames()?;
    let mut rgb = vec![];
    let mut next = 0;
    while let Some(number) = frames.next_into(&mut rgb)? {
        // Frames that could not be decoded have no hand.
        (next..number).for_each(|_| tracking.skip());
        tracking.add(&rgb, width, height)?;
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
    format!("version {VERSION}: {}", list.join("; "))
}

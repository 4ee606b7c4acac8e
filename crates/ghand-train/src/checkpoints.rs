//! The checkpoints of a run: when one is due, which are kept, and which to go on from.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use ghand_files::atomic_file::remove_unfinished;

use crate::checkpoint::{Checkpoint, CheckpointError};

/// The folder of a run's checkpoints.
#[derive(Debug)]
pub struct Checkpoints {
    folder: PathBuf,
    every: Duration,
    keep_every: u64,
    saved: Instant,
    failing: bool,
}

/// Checkpoints that are always kept: should the last one be damaged, there is the one before.
const KEPT: usize = 2;
const EXTENSION: &str = "checkpoint";

impl Checkpoints {
    /// Checkpoints in a folder, which is made when the first is saved; one is due `every` so often. Beside the last two,
    /// the first at or after every `keep_every` iterations is kept; none with 0.
    pub fn new(folder: &Path, every: Duration, keep_every: u64) -> Checkpoints {
        Checkpoints { folder: folder.into(), every, keep_every, saved: Instant::now(), failing: false }
    }

    /// Whether one is due.
    pub fn due(&self) -> bool {
        self.saved.elapsed() >= self.every
    }

    /// Saves a checkpoint. A failure, such as a full disk, does not stop training: it is reported once, and the next
    /// one is tried when it is due. Returns whether it was saved.
    pub fn save(&mut self, checkpoint: &Checkpoint) -> bool {
        self.saved = Instant::now();
        let path = self.folder.join(format!("{:010}.{EXTENSION}", checkpoint.stage.iterations_done));
        match checkpoint.save(&path) {
            Ok(()) => {
                if self.failing {
                    log::info!("checkpoints are saved again");
                }
                self.failing = false;
                self.remove_old();
                true
            }
            Err(error) => {
                if !self.failing {
                    log::warn!("{error}; training goes on, and saves one when it can");
                }
                self.failing = true;
                false
            }
        }
    }

    fn remove_old(&self) {
        let files = files(&self.folder);
        let old = files.len().saturating_sub(KEPT);
        let period = |iteration: u64| iteration.checked_div(self.keep_every);
        let mut before = Some(0);
        for (iteration, path) in &files[..old] {
            if period(*iteration) <= before {
                // What cannot be removed does no harm.
                let _ = std::fs::remove_file(path);
            }
            before = period(*iteration);
        }
    }

    /// The newest checkpoint of a folder that is whole; `None` without any. Each damaged one is reported.
    ///
    /// What a killed program was writing there is removed.
    ///
    /// # Errors
    /// [`CheckpointError`] of the newest one if none of them can be used.
    pub fn latest(folder: &Path) -> Result<Option<Checkpoint>, CheckpointError> {
        remove_unfinished(folder);
        let mut first_error = None;
        for (_, path) in files(folder).iter().rev() {
            match Checkpoint::load(path) {
                Ok(checkpoint) => {
                    if let Some(error) = first_error {
                        log::warn!("{error}; going on from the one before, {}", path.display());
                    }
                    return Ok(Some(checkpoint));
                }
                Err(error) => {
                    first_error.get_or_insert(error);
                }
            }
        }
        first_error.map_or(Ok(None), Err)
    }
}

/// Whether a folder has checkpoints, whole or damaged.
pub fn has_checkpoints(folder: &Path) -> bool {
    !files(folder).is_empty()
}

/// Removes the checkpoints of a folder.
pub fn remove_checkpoints(folder: &Path) {
    for (_, path) in files(folder) {
        // What cannot be removed does no harm.
        let _ = std::fs::remove_file(path);
    }
}

/// The checkpoints of a folder with their iterations, the oldest first.
fn files(folder: &Path) -> Vec<(u64, PathBuf)> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    let mut files: Vec<_> = entries
        .filter(|path| path.extension().is_some_and(|extension| extension == EXTENSION))
        .filter_map(|path| Some((path.file_stem()?.to_str()?.parse().ok()?, path)))
        .collect();
    files.sort();
    files
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::checkpoint::{Losses, Prepared, SkippedSteps, StageState};
    use crate::settings::TrainSettings;

    fn at(iteration: u64) -> Checkpoint {
        Checkpoint {
            program: env!("CARGO_PKG_VERSION").into(),
            settings: TrainSettings::default(),
            training_set: 0,
            prepared: Prepared::default(),
            stage: StageState {
                number: 2,
                iteration,
                iterations_done: iteration,
                began: 0.0,
                loss_at_start: 1.0,
                losses: Losses::default(),
                skipped: SkippedSteps::default(),
                numbers: vec![],
            },
            seconds: 0.0,
            curve: vec![],
        }
    }

    fn kept(folder: &Path) -> Vec<u64> {
        files(folder).into_iter().map(|(iteration, _)| iteration).collect()
    }

    #[test]
    fn the_last_two_are_kept_and_the_first_of_every_so_many_iterations() {
        for (keep_every, expected) in [(0, vec![350, 400]), (100, vec![110, 230, 310, 350, 400])] {
            let place = tempfile::tempdir().unwrap();
            let mut checkpoints = Checkpoints::new(place.path(), Duration::ZERO, keep_every);
            for iteration in [0, 40, 110, 150, 230, 310, 350, 400] {
                assert!(checkpoints.due() && checkpoints.save(&at(iteration)));
            }
            assert_eq!(kept(place.path()), expected);
        }
    }

    #[test]
    fn a_damaged_checkpoint_gives_way_to_the_one_before() {
        let place = tempfile::tempdir().unwrap();
        assert!(Checkpoints::latest(&place.path().join("missing")).unwrap().is_none());
        let mut checkpoints = Checkpoints::new(place.path(), Duration::ZERO, 0);
        checkpoints.save(&at(5));
        checkpoints.save(&at(9));
        std::fs::write(place.path().join(".writing-abc"), "half").unwrap();
        assert_eq!(Checkpoints::latest(place.path()).unwrap().unwrap().stage.iteration, 9);
        assert!(!place.path().join(".writing-abc").exists());
        let newest = place.path().join("0000000009.checkpoint");
        let bytes = std::fs::read(&newest).unwrap();
        std::fs::write(&newest, &bytes[..bytes.len() / 2]).unwrap();
        assert_eq!(Checkpoints::latest(place.path()).unwrap().unwrap().stage.iteration, 5);
        std::fs::write(place.path().join("0000000005.checkpoint"), "").unwrap();
        let error = Checkpoints::latest(place.path()).unwrap_err().to_string();
        assert!(error.contains("0000000009.checkpoint"), "{error}");
    }
}

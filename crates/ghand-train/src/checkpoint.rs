//! A checkpoint: all that a run needs to continue as if it had not been interrupted.
//!
//! The file is [`MAGIC`], the format's version and a CRC-32 of the rest (little-endian u32 each), then CBOR.

use std::path::{Path, PathBuf};

use ghand_capture::ColorCorrection;
use ghand_core::Pose;
use ghand_files::atomic_file::write_atomically;
use ghand_files::input_file;
use serde::{Deserialize, Serialize};

use crate::settings::TrainSettings;
use crate::trainer::simplification::Simplification;
use ghand_fit::alignment::Alignment;
use ghand_fit::exposure::ExposureFit;
use ghand_fit::light_fit::LightFit;
use ghand_measure::protocol::PosedView;

/// The first bytes of a checkpoint.
pub const MAGIC: [u8; 8] = *b"ghandckp";
/// Version of the format that this program writes and reads.
const VERSION: u32 = 6;
/// Bytes before the CBOR.
const HEADER: usize = MAGIC.len() + 8;
/// Maximum file size, bytes.
const LARGEST_FILE: u64 = 1 << 33;

/// A run at one of its steps.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Checkpoint {
    /// Version of ghand; others may compute other bits.
    pub program: String,
    /// The settings of the run.
    pub settings: TrainSettings,
    /// Says which images in which poses are trained on.
    pub training_set: u32,
    /// What was found before this stage.
    pub prepared: Prepared,
    /// The stage, in the middle.
    pub stage: StageState,
    /// Wall-clock time of the run so far, seconds.
    pub seconds: f64,
    /// The curve so far.
    pub curve: Vec<CurvePoint>,
}

/// How far a run was at a time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CurvePoint {
    /// Iterations done, of both stages.
    pub iteration: u64,
    /// The stage.
    pub stage: u32,
    /// Wall-clock time of the run, seconds.
    pub seconds: f64,
    /// L1 over the crops, as a mean over the images since the last point that has one.
    pub l1: Option<f64>,
    /// PSNR of some images that training does not see, dB, as a mean.
    pub held_out_psnr: Option<f64>,
}

/// What a run finds before its stages, and between them.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct Prepared {
    /// Poses of the split's frames.
    pub poses: Vec<Pose>,
    /// The alignment, with `align=contours`. Its template has no pose blend shapes here: they are the capture's.
    pub alignment: Option<Alignment>,
    /// The images of the watched split in poses that were fitted to their masks.
    pub held_out: Option<Vec<PosedView>>,
    /// How the light was found.
    pub light: Option<LightFit>,
    /// The cameras' exposures. The maps are in `correction`.
    pub exposure: Option<ExposureFit>,
    /// How the images are corrected.
    pub correction: ColorCorrection,
    /// Steps of the first stage without a finite gradient.
    pub skipped_steps: u64,
    /// How simple the avatar may be, with `simplify=auto`.
    pub simplification: Option<Simplification>,
}

impl Prepared {
    /// As it is saved.
    pub(crate) fn without_blend_shapes(&self) -> Prepared {
        let mut prepared = self.clone();
        if let Some(alignment) = &mut prepared.alignment {
            alignment.templates_mut().for_each(|template| template.pose_directions.clear());
        }
        prepared
    }
}

/// What a stage has learned after some of its iterations. The order of the views follows from the seed and the number of
/// iterations.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct StageState {
    /// 1 or 2.
    pub number: u32,
    /// Iterations of this stage.
    pub iteration: u64,
    /// Iterations of both stages.
    pub iterations_done: u64,
    /// Wall-clock time of the run when the stage began, seconds.
    pub began: f64,
    /// The loss over some views before the first iteration.
    pub loss_at_start: f64,
    /// L1 over the crops.
    pub losses: Losses,
    /// Steps that changed nothing.
    pub skipped: SkippedSteps,
    /// Learned numbers and their moments.
    pub numbers: Vec<SavedNumbers>,
}

/// The losses of images as they come, and their mean over a number of them.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Losses {
    /// Over the last whole window.
    pub mean: Option<f64>,
    sum: f64,
    count: u64,
}

impl Losses {
    /// Adds one to the present window. Those that are not finite are skipped.
    pub(crate) fn add(&mut self, loss: f64) {
        if loss.is_finite() {
            self.sum += loss;
            self.count += 1;
        }
    }

    /// Ends the present window; its mean, if there was a loss in it.
    pub(crate) fn end_window(&mut self) -> Option<f64> {
        let mean = (self.count > 0).then(|| self.sum / self.count as f64);
        *self = Losses { mean: mean.or(self.mean), ..Losses::default() };
        mean
    }
}

/// Counts the steps that changed nothing, since a gradient was not finite.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SkippedSteps {
    /// All of them.
    pub total: u64,
    /// The last ones.
    pub in_a_row: u64,
}

impl SkippedSteps {
    /// This many in a row are not chance.
    const MOST_IN_A_ROW: u64 = 10;

    /// Counts a step; whether there are too many in a row to go on.
    pub(crate) fn count(&mut self, skipped: bool) -> bool {
        self.in_a_row = if skipped { self.in_a_row + 1 } else { 0 };
        self.total += u64::from(skipped);
        self.in_a_row >= Self::MOST_IN_A_ROW
    }
}

/// Numbers by name.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SavedNumbers {
    /// Their name.
    pub name: String,
    /// The numbers, `f32`, little-endian.
    #[serde(with = "serde_bytes")]
    pub values: Vec<u8>,
}

/// Why a checkpoint could not be read or written.
#[derive(Debug, thiserror::Error)]
pub enum CheckpointError {
    /// Reading or writing failed.
    #[error("{path}: cannot {action} the checkpoint: {source}")]
    Io {
        /// The file.
        path: PathBuf,
        /// "read" or "write".
        action: &'static str,
        /// The cause.
        source: std::io::Error,
    },
    /// The contents are unusable.
    #[error("{path}: {problem}")]
    Invalid {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        problem: String,
    },
    /// The run differs from that of the checkpoint.
    #[error("cannot go on from the checkpoint: {problem}")]
    Mismatch {
        /// What differs, and what to do.
        problem: String,
    },
}

impl Checkpoint {
    /// Writes the checkpoint to a file, atomically.
    ///
    /// # Errors
    /// [`CheckpointError::Io`]; an existing file is then unchanged.
    pub fn save(&self, path: &Path) -> Result<(), CheckpointError> {
        let io = |source| CheckpointError::Io { path: path.into(), action: "write", source };
        let mut file = vec![0; HEADER];
        ciborium::into_writer(self, &mut file).map_err(|e| io(std::io::Error::other(e.to_string())))?;
        let checksum = crc32fast::hash(&file[HEADER..]);
        file[..MAGIC.len()].copy_from_slice(&MAGIC);
        file[MAGIC.len()..MAGIC.len() + 4].copy_from_slice(&VERSION.to_le_bytes());
        file[MAGIC.len() + 4..HEADER].copy_from_slice(&checksum.to_le_bytes());
        write_atomically(path, &file).map_err(io)
    }

    /// Reads a checkpoint.
    ///
    /// # Errors
    /// [`CheckpointError`] if the file cannot be read, is damaged, or comes from another version of the program.
    pub fn load(path: &Path) -> Result<Checkpoint, CheckpointError> {
        let io = |source| CheckpointError::Io { path: path.into(), action: "read", source };
        let invalid = |problem: String| CheckpointError::Invalid { path: path.into(), problem };
        let bytes = input_file::read(path, LARGEST_FILE).map_err(io)?;
        let bytes = bytes.ok_or_else(|| invalid("is too large for a checkpoint".into()))?;
        let Some((header, body)) = bytes.split_at_checked(HEADER).filter(|(header, _)| header.starts_with(&MAGIC))
        else {
            return Err(invalid("is not a checkpoint, or was cut off".into()));
        };
        let word = |at: usize| u32::from_le_bytes(std::array::from_fn(|k| header[at + k]));
        let [version, checksum] = [word(MAGIC.len()), word(MAGIC.len() + 4)];
        if version != VERSION {
            return Err(invalid(format!("has version {version}; this program reads version {VERSION}")));
        }
        if crc32fast::hash(body) != checksum {
            return Err(invalid("is damaged: its checksum is wrong".into()));
        }
        let checkpoint: Checkpoint =
            ciborium::from_reader(body).map_err(|e| invalid(format!("does not fit this program: {e}")))?;
        let program = env!("CARGO_PKG_VERSION");
        if checkpoint.program != program {
            let problem = format!("was written by ghand {}; this is {program}, which may differ", checkpoint.program);
            return Err(invalid(problem));
        }
        Ok(checkpoint)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ten_skipped_steps_in_a_row_are_too_many() {
        let mut skipped = SkippedSteps::default();
        for _ in 0..3 {
            assert!((0..9).all(|_| !skipped.count(true)));
            assert!(!skipped.count(false));
        }
        assert!((0..9).all(|_| !skipped.count(true)));
        assert!(skipped.count(true));
        assert_eq!(skipped.total, 37);
    }

    #[test]
    fn the_mean_loss_is_that_of_its_window() {
        let mut losses = Losses::default();
        assert_eq!(losses.end_window(), None);
        [1.0, f64::NAN, 3.0].into_iter().for_each(|loss| losses.add(loss));
        assert_eq!(losses.mean, None);
        assert_eq!(losses.end_window(), Some(2.0));
        losses.add(8.0);
        assert_eq!(losses.mean, Some(2.0));
        assert_eq!((losses.end_window(), losses.end_window(), losses.mean), (Some(8.0), None, Some(8.0)));
    }

    fn checkpoint() -> Checkpoint {
        let values = [1.5f32, f32::MIN_POSITIVE, -0.0].map(f32::to_le_bytes).concat();
        Checkpoint {
            program: env!("CARGO_PKG_VERSION").into(),
            settings: TrainSettings::default(),
            training_set: 7,
            prepared: Prepared::default(),
            stage: StageState {
                number: 2,
                iteration: 3,
                iterations_done: 5,
                began: 0.1,
                loss_at_start: 0.3,
                losses: Losses::default(),
                skipped: SkippedSteps::default(),
                numbers: vec![SavedNumbers { name: "a".into(), values }],
            },
            seconds: 0.7,
            curve: vec![],
        }
    }

    #[test]
    fn a_checkpoint_keeps_every_bit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        checkpoint().save(&path).unwrap();
        let read = Checkpoint::load(&path).unwrap();
        assert_eq!(read.stage.numbers, checkpoint().stage.numbers);
        assert_eq!(read.settings, checkpoint().settings);
        read.save(&folder.path().join("b")).unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), std::fs::read(folder.path().join("b")).unwrap());
    }

    #[test]
    fn damaged_checkpoints_are_rejected() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        checkpoint().save(&path).unwrap();
        let whole = std::fs::read(&path).unwrap();
        for length in (0..whole.len()).step_by(7) {
            std::fs::write(&path, &whole[..length]).unwrap();
            let message = Checkpoint::load(&path).unwrap_err().to_string();
            assert!(message.contains("cut off") || message.contains("damaged"), "{message}");
        }
        for at in 0..whole.len() {
            let mut bytes = whole.clone();
            bytes[at] ^= 0x10;
            std::fs::write(&path, &bytes).unwrap();
            let message = Checkpoint::load(&path).unwrap_err().to_string();
            assert!(!message.contains('\n'), "{message}");
        }
        // A right checksum over anything else.
        let mut other = whole[..HEADER].to_vec();
        other.extend([0x9f; 200]);
        let checksum = crc32fast::hash(&other[HEADER..]);
        other[12..HEADER].copy_from_slice(&checksum.to_le_bytes());
        std::fs::write(&path, &other).unwrap();
        assert!(Checkpoint::load(&path).unwrap_err().to_string().contains("does not fit"));
    }
}

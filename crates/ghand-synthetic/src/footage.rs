//! Footage with known truth: videos of several cameras, or of one that turns around the hand, as people film.
//!
//! An arm in a sleeve leans on a desk in a room; the hand moves through shapes, turns and comes nearer. Each camera has
//! its own lens, exposure, white balance, noise and clock. A frame is the mean of some moments of its exposure; videos
//! are compressed. Beside them lie the true cameras (`cameras.json`), the true motion and landmarks (`truth.json`), and
//! some true masks (`truth-masks/`). A calibration board may be shown before the hand. The same options give the same frames and truth, up to the renderer's rounding.

mod board;
mod camera_path;
mod clock;
mod exposure;
mod lens;
mod motion;
mod record;
mod room;
mod sensor;
mod sleeve;
mod subject;
#[cfg(test)]
mod tests;
mod truth;

pub(crate) use record::record;

use std::path::Path;

use ghand_board::BoardKind;
use ghand_capture::CaptureError;
use ghand_core::Side;

use crate::new_folder::check_is_new;

/// Masks of every so many frames of each video are written.
pub const MASK_EVERY: usize = 10;
/// More are probably a mistake.
const MOST_CAMERAS: usize = 32;
const LONGEST: f64 = 600.0;
/// Frames per second of most cameras, and of some with mixed rates.
const RATE: f64 = 30.0;
const OTHER_RATE: f64 = 25.0;
/// Largest difference of a clock's rate, and largest part of frames lost.
const LARGEST_DRIFT: f64 = 0.01;
const MOST_LOST: f64 = 0.3;

/// Options of made footage.
#[derive(Debug, Clone, PartialEq)]
pub struct FootageOptions {
    /// Seed of the hand, its skin and its sleeve.
    pub identity: u64,
    /// Seed of everything else.
    pub seed: u64,
    /// Which hand it shows.
    pub side: Side,
    /// Number of cameras that stand around the hand; one if it moves.
    pub views: usize,
    /// Duration of the videos.
    pub seconds: f64,
    /// Columns of the videos, even.
    pub width: u32,
    /// Rows of the videos, even.
    pub height: u32,
    /// One camera turns around a hand that holds nearly still, instead of cameras that stand.
    pub is_moving: bool,
    /// The second of every three cameras films 25 instead of 30 frames per second.
    pub mixed_rates: bool,
    /// Standard deviation of the part by which clocks other than the first are slow.
    pub clock_drift: f64,
    /// The part of the frames that cameras lose.
    pub lost_frames: f64,
    /// A calibration board that cameras that stand see first.
    pub board: Option<FilmedBoard>,
}

/// A calibration board that is moved about where the hand will be.
#[derive(Debug, Clone, PartialEq)]
pub struct FilmedBoard {
    /// Which board.
    pub kind: BoardKind,
    /// How long it is shown, from the first camera's start; then the hand is there.
    pub seconds: f64,
}

impl Default for FootageOptions {
    fn default() -> Self {
        FootageOptions {
            identity: 7,
            seed: 7,
            side: Side::Right,
            views: 4,
            seconds: 8.0,
            width: 640,
            height: 480,
            is_moving: false,
            mixed_rates: false,
            clock_drift: 0.0,
            lost_frames: 0.0,
            board: None,
        }
    }
}

impl FootageOptions {
    /// Fails if they are unusable, or the folder is not new.
    ///
    /// # Errors
    /// [`CaptureError::Invalid`] names the field.
    fn check(&self, folder: &Path) -> Result<(), CaptureError> {
        let fail = |field: &str, problem: String| {
            Err(CaptureError::Invalid { path: folder.into(), field: field.into(), problem })
        };
        let most = if self.is_moving { 1 } else { MOST_CAMERAS };
        if !(1..=most).contains(&self.views) {
            return fail("views", format!("is {}; give 1 to {most}", self.views));
        }
        let sizes = [self.width, self.height];
        if sizes.iter().any(|edge| edge % 2 != 0 || !(64..=4096).contains(edge)) {
            let [width, height] = sizes;
            return fail("size", format!("is {width} x {height}; give even numbers from 64 to 4096"));
        }
        let ranges = [
            ("seconds", self.seconds, 0.1, LONGEST),
            ("clock drift", self.clock_drift, 0.0, LARGEST_DRIFT),
            ("lost frames", self.lost_frames, 0.0, MOST_LOST),
        ];
        if let Some((field, value, least, most)) =
            ranges.into_iter().find(|(_, value, least, most)| !(least..=most).contains(&value))
        {
            return fail(field, format!("is {value}; give {least} to {most}"));
        }
        if let Some(FilmedBoard { seconds, .. }) = self.board {
            if self.is_moving {
                return fail("board", "needs cameras that stand; omit it, or film with these".into());
            }
            if !(0.1..=self.seconds).contains(&seconds) {
                return fail("board", format!("is shown for {seconds} s; give 0.1 to {} s", self.seconds));
            }
        }
        check_is_new(folder)
    }
}

//! `ghand capture --footage`: videos with known truth instead of a capture.

use std::time::Instant;

use clap::Args;
use ghand_board::BoardKind;
use ghand_files::claim::Claim;
use ghand_synthetic::footage::{FilmedBoard, FootageOptions};
use ghand_synthetic::make_footage::make_footage;
use indicatif::{ProgressBar, ProgressStyle};

use super::MakeCaptureArgs;
use crate::cli::AdapterArgs;
use crate::say;
use crate::train_run::interruption::Interruption;

/// How long the calibration board is shown.
const BOARD_SECONDS: f64 = 5.0;
/// Options of captures that footage does not have.
const OF_CAPTURES: [&str; 14] = [
    "test_views",
    "train_frames",
    "test_frames",
    "bone_spread",
    "pose_noise",
    "pose_bias",
    "mask_noise",
    "exposure_noise",
    "twist",
    "abduction",
    "light",
    "background",
    "forearm",
    "masks",
];

/// Options of footage.
#[derive(Debug, Args)]
pub struct FootageArgs {
    /// Makes videos (.mp4, by ffmpeg) as people film them, with the true cameras, motion and landmarks, and true masks,
    /// instead of a capture
    #[arg(long, conflicts_with_all = OF_CAPTURES)]
    footage: bool,
    /// Duration of the videos [default: 8]
    #[arg(long, value_name = "S", requires = "footage")]
    seconds: Option<f64>,
    /// One phone that turns around a hand held nearly still, instead of cameras that stand
    #[arg(long, requires = "footage", conflicts_with = "views")]
    moving: bool,
    /// Show this calibration board in the first 5 seconds, such as charuco:8x6:25mm
    #[arg(long, value_name = "KIND", requires = "footage", conflicts_with = "moving")]
    board: Option<BoardKind>,
    /// The second of every three cameras films 25 instead of 30 frames per second
    #[arg(long, requires = "footage")]
    mixed_rates: bool,
    /// Standard deviation of the part by which clocks other than the first are slow [default: 0]
    #[arg(long, value_name = "PART", requires = "footage")]
    clock_drift: Option<f64>,
    /// The part of the frames that cameras lose [default: 0]
    #[arg(long, value_name = "PART", requires = "footage")]
    lost_frames: Option<f64>,
}

impl FootageArgs {
    /// Whether there should be footage instead of a capture.
    pub(super) fn is_wanted(&self) -> bool {
        self.footage
    }

    /// Makes the footage.
    ///
    /// # Errors
    /// An error that names the option or the file and its problem.
    pub(super) fn make(&self, args: &MakeCaptureArgs, adapter: &AdapterArgs) -> anyhow::Result<()> {
        let start = Instant::now();
        let defaults = FootageOptions::default();
        let [width, height] = args.size.unwrap_or([defaults.width, defaults.height]);
        let options = FootageOptions {
            identity: args.identity.unwrap_or(defaults.identity),
            seed: args.seed.unwrap_or(defaults.seed),
            side: args.side(),
            views: if self.moving { 1 } else { args.views.unwrap_or(defaults.views) },
            seconds: self.seconds.unwrap_or(defaults.seconds),
            width,
            height,
            is_moving: self.moving,
            mixed_rates: self.mixed_rates,
            clock_drift: self.clock_drift.unwrap_or(defaults.clock_drift),
            lost_frames: self.lost_frames.unwrap_or(defaults.lost_frames),
            board: self.board.map(|kind| FilmedBoard { kind, seconds: BOARD_SECONDS }),
        };
        let _claim = Claim::beside(&args.out)?;
        Interruption::listen("stopped: nothing was written")?;
        // Draws nothing if stderr is not a terminal.
        let bar = ProgressBar::new(0);
        let style = ProgressStyle::with_template("{bar:30} {pos}/{len} frames {elapsed} (left {eta})");
        bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
        let mut frames = 0;
        adapter.open()?.retry_on_device_loss("the footage", |gpu| -> anyhow::Result<()> {
            frames = make_footage(gpu, &options, &args.out, |done, all| {
                bar.set_length(all as u64);
                bar.set_position(done as u64);
            })?;
            Ok(())
        })?;
        bar.finish_and_clear();
        let FootageOptions { views, seconds, .. } = options;
        let videos = if views == 1 { "1 video".into() } else { format!("{views} videos") };
        let took = start.elapsed().as_secs_f64();
        let folder = args.out.display();
        say!("{folder}: {videos} of {width} x {height}, {seconds} s, {frames} frames in {took:.1} s");
        Ok(())
    }
}

//! Errors of training.

use ghand_capture::CaptureError;
use ghand_hand_model::HandModelError;
use ghand_render::{AdapterChoice, DeviceError, RenderError};

use crate::checkpoint::CheckpointError;
use crate::settings::SettingsError;
use ghand_core::InvalidHandModel;
use ghand_fit::alignment::AlignmentError;
use ghand_fit::texels::TexelError;

/// Why training failed.
#[derive(Debug, thiserror::Error)]
pub enum TrainError {
    /// The capture or one of its images is unusable.
    #[error(transparent)]
    Capture(#[from] CaptureError),
    /// The hand model is unusable.
    #[error(transparent)]
    HandModel(#[from] HandModelError),
    /// The device failed.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// The device was lost and could not be replaced.
    #[error(transparent)]
    Device(#[from] DeviceError),
    /// A setting is out of range.
    #[error(transparent)]
    Settings(#[from] SettingsError),
    /// Texels could not be found in the images.
    #[error(transparent)]
    Texels(#[from] TexelError),
    /// A pose does not fit the hand model.
    #[error(transparent)]
    Pose(#[from] InvalidHandModel),
    /// The poses could not be aligned.
    #[error(transparent)]
    Alignment(#[from] AlignmentError),
    /// The run cannot go on from a checkpoint.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
    /// The split has nothing to train on.
    #[error("{capture}: split `{split}` has no {what}; add some or choose another split with --split")]
    Empty {
        /// The capture.
        capture: String,
        /// The split.
        split: String,
        /// "cameras", "frames" or "images".
        what: &'static str,
    },
    /// The host has too little memory.
    #[error(
        "not enough memory for {gaussians} Gaussians, which need about {mebibytes} MiB; close other programs, or lower \
         uv_resolution={uv_resolution} for fewer Gaussians"
    )]
    NoMemory {
        /// Number of Gaussians.
        gaussians: usize,
        /// What they need, MiB.
        mebibytes: u64,
        /// The setting that determines the number of Gaussians.
        uv_resolution: u32,
    },
    /// The graphics device has too little memory.
    #[error(
        "the graphics device has too little memory for {what} ({why}); lower uv_resolution={uv_resolution} for fewer \
         Gaussians, close other programs that use the graphics adapter, or choose another adapter with {}",
        AdapterChoice::VARIABLE
    )]
    NoDeviceMemory {
        /// What was asked for.
        what: String,
        /// The reason, such as the exceeded limit.
        why: String,
        /// The setting that determines the number of Gaussians.
        uv_resolution: u32,
    },
    /// Numbers became infinite, or the loss rose: the result is unusable.
    #[error("training failed in stage {stage}, iteration {iteration} of {iterations}: {fault}; {remedy}")]
    Diverged {
        /// The stage.
        stage: u32,
        /// Iterations done, of both stages.
        iteration: u64,
        /// Total number of iterations.
        iterations: u64,
        /// What went wrong.
        fault: String,
        /// The likely reason and what to do.
        remedy: String,
    },
    /// A stop was requested before there was an avatar.
    #[error(
        "stopped after {iteration} of {iterations} iterations, before stage 2, which makes the avatar: there is no \
         avatar to save yet"
    )]
    Stopped {
        /// Iterations done.
        iteration: u64,
        /// Total number of iterations.
        iterations: u64,
    },
}

impl TrainError {
    /// Names the setting to lower, if the graphics device has too little memory.
    pub(crate) fn with_memory_setting(self, uv_resolution: u32) -> TrainError {
        match self {
            TrainError::Render(RenderError::OutOfMemory { what, why }) => {
                TrainError::NoDeviceMemory { what, why, uv_resolution }
            }
            other => other,
        }
    }
}

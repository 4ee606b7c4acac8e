//! Small captures with known truth, and how far poses are from it.
#![allow(dead_code, reason = "each test uses what it needs")]

use std::sync::OnceLock;

use ghand_capture::{Capture, Split};
use ghand_core::Pose;
use ghand_core::pose_error::{moving_joints, pose_error_degrees};
use ghand_fit::alignment::{Alignment, align};
use ghand_render::{AdapterChoice, Gpu};
use ghand_synthetic::SyntheticOptions;
use ghand_synthetic::make_capture::make_capture;

/// Options of a capture of 6 views and 8 frames, 128x192.
pub fn small_options(identity: u64) -> SyntheticOptions {
    SyntheticOptions {
        identity,
        views: 6,
        train_frames: 8,
        test_frames: 0,
        width: 128,
        height: 192,
        ..Default::default()
    }
}

pub fn make(options: &SyntheticOptions) -> (Capture, tempfile::TempDir) {
    let gpu = Gpu::new(&AdapterChoice::from_env()).unwrap_or_else(|e| panic!("{e}"));
    let folder = tempfile::tempdir().unwrap();
    make_capture(&gpu, options, &folder.path().join("capture")).unwrap();
    (Capture::open(&folder.path().join("capture")).unwrap(), folder)
}

/// A capture without errors of its masks, which tests share.
pub fn exact() -> &'static Capture {
    static EXACT: OnceLock<(Capture, tempfile::TempDir)> = OnceLock::new();
    &EXACT.get_or_init(|| make(&small_options(3))).0
}

/// Its alignment.
pub fn exact_alignment() -> &'static Alignment {
    static ALIGNMENT: OnceLock<Alignment> = OnceLock::new();
    ALIGNMENT.get_or_init(|| align(exact(), exact().split("train").unwrap(), None, &mut |_, _| true).unwrap())
}

/// The first cameras and frames of a split.
pub fn first(split: &Split, cameras: usize, frames: usize) -> Split {
    Split::product(split.cameras[..cameras].to_vec(), split.frames[..frames].to_vec())
}

/// Given and true poses of a split's frames.
pub fn poses(capture: &Capture, split: &Split) -> [Vec<Pose>; 2] {
    let truth = capture.truth.as_ref().unwrap();
    [
        split.frames.iter().map(|f| capture.frames[*f].pose.clone()).collect(),
        split.frames.iter().map(|f| truth[*f].clone().unwrap()).collect(),
    ]
}

/// Mean angle between the local rotations, degrees, and mean distance of the translations, millimetres.
pub fn errors(poses: &[Pose], truth: &[Pose]) -> [f64; 2] {
    let shifts = poses.iter().zip(truth).map(|(p, t)| p.translation.distance(t.translation));
    [pose_error_degrees(poses, truth, &moving_joints(truth)), 1e3 * shifts.sum::<f64>() / poses.len() as f64]
}

//! What a run of `train` learns from.

use std::path::PathBuf;
use std::sync::Arc;

use anyhow::Context;
use ghand_capture::{Capture, Split};
use ghand_measure::lpips::Lpips;
use ghand_render::Gpu;
use ghand_train::Trained;

use super::TrainArgs;
use super::plan::{DEFAULT_TEST_SPLIT, Plan};
use crate::capture_preflight::check_before_training;
use crate::train_run::demo_capture::demo_capture;
use crate::train_run::interruption::Interruption;
use crate::train_run::training_poses::StartPoses;

/// What a run learns from and is compared with.
pub(super) struct Inputs {
    /// Where the capture is.
    pub path: PathBuf,
    /// The capture with its own poses, in the shape that training starts from.
    pub capture: Capture,
    /// The capture in the poses that training starts from.
    pub start: Capture,
    /// Those poses, as on the command line.
    pub poses: StartPoses,
    /// The images that are trained on.
    pub train_split: Split,
    /// LPIPS with its weights.
    pub lpips: Arc<Lpips>,
}

impl Inputs {
    /// Opens and checks them. Makes the demo's capture if it is missing.
    pub fn open(args: &TrainArgs, plan: &Plan, gpu: &mut Gpu, interruption: &Interruption) -> anyhow::Result<Inputs> {
        let record = &plan.record;
        args.capture.check()?;
        // What is given on the command line is the same as in the record, in the user's own words.
        let lpips = if args.lpips.lpips.is_some() { &args.lpips } else { &record.lpips }.load()?;
        let given = if args.capture.capture.is_some() { &args.capture } else { &record.capture };
        let recorded_poses: StartPoses = record.poses.parse()?;
        let poses = args.poses.clone().unwrap_or(recorded_poses);
        let path = given.capture.clone().context("--capture: is missing")?;
        if record.demo {
            demo_capture(gpu, path.clone(), interruption)?;
        }
        // A requested split that does not exist fails here, before training.
        let needed: Vec<&str> = std::iter::once(&record.split).chain(&record.test_split).map(String::as_str).collect();
        let mut capture = given.open(&path, &needed, &[DEFAULT_TEST_SPLIT])?;
        let start = poses.applied_to(&capture, &record.split)?;
        // What is compared and saved has the shape that training starts from, too.
        capture.template.clone_from(&start.template);
        capture.frames.iter_mut().zip(&start.frames).for_each(|(own, start)| own.shape.clone_from(&start.shape));
        let test_split = plan.test_split();
        check_before_training(&start, &path, &record.split, test_split, args.ignore_checks || record.ignore_checks)?;
        let train_split = capture.split(&record.split)?.clone();
        Ok(Inputs { path, capture, start, poses, train_split, lpips })
    }

    /// The capture with the cameras and their colours as training found them.
    pub fn refined_by(&self, trained: &Trained) -> Capture {
        let mut refined = Capture { cameras: trained.cameras.clone(), ..self.capture.clone() };
        refined.color_correction.cameras.clone_from(&trained.colors);
        refined
    }
}

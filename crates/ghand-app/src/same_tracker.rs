//! Poses of the tracker that gave an avatar's training poses.

use std::path::Path;

use anyhow::{Context, bail};
use clap::Args;
use ghand_avatar::Avatar;
use ghand_core::pose_offsets::TrackerOffsets;
use ghand_motion::PoseSequence;

use crate::pose_choice::is_name;
use crate::say;

/// How the tracker of an avatar's capture is off; `path` is the avatar's, for messages.
///
/// # Errors
/// One sentence if the avatar does not know.
pub fn tracker_of<'a>(avatar: &'a Avatar, path: &Path) -> anyhow::Result<&'a TrackerOffsets> {
    avatar.tracker.as_ref().with_context(|| {
        format!(
            "--same-tracker: {} does not know how its capture's tracker is off: training refined no poses, or fewer than \
             eight; train it again, or leave the option out",
            path.display()
        )
    })
}

/// Whether poses are of the tracker that gave the avatar's training poses.
#[derive(Debug, Clone, Default, Args)]
pub struct SameTrackerArgs {
    /// The file's poses come from the tracker that gave the avatar's training poses: undo how they differ from the avatar's
    /// in all frames alike, as training found it
    #[arg(long)]
    same_tracker: bool,
}

impl SameTrackerArgs {
    /// The poses that `--pose` named, as those of an avatar; `path` is the avatar's, for messages.
    ///
    /// # Errors
    /// One sentence if they are of no tracker, or the avatar does not know how its tracker is off.
    pub fn apply(
        &self,
        pose: &str,
        mut poses: PoseSequence,
        avatar: &Avatar,
        path: &Path,
    ) -> anyhow::Result<PoseSequence> {
        if !self.same_tracker {
            return Ok(poses);
        }
        if is_name(pose) {
            bail!("--same-tracker: {pose:?} is a pose or motion of ghand, of no tracker; omit --same-tracker");
        }
        let tracker = tracker_of(avatar, path)?;
        for frame in &mut poses.frames {
            frame.pose = tracker.offsets.apply(&frame.pose, &avatar.model.parents);
        }
        say!("poses: {}", describe(tracker));
        Ok(poses)
    }

    /// Fails if the option is given where nothing is of a tracker, because of `reason`.
    ///
    /// # Errors
    /// One sentence then.
    pub fn refuse(&self, reason: &str) -> anyhow::Result<()> {
        if self.same_tracker {
            bail!("--same-tracker: {reason}; omit it");
        }
        Ok(())
    }
}

/// What is undone, for the user.
pub fn describe(tracker: &TrackerOffsets) -> String {
    format!(
        "what the tracker's poses differ by from the avatar's in all frames is undone, {:.1} degrees a joint (known to {:.1}, \
         from {} frames)",
        tracker.offsets.mean_degrees(),
        mean_error_degrees(tracker),
        tracker.frames
    )
}

/// A line on a tracker whose poses clearly differ from the avatar's in all frames alike; `None` if they do not.
pub fn remark(tracker: &TrackerOffsets) -> Option<String> {
    let [off, error] = [tracker.offsets.mean_degrees(), mean_error_degrees(tracker)];
    (off > CLEARLY * error).then(|| {
        format!(
            "tracker: the poses at the start differ from the avatar's by {off:.1} degrees a joint in all frames alike (known \
             to {error:.1}); --same-tracker undoes that in other poses of their tracker"
        )
    })
}

/// As many standard errors are no chance.
const CLEARLY: f64 = 4.0;

/// Mean over the joints.
fn mean_error_degrees(tracker: &TrackerOffsets) -> f64 {
    (tracker.errors.iter().sum::<f64>() / tracker.errors.len().max(1) as f64).to_degrees()
}

//! The poses of a capture's frames: as given, and as the training of an avatar has improved them.

use std::path::{Path, PathBuf};

use anyhow::bail;
use ghand_capture::Capture;
use ghand_core::skeleton::pose_skeleton;
use ghand_core::{HandModel, Pose};
use ghand_motion::{PoseFrame, PoseOptions, read_poses};

/// The file of refined poses that training writes beside an avatar.
const FILE_NAME: &str = "poses.json";

/// How far the joints of a trained pose are from those of the given one in half of the frames at most, metres: training
/// moves poses by centimetres at most, while another capture's frames, which may well have the same ids, show other
/// poses in other places.
const LARGEST_CHANGE: f64 = 0.08;

/// The poses of the frames for one hand model.
#[derive(Debug, Clone)]
pub struct CapturePoses {
    given: Vec<PoseFrame>,
    /// Those of training, one entry per frame; `None` for frames that it did not have. Empty if there are none at all.
    trained: Vec<Option<Pose>>,
    /// Whether those of training are shown where there are any.
    of_training: bool,
}

impl CapturePoses {
    /// As given.
    pub fn new(given: Vec<PoseFrame>) -> CapturePoses {
        CapturePoses { given, trained: Vec::new(), of_training: true }
    }

    /// Takes the poses from the run that trained an avatar, if they are beside it; else all frames are as given.
    ///
    /// # Errors
    /// One sentence that names the file if it is broken or belongs to another capture.
    pub fn read_trained(&mut self, avatar: &Path, capture: &Capture, model: &HandModel) -> anyhow::Result<()> {
        self.trained.clear();
        let path: PathBuf = avatar.with_file_name(FILE_NAME);
        // Most avatars that were moved have none: that is no mistake.
        if !path.exists() {
            return Ok(());
        }
        let sequence = read_poses(&path, model, &PoseOptions { by_id: true, ..Default::default() })?;
        let mut trained: Vec<Option<Pose>> = vec![None; self.given.len()];
        for PoseFrame { id, pose, .. } in sequence.frames {
            // A frame without a pose in the capture is not in the list.
            let place = self.given.iter().position(|frame| frame.id == id);
            match place.and_then(|place| trained.get_mut(place)) {
                Some(entry) => *entry = Some(pose),
                None if capture.frame_index(&id).is_some() => {}
                None => bail!(
                    "{}: has a frame {id:?}, which the capture does not have, so its poses are shown as given",
                    path.display()
                ),
            }
        }
        let change = self.median_change(&trained, model);
        if change > LARGEST_CHANGE {
            bail!(
                "{}: its poses are {:.0} cm away from those of the capture, so they seem to be of another capture, and \
                 poses are shown as given",
                path.display(),
                100.0 * change
            );
        }
        self.trained = trained;
        Ok(())
    }

    /// Mean distance of the joints of the trained pose from those of the given one, metres, of the median frame.
    fn median_change(&self, trained: &[Option<Pose>], model: &HandModel) -> f64 {
        let joints = |pose: &Pose| {
            let chain = pose_skeleton(&model.parents, &model.joints, &pose.rotations);
            chain.world.iter().map(|joint| joint.translation + pose.translation).collect::<Vec<_>>()
        };
        let distance = |(given, trained): (&PoseFrame, &Option<Pose>)| {
            let given = joints(&given.pose);
            let trained = joints(trained.as_ref()?);
            let sum: f64 = given.iter().zip(&trained).map(|(a, b)| a.distance(*b)).sum();
            Some(sum / given.len() as f64)
        };
        let mut distances: Vec<f64> = self.given.iter().zip(trained).filter_map(distance).collect();
        distances.sort_by(f64::total_cmp);
        distances.get(distances.len() / 2).copied().unwrap_or(0.0)
    }

    /// Number of frames.
    pub fn len(&self) -> usize {
        self.given.len()
    }

    /// Whether there are no frames.
    pub fn is_empty(&self) -> bool {
        self.given.is_empty()
    }

    /// The id of a frame.
    pub fn id(&self, frame: usize) -> Option<&str> {
        self.given.get(frame).map(|frame| frame.id.as_str())
    }

    /// The pose that is shown of a frame.
    pub fn pose(&self, frame: usize) -> Option<&Pose> {
        let given = &self.given.get(frame)?.pose;
        Some(self.trained_pose(frame).filter(|_| self.of_training).unwrap_or(given))
    }

    /// Whether there are poses of training.
    pub fn has_trained(&self) -> bool {
        !self.trained.is_empty()
    }

    /// Whether those of training are shown where there are any.
    pub fn are_of_training(&self) -> bool {
        self.has_trained() && self.of_training
    }

    /// Shows those of training where there are any, or all as given.
    pub fn choose(&mut self, of_training: bool) {
        self.of_training = of_training;
    }

    /// Says which pose is shown of a frame.
    pub fn remark(&self, frame: usize) -> &'static str {
        match (self.trained_pose(frame), self.of_training) {
            (Some(_), true) => "shown: as training refined it",
            (Some(_), false) => "shown: as given, before training",
            (None, _) => "shown: as given; not a frame of training",
        }
    }

    fn trained_pose(&self, frame: usize) -> Option<&Pose> {
        self.trained.get(frame)?.as_ref()
    }
}

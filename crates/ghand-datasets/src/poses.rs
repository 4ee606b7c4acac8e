//! Poses of a sequence: of the built-in hand or any other, fitted to joints, or MANO's own.

use std::path::Path;

use ghand_capture::capture::HandModelSource;
use ghand_core::posing::shape_hand;
use ghand_core::skeleton::pose_skeleton;
use ghand_core::{HandModel, Pose, PoseSpace, Side};
use ghand_hand_model::builtin::builtin_hand;
use ghand_hand_model::files::mano::{JOINT_NAMES, LeftShapes, ManoOptions, read_mano};
use ghand_motion::LandmarkFit;
use ghand_motion::space_landmarks::{SpaceFrame, fit_hand_in_space};
use glam::DVec3;

use crate::DatasetError;
use crate::sequence::{Annotated, Fingers, ManoPose, Place, Sequence};

/// Where one gets MANO's files.
const MANO_SITE: &str = "https://mano.is.tue.mpg.de";

/// The hand model of a capture, and its poses.
pub(crate) struct Posed {
    pub model: HandModel,
    pub source: HandModelSource,
    /// Pose and shape of each frame; `None` where joints are not a hand's.
    pub frames: Vec<Option<(Pose, Vec<f64>)>>,
    /// How well joints fit, if they were fitted.
    pub fit: Option<LandmarkFit>,
    /// What the user should know.
    pub remark: Option<String>,
}

/// The poses of some frames of a sequence.
pub(crate) fn poses(
    dataset: &str,
    sequence: &Sequence,
    frames: &[&Annotated],
    hand_model: Option<&Path>,
) -> Result<Posed, DatasetError> {
    let Some(path) = hand_model else {
        if frames.iter().all(|frame| frame.joints.is_none()) {
            let side = if sequence.side == Side::Right { "MANO_RIGHT.pkl" } else { "MANO_LEFT.pkl" };
            let problem = format!(
                "has no joints, only MANO's parameters, which need MANO's own file; give {side} with --hand-model; one gets it \
                 at {MANO_SITE} under MANO's licence"
            );
            return Err(DatasetError::file(Path::new(dataset), problem));
        }
        return fitted(builtin_hand(sequence.side)?, HandModelSource::Builtin, sequence, frames);
    };
    let options = ManoOptions { left_shapes: sequence.left_shapes, ..ManoOptions::default() };
    let file = read_mano(path, &options)?;
    let fail = |problem: String| Err(DatasetError::file(path, problem));
    let is_as_published = file.has_left_shape_bug && sequence.left_shapes == LeftShapes::AsPublished;
    let remark = is_as_published.then(|| {
        format!(
            "shapes of left hands of {dataset} are for MANO's left model as published; give --left-shapes-as-published with \
             --hand-model"
        )
    });
    let model = file.model;
    if model.side != sequence.side {
        let [is, wanted] = [model.side, sequence.side];
        return fail(format!("is a {is} hand, and the sequence is read for its {wanted} one; give the {wanted} model"));
    }
    if frames.iter().all(|frame| frame.mano.is_none()) {
        return Ok(Posed { remark, ..fitted(model, HandModelSource::Mano, sequence, frames)? });
    }
    if model.joint_names != JOINT_NAMES {
        return fail("does not have MANO's 16 joints; give MANO_RIGHT.pkl or MANO_LEFT.pkl as downloaded".into());
    }
    let pose = |frame: &&Annotated| -> Result<_, DatasetError> {
        let Some(mano) = &frame.mano else { return Ok(None) };
        let pose = mano
            .pose(&model)
            .map_err(|problem| DatasetError::file(path, format!("{problem} (frame {} of {dataset})", frame.id)))?;
        Ok(Some((pose, mano.shape.clone())))
    };
    let frames = frames.iter().map(pose).collect::<Result<_, _>>()?;
    Ok(Posed { model, source: HandModelSource::Mano, frames, fit: None, remark })
}

fn fitted(
    model: HandModel,
    source: HandModelSource,
    sequence: &Sequence,
    frames: &[&Annotated],
) -> Result<Posed, DatasetError> {
    let seen = |frame: &&Annotated| SpaceFrame { id: frame.id.clone(), points: frame.joints };
    let seen: Vec<SpaceFrame> = frames.iter().map(seen).collect();
    let fitted = fit_hand_in_space(&seen, &model, sequence.tip_inset)?;
    let frames = fitted.poses.into_iter().map(|pose| Some((pose?, fitted.shape.clone()))).collect();
    Ok(Posed { model, source, frames, fit: Some(fitted.report), remark: None })
}

impl ManoPose {
    /// The pose of MANO's model in the world of the cameras.
    ///
    /// # Errors
    /// What the model lacks, as the end of a sentence about its file.
    pub fn pose(&self, model: &HandModel) -> Result<Pose, String> {
        let space = model.pose_space.as_ref();
        let mut rotations = vec![self.root];
        rotations.extend(self.finger_rotations(space, model.joint_count().saturating_sub(1))?);
        if rotations.len() != model.joint_count() {
            return Err(format!("has {} joints, and the pose {}", model.joint_count(), rotations.len()));
        }
        let joints = shape_hand(model, &self.shape).map_err(|error| error.to_string())?.joints;
        let translation = match self.place {
            Place::Added(translation) => translation,
            Place::Joint(joint, at) => {
                let chain = pose_skeleton(&model.parents, &joints, &rotations);
                at - chain.world.get(joint).map(|joint| joint.translation).unwrap_or_default()
            }
        };
        let root = joints.first().copied().unwrap_or_default();
        let pose = Pose { rotations, translation };
        let moved = pose.moved(&self.world_from_mano.rotation, self.world_from_mano.translation, root);
        moved.check_range(&model.joint_names).map_err(|error| error.to_string())?;
        Ok(moved)
    }

    fn finger_rotations(&self, space: Option<&PoseSpace>, count: usize) -> Result<Vec<DVec3>, String> {
        let lacks = || "lacks the mean pose and principal components (hands_mean, hands_components)".to_owned();
        let mean = match (self.from_mean, space) {
            (true, Some(space)) => space.mean.clone(),
            (true, None) => return Err(lacks()),
            (false, _) => vec![DVec3::ZERO; count],
        };
        let own = match &self.fingers {
            Fingers::Rotations(numbers) => numbers.chunks_exact(3).map(DVec3::from_slice).collect(),
            Fingers::Components(parts) => {
                let directions = &space.ok_or_else(lacks)?.components;
                if directions.len() < parts.len() * count {
                    return Err(lacks());
                }
                let mut sum = vec![DVec3::ZERO; count];
                for (part, direction) in parts.iter().zip(directions.chunks_exact(count.max(1))) {
                    sum.iter_mut().zip(direction).for_each(|(sum, direction)| *sum += *part * *direction);
                }
                sum
            }
        };
        Ok(mean.into_iter().zip(own).map(|(mean, own)| mean + own).collect())
    }
}

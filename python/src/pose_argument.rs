//! What a user may give as a pose.

use std::path::PathBuf;

use anyhow::{Context, bail};
use ghand_core::{HandModel, Pose as CorePose};
use ghand_motion::PoseOptions;
use glam::DVec3;
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::Numbers;
use crate::error::{failed, wrong};
use crate::messages::warn;
use crate::pose::{Pose, poses_of, rotations_of};
use crate::posed::PosedAvatar;

/// The pose that an argument stands for, checked against the model: a [`Pose`], a name, a file, rotations of all joints, or
/// rotations by joint names.
///
/// # Errors
/// An exception that says what is wrong with it.
pub fn pose_of(
    value: &Bound<'_, PyAny>,
    translation: Option<&Bound<'_, PyAny>>,
    frame: Option<&Bound<'_, PyAny>>,
    model: &HandModel,
) -> PyResult<CorePose> {
    let py = value.py();
    let is_file = value.extract::<PathBuf>();
    if frame.is_some() && is_file.is_err() {
        return Err(wrong("frame: chooses one of a file's poses, and `pose` is none; leave it out"));
    }
    let mut pose = if let Ok(pose) = value.cast::<Pose>() {
        pose.get().0.clone()
    } else if let Ok(posed) = value.cast::<PosedAvatar>() {
        posed.get().pose.clone()
    } else if let Ok(path) = is_file {
        of_file(py, path, frame, model)?
    } else if let Ok(joints) = value.cast::<PyDict>() {
        by_joints(joints, model)?
    } else {
        let rotations = rotations_of(value).map_err(|error| {
            if error.is_instance_of::<PyTypeError>(py) {
                let kinds = "must be a name, a file, a Pose, rotations, or rotations by joint names";
                PyTypeError::new_err(format!("pose: {kinds}: {}", error.value(py)))
            } else {
                error
            }
        })?;
        CorePose { rotations, translation: DVec3::ZERO }
    };
    if let Some(translation) = translation {
        pose.translation = Numbers::exactly("translation", translation)?.into();
    }
    let [has, needed] = [pose.rotations.len(), model.joint_count()];
    if has != needed {
        return Err(wrong(format!("pose: has {has} joints, and the hand {needed}")));
    }
    pose.check_range(&model.joint_names).map_err(|error| wrong(format!("pose: {error}")))?;
    Ok(pose)
}

/// One pose of a file, or a pose by name.
fn of_file(py: Python<'_>, path: PathBuf, frame: Option<&Bound<'_, PyAny>>, model: &HandModel) -> PyResult<CorePose> {
    let frame = frame.map(|frame| frame.str().map(|text| text.to_string())).transpose()?;
    let found = py.detach(|| -> anyhow::Result<(CorePose, Vec<String>)> {
        let sequence = poses_of(&path, model, &PoseOptions::default())?;
        let frames = &sequence.frames;
        let chosen = match (&frame, frames.as_slice()) {
            (None, [only]) => Some(only),
            (None, _) => bail!(
                "{}: has {} poses; choose one with frame=, or take them all with ghand.read_poses",
                path.display(),
                frames.len()
            ),
            (Some(wanted), _) => {
                let by_number = || frames.get(wanted.parse::<usize>().ok()?);
                frames.iter().find(|frame| frame.id == *wanted).or_else(by_number)
            }
        };
        let missing = || format!("{}: has no frame {}", path.display(), frame.as_deref().unwrap_or_default());
        Ok((chosen.with_context(missing)?.pose.clone(), sequence.warnings))
    });
    let (pose, remarks) = found.map_err(failed)?;
    warn(py, &remarks)?;
    Ok(pose)
}

/// Rotations by joint names; other joints stay at rest.
fn by_joints(joints: &Bound<'_, PyDict>, model: &HandModel) -> PyResult<CorePose> {
    let mut pose = CorePose::rest(model.joint_count());
    for (name, rotation) in joints {
        let name: String = name.extract()?;
        let joint = model.joint_names.iter().position(|known| *known == name);
        let place = joint.and_then(|joint| pose.rotations.get_mut(joint));
        let unknown = || wrong(format!("pose: there is no joint {name:?}; there are {}", model.joint_names.join(", ")));
        *place.ok_or_else(unknown)? = Numbers::exactly(&name, &rotation)?.into();
    }
    Ok(pose)
}

//! Converts the content of a file to rotations of the model's joints.

use std::path::Path;

use ghand_capture::capture::Capture;
use ghand_core::rotation::{axis_angle_from_rotation, rotation_from_axis_angle};
use ghand_core::{HandModel, Pose, Side};
use ghand_hand_model::files::mano::JOINT_NAMES;
use glam::DVec3;

use super::plausibility;
use crate::average_hand::average_hand;
use crate::pose_sequence::formats::mano;
use crate::pose_sequence::reading::file_skeleton::FileSkeleton;
use crate::pose_sequence::reading::recording::{LeftRotations, ManoRows, Rows};
use crate::pose_sequence::reading::source::{OPENGL_AXES, in_range};
use crate::pose_sequence::{PoseError, PoseFrame, PoseOptions, Source};
use crate::rest_skeleton::RestSkeleton;
use crate::retarget::{Retarget, mirrored_point};

/// ghand's own rows for the model, and their original hand: unchanged if their skeleton is the model's, else
/// transferred.
pub(crate) fn rows(
    source: &Source,
    rows: Rows,
    model: &HandModel,
    options: &PoseOptions,
    warnings: &mut Vec<String>,
) -> Result<(Vec<PoseFrame>, Side), PoseError> {
    let Rows { rig, mut frames, capture_kind, from_mean, side } = rows;
    let from_mean = from_mean && !options.flat_mean;
    let rig = rig.map(|rig| FileSkeleton { side: rig.side.or(side).or(options.side), ..rig });
    let pose_model = options.pose_model.as_ref();
    // The best description of the skeleton: the file itself, the capture's hand model, or the model given by the user.
    let is_complete = rig.as_ref().is_some_and(|rig| rig.missing().is_empty());
    let named = match (&rig, capture_kind.as_deref(), pose_model) {
        _ if is_complete => None,
        (_, Some(kind), _) => match (Capture::open(Path::new(source.origin)), pose_model) {
            (Ok(capture), _) => Some(capture.hand_model),
            (Err(_), Some(model)) => Some(model.clone()),
            // The user has MANO's file; its joints are known without it.
            (Err(_), None) if kind == "mano" => {
                return mano_capture(source, rig, frames, side, model, options, warnings);
            }
            // The model's own joints are enough.
            (Err(_), None) if rig.as_ref().is_some_and(|rig| rig.rows_of(&model.joint_names).is_some()) => None,
            (Err(error), None) => return Err(source.invalid("hand_model", error.to_string())),
        },
        (_, None, Some(model)) => Some(model.clone()),
        _ => None,
    };
    let names = rig.as_ref().map_or(&named.as_ref().unwrap_or(model).joint_names, |rig| &rig.joint_names);
    check(source, &frames, names)?;
    let full = match (&named, rig) {
        (Some(named), rig) => {
            if let Some(rig) = rig {
                order(source, &rig, &named.joint_names, &mut frames)?;
            }
            if from_mean && capture_kind.is_none() {
                add_mean(&mut frames, named);
            }
            Some(FileSkeleton::of(named))
        }
        (None, rig) => rig,
    };
    let Some(full) = full else {
        // Rows without names belong to the model's joints.
        if from_mean {
            add_mean(&mut frames, model);
        }
        return Ok(of_side(frames, options.side.or(side), model));
    };
    if full.missing().is_empty() {
        let own = full.side.unwrap_or(model.side);
        if options.side.is_some_and(|wanted| wanted != own) {
            let problem = format!(
                "the file says that the rows are of a {own} hand, which contradicts --side; omit --side: poses of the \
                 other hand are mirrored"
            );
            return Err(source.invalid("hand_model.side", problem));
        }
        if full.is_of(model, source) {
            order(source, &full, &model.joint_names, &mut frames)?;
            if from_mean && named.is_none() {
                add_mean(&mut frames, model);
            }
            return Ok((frames, own));
        }
        return Ok((retargeted(frames, &full.rig(source)?, &RestSkeleton::of(model)?), own));
    }
    let side = options.side.or(full.side).or(side);
    if full.rows_of(&model.joint_names).is_some() {
        order(source, &full, &model.joint_names, &mut frames)?;
        if from_mean {
            add_mean(&mut frames, model);
        }
        return Ok(of_side(frames, side, model));
    }
    let mano_names = JOINT_NAMES.map(String::from);
    if full.joint_names.len() == JOINT_NAMES.len() && full.rows_of(&mano_names).is_some() {
        order(source, &full, &mano_names, &mut frames)?;
        let side = side.unwrap_or(model.side);
        warnings.push(
            "the file names joints but not their rest positions; the poses are read as those of an average hand (add \
             hand_model.side, parents and rest_joints, or use --pose-model)"
                .into(),
        );
        return Ok((retargeted(frames, &average_hand(side)?, &RestSkeleton::of(model)?), side));
    }
    let lacking = model.joint_names.iter().find(|joint| !full.joint_names.contains(joint));
    let problem = format!(
        "lacks the model's joint {:?}, so the poses are for another skeleton, whose {} missing; write the poses again \
         with `ghand pose --hand-model THEIR_MODEL --pose FILE --out POSES.json`, which adds it, or give their model \
         with --pose-model",
        lacking.map_or("", String::as_str),
        match &full.missing()[..] {
            [one] => format!("hand_model.{one} is"),
            many => format!("hand_model.{} are", many.join(", ")),
        }
    );
    Err(source.invalid("hand_model.joints", problem))
}

/// Checks the number of rows and the range of their values.
fn check(source: &Source, frames: &[PoseFrame], names: &[String]) -> Result<(), PoseError> {
    for PoseFrame { id, pose, shape } in frames {
        if pose.rotations.len() != names.len() {
            let [got, expected] = [pose.rotations.len(), names.len()];
            let problem = format!(
                "has {got} rows, expected {expected}: one per joint; poses of another skeleton need \"hand_model\" \
                 with its \"joints\", \"side\", \"parents\" and \"rest_joints\", or its model in --pose-model"
            );
            return Err(source.invalid(&format!("frames[{id:?}].pose"), problem));
        }
        if let Err((field, problem)) = in_range(pose, shape, names) {
            return Err(source.invalid(&format!("frames[{id:?}].{field}"), problem));
        }
    }
    Ok(())
}

/// Rows in the order of these joints.
fn order(source: &Source, rig: &FileSkeleton, names: &[String], frames: &mut [PoseFrame]) -> Result<(), PoseError> {
    let Some(order) = rig.rows_of(names) else {
        let lacking = names.iter().find(|name| !rig.joint_names.contains(name));
        let problem = format!(
            "lacks {:?}, a joint of the model that the poses are for; give the model that has the file's joints",
            lacking.map_or("", String::as_str)
        );
        return Err(source.invalid("hand_model.joints", problem));
    };
    for PoseFrame { pose, .. } in frames {
        pose.rotations = order.iter().filter_map(|&row| pose.rotations.get(row).copied()).collect();
    }
    Ok(())
}

/// Rows of the model's own joints; mirrored if they are of the other hand.
fn of_side(mut frames: Vec<PoseFrame>, side: Option<Side>, model: &HandModel) -> (Vec<PoseFrame>, Side) {
    let side = side.unwrap_or(model.side);
    if side != model.side {
        frames.iter_mut().for_each(|frame| frame.pose = frame.pose.mirrored());
    }
    (frames, side)
}

/// Poses of a capture with a MANO model that was not given.
fn mano_capture(
    source: &Source,
    rig: Option<FileSkeleton>,
    mut frames: Vec<PoseFrame>,
    side: Option<Side>,
    model: &HandModel,
    options: &PoseOptions,
    warnings: &mut Vec<String>,
) -> Result<(Vec<PoseFrame>, Side), PoseError> {
    let names = JOINT_NAMES.map(String::from);
    check(source, &frames, rig.as_ref().map_or(&names[..], |rig| &rig.joint_names))?;
    if let Some(rig) = &rig {
        order(source, rig, &names, &mut frames)?;
    }
    let side = options.side.or(side).unwrap_or(model.side);
    let rows = ManoRows { frames, from_mean: false, opengl: false, left: LeftRotations::Own };
    Ok((mano_rows(rows, side, model, options, warnings)?, side))
}

/// Poses of MANO's joints. A model with MANO's joints in MANO's axes uses them unchanged.
pub(crate) fn mano_rows(
    rows: ManoRows,
    side: Side,
    model: &HandModel,
    options: &PoseOptions,
    warnings: &mut Vec<String>,
) -> Result<Vec<PoseFrame>, PoseError> {
    let ManoRows { mut frames, from_mean, opengl, left } = rows;
    if side == Side::Left && plausibility::is_mirrored(left, options.mirrored, warnings) {
        // The position is that in the picture, which was never mirrored.
        frames.iter_mut().for_each(|frame| frame.pose.rotations = frame.pose.mirrored().rotations);
    }
    let from_mean = from_mean && !options.flat_mean;
    let target = RestSkeleton::of(model)?;
    let given = options.pose_model.as_ref();
    let turn = |frames: &mut [PoseFrame], rig: &RestSkeleton| {
        if opengl {
            let wrist = rig.joints.first().copied().unwrap_or_default();
            let wrist = if rig.side == side { wrist } else { mirrored_point(wrist) };
            frames.iter_mut().for_each(|frame| from_opengl(&mut frame.pose, wrist));
        }
    };
    if mano::is_mano(&target) && given.is_none() {
        turn(&mut frames, &target);
        if side != model.side {
            frames.iter_mut().for_each(|frame| frame.pose = frame.pose.mirrored());
        }
        if from_mean {
            add_mean(&mut frames, model);
            if model.pose_space.is_none() {
                warnings.push(mean_is_unknown());
            }
        }
        return Ok(frames);
    }
    let rig = match given {
        Some(mano_model) => {
            let rig = RestSkeleton::of(mano_model)?;
            if from_mean {
                // The mean is that of the model's side; poses of the other hand are mirrored to it first.
                if side != rig.side {
                    frames.iter_mut().for_each(|frame| frame.pose = frame.pose.mirrored());
                }
                add_mean(&mut frames, mano_model);
                if side != rig.side {
                    frames.iter_mut().for_each(|frame| frame.pose = frame.pose.mirrored());
                }
            }
            rig
        }
        None => {
            if from_mean {
                warnings.push(mean_is_unknown());
            }
            mano::stand_in(side)?
        }
    };
    turn(&mut frames, &rig);
    if rig.side == side {
        return Ok(retargeted(frames, &rig, &target));
    }
    frames.iter_mut().for_each(|frame| frame.pose = frame.pose.mirrored());
    Ok(retargeted(frames, &rig, &target))
}

/// From OpenGL's camera (y up, looking along -z) to ghand's world (y down, looking along z): the whole hand rotates by
/// half a turn about x. A pose rotates about the wrist, which is at `wrist` at rest.
fn from_opengl(pose: &mut Pose, wrist: DVec3) {
    if let Some(root) = pose.rotations.first_mut() {
        *root = axis_angle_from_rotation(&(OPENGL_AXES * rotation_from_axis_angle(*root)));
    }
    pose.translation = OPENGL_AXES * (wrist + pose.translation) - wrist;
}

fn mean_is_unknown() -> String {
    "the poses are measured from MANO's mean pose, which is only in a MANO file; give one with --pose-model, or the \
     hand will be too flat"
        .into()
}

/// Adds the mean pose that MANO's poses are measured from, if the model has one.
fn add_mean(frames: &mut [PoseFrame], model: &HandModel) {
    let Some(space) = &model.pose_space else { return };
    for frame in frames {
        frame.pose.rotations.iter_mut().skip(1).zip(&space.mean).for_each(|(rotation, mean)| *rotation += *mean);
    }
}

/// Poses of one skeleton for another. Shape parameters are those of the other model and stay behind.
pub(crate) fn retargeted(frames: Vec<PoseFrame>, from: &RestSkeleton, to: &RestSkeleton) -> Vec<PoseFrame> {
    let retarget = Retarget::new(from, to);
    let frame = |frame: PoseFrame| PoseFrame { pose: retarget.pose(&frame.pose), shape: vec![], id: frame.id };
    frames.into_iter().map(frame).collect()
}

//! Poses that drive a hand model, from whatever wrote them down.
//!
//! [`read_poses`] tells the kind of a file by its content and gives a [`PoseSequence`]: the rate, and for each frame one
//! axis-angle rotation a joint of *your* model and a translation. What can be read:
//!
//! | | file | what is in it |
//! |---|---|---|
//! | ghand's own, or a capture | JSON, `.npz` | [`ghand`] |
//! | MANO parameters: InterHand2.6M, HaMeR, WiLoR, HaWoR, ARCTIC, AMASS | JSON, `.npz`, `.npy`, `.pkl` | [`mano`] |
//! | joints of WebXR or OpenXR | JSON, `.npz` | [`xr`] |
//! | MediaPipe's world landmarks | JSON, `.npz`, `.pkl` | [`landmarks`] |
//!
//! Rotations of another rig are carried over as [`crate::retarget`] says, landmarks are fitted by [`crate::ik`]. Poses of
//! the other hand are mirrored, with a warning. ghand's own files must be right; of what a tracker wrote, frames that
//! cannot be used are left out and counted in one warning.

pub mod ghand;
pub mod landmarks;
pub mod mano;
mod recording;
pub mod xr;

use std::path::{Path, PathBuf};

use ghand_core::hand_model::{HandModelError, Side};
use ghand_core::rotation::{axis_angle_from_rotation, rotation_from_axis_angle};
use ghand_core::value::{Value, ValueError};
use ghand_core::{HandModel, Pose};
use glam::{DMat3, DQuat, DVec3};

use crate::capture::Capture;
use crate::ik::HandIk;
use crate::retarget::{Retarget, mirrored, mirrored_point};
use crate::rig::Rig;
pub(crate) use recording::{Motion, Recording, Skipped, Source};

/// Frames a second of what does not say.
pub const DEFAULT_FPS: f64 = 30.0;

/// What is wrong with a file of poses. Every message names the file, the field and what to do.
#[derive(Debug, thiserror::Error)]
pub enum PoseError {
    /// The file cannot be read, or is of no kind that is read.
    #[error("{path}: the poses: {source}")]
    File {
        /// The file.
        path: PathBuf,
        /// The cause.
        source: ValueError,
    },
    /// The file cannot be written.
    #[error("{path}: cannot write the poses: {source}")]
    Write {
        /// The file.
        path: PathBuf,
        /// The cause.
        source: std::io::Error,
    },
    /// A field holds something unusable.
    #[error("{origin}: {field}: {problem}")]
    Invalid {
        /// The file, or the hand model.
        origin: String,
        /// The field, as in `frames["0003"].pose`.
        field: String,
        /// What is wrong and what to do about it.
        problem: String,
    },
    /// The hand model that poses are carried over from cannot be made.
    #[error(transparent)]
    HandModel(#[from] HandModelError),
}

/// One moment.
#[derive(Debug, Clone, PartialEq)]
pub struct PoseFrame {
    /// Id of the frame.
    pub id: String,
    /// The pose, one rotation a joint.
    pub pose: Pose,
    /// Shape parameters of the hand model; empty for the mean shape, and for poses of another model.
    pub shape: Vec<f64>,
}

/// Poses at a constant rate.
#[derive(Debug, Clone, PartialEq)]
pub struct PoseSequence {
    /// Frames a second.
    pub fps: f64,
    /// Names of the joints, in the order of the rotations.
    pub joint_names: Vec<String>,
    /// At least one frame.
    pub frames: Vec<PoseFrame>,
    /// What the user should know, a sentence each.
    pub warnings: Vec<String>,
}

/// What a file does not say.
#[derive(Debug, Clone, Default)]
pub struct PoseOptions {
    /// Which hand the poses are of: it is taken from a file that has both, and believed where the file says otherwise. Without it,
    /// the model's side is taken where it is there, else the other one, mirrored.
    pub side: Option<Side>,
    /// The MANO model that MANO parameters are for: its rest skeleton and mean pose make what is carried over to another rig
    /// exact. Without it the built-in hand, turned into MANO's axes, stands in.
    pub pose_model: Option<HandModel>,
    /// Take poses as measured from the flat hand: a MANO model's mean pose is not added.
    pub flat_mean: bool,
    /// Which capture to take from a file that holds several.
    pub take: Option<String>,
    /// Leave out the rotation and the place of the whole hand.
    pub in_place: bool,
}

/// Reads a file of poses for a hand model; see the module.
///
/// # Errors
/// [`PoseError`] names the file, the field and a remedy when the file is none that is read, when no frame is usable, or when
/// the model's joints do not tell what they stand for and the poses are not for them.
pub fn read_poses(path: &Path, model: &HandModel, options: &PoseOptions) -> Result<PoseSequence, PoseError> {
    let path = if path.is_dir() { path.join("capture.json") } else { path.to_path_buf() };
    let value = Value::read(&path).map_err(|source| PoseError::File { path: path.clone(), source })?;
    poses_of_value(&path.display().to_string(), &value, model, options)
}

/// Reads the bytes of a file as [`read_poses`] does. `origin` is the file's name, for messages; it is opened again only when it
/// is a capture of another rig.
///
/// # Errors
/// As of [`read_poses`].
pub fn read_poses_bytes(
    origin: &str,
    bytes: &[u8],
    model: &HandModel,
    options: &PoseOptions,
) -> Result<PoseSequence, PoseError> {
    let value = Value::from_bytes(bytes).map_err(|source| PoseError::File { path: origin.into(), source })?;
    poses_of_value(origin, &value, model, options)
}

/// Reads a file of its kind; `None` for one of another kind.
type Reader = fn(&Source, &Value) -> Option<Result<Recording, PoseError>>;

pub(crate) fn poses_of_value(
    origin: &str,
    value: &Value,
    model: &HandModel,
    options: &PoseOptions,
) -> Result<PoseSequence, PoseError> {
    let wanted = options.side.unwrap_or(model.side);
    let source = Source { origin, wanted, take: options.take.as_deref() };
    // The first that knows its own kind reads it.
    let readers: [Reader; 4] = [xr::read, landmarks::read, mano::read, ghand::read];
    let Some(recording) = readers.iter().find_map(|read| read(&source, value)) else {
        let problem = format!(
            "is {}, which is no kind of poses that is read: ghand's own (\"frames\" with \"pose\"), MANO parameters, joints of \
             WebXR or OpenXR, or MediaPipe's world landmarks",
            value.kind()
        );
        return Err(source.invalid("content", problem));
    };
    let Recording { side, fps, motion, mut warnings } = recording?;
    // What does not say which hand it is, is taken for the one that is wanted.
    let side = options.side.or(side).unwrap_or(model.side);
    let mut frames = match motion {
        Motion::Rows { joints, frames, is_capture, from_mean } => {
            let mut frames = rows(&source, joints, frames, is_capture, model)?;
            if from_mean && !options.flat_mean {
                add_mean(&mut frames, model);
            }
            frames
        }
        Motion::Mano { frames, from_mean } => mano_frames(frames, from_mean, side, model, options, &mut warnings)?,
        Motion::WebXr { frames } => carried_over(frames, &Rig::webxr(side), &Rig::of(model)?),
        Motion::Landmarks { frames } => fitted(&source, &frames, side, model, &mut warnings)?,
    };
    if side != model.side {
        let name = |side| if side == Side::Left { "left" } else { "right" };
        warnings.push(format!("the poses are of a {} hand, mirrored for this {} one", name(side), name(model.side)));
    }
    if frames.is_empty() {
        return Err(source.invalid("frames", "there are none".into()));
    }
    if options.in_place {
        for frame in &mut frames {
            frame.pose.translation = DVec3::ZERO;
            frame.pose.rotations.iter_mut().take(1).for_each(|root| *root = DVec3::ZERO);
        }
    }
    Ok(PoseSequence { fps: fps.unwrap_or(DEFAULT_FPS), joint_names: model.joint_names.clone(), frames, warnings })
}

/// ghand's own poses: rows in the order of the model's joints, or matched by name, or of a capture of another rig.
fn rows(
    source: &Source,
    joints: Option<Vec<String>>,
    mut frames: Vec<PoseFrame>,
    is_capture: bool,
    model: &HandModel,
) -> Result<Vec<PoseFrame>, PoseError> {
    let expected = joints.as_ref().map_or(model.joint_count(), Vec::len);
    if let Some(frame) = frames.iter().find(|frame| frame.pose.rotations.len() != expected) {
        let got = frame.pose.rotations.len();
        let problem = format!("has {got} rows, expected {expected}: one for each joint");
        return Err(source.invalid(&format!("frames[{:?}].pose", frame.id), problem));
    }
    if let Some(names) = joints {
        let row = |joint: &String| names.iter().position(|name| name == joint);
        let order: Option<Vec<usize>> = model.joint_names.iter().map(row).collect();
        match order {
            Some(order) => {
                for PoseFrame { pose, .. } in &mut frames {
                    let rows = &pose.rotations;
                    pose.rotations = order.iter().filter_map(|&row| rows.get(row).copied()).collect();
                }
            }
            // A capture says where its own rig is.
            None if is_capture => {
                let invalid = |problem: String| source.invalid("hand_model", problem);
                let capture = Capture::open(Path::new(source.origin)).map_err(|error| invalid(error.to_string()))?;
                let [from, to] = [Rig::of(&capture.hand_model)?, Rig::of(model)?];
                let order: Vec<usize> = from.joint_names.iter().filter_map(row).collect();
                for PoseFrame { pose, .. } in &mut frames {
                    let rows = &pose.rotations;
                    pose.rotations = order.iter().filter_map(|&row| rows.get(row).copied()).collect();
                }
                return Ok(carried_over(frames, &from, &to));
            }
            None => {
                let lacking = model.joint_names.iter().find(|joint| row(joint).is_none());
                let problem = format!(
                    "lacks the model's joint {:?}; give poses of the same hand model",
                    lacking.map_or("", String::as_str)
                );
                return Err(source.invalid("hand_model.joints", problem));
            }
        }
    }
    Ok(frames)
}

/// Poses of MANO's joints. A model with MANO's joints in MANO's axes takes them as they are.
fn mano_frames(
    mut frames: Vec<PoseFrame>,
    from_mean: bool,
    side: Side,
    model: &HandModel,
    options: &PoseOptions,
    warnings: &mut Vec<String>,
) -> Result<Vec<PoseFrame>, PoseError> {
    let from_mean = from_mean && !options.flat_mean;
    let target = Rig::of(model)?;
    let given = options.pose_model.as_ref();
    if mano::is_mano(&target) && given.is_none() {
        if side != model.side {
            frames.iter_mut().for_each(|frame| frame.pose = mirrored(&frame.pose));
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
            let rig = Rig::of(mano_model)?;
            if from_mean {
                // The mean is of the model's side; poses of the other hand are mirrored to it first.
                if side != rig.side {
                    frames.iter_mut().for_each(|frame| frame.pose = mirrored(&frame.pose));
                }
                add_mean(&mut frames, mano_model);
                if side != rig.side {
                    frames.iter_mut().for_each(|frame| frame.pose = mirrored(&frame.pose));
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
    if rig.side == side {
        return Ok(carried_over(frames, &rig, &target));
    }
    frames.iter_mut().for_each(|frame| frame.pose = mirrored(&frame.pose));
    Ok(carried_over(frames, &rig, &target))
}

fn mean_is_unknown() -> String {
    "the poses are measured from MANO's mean pose, which only a MANO model's file tells; give it, or the hand stays too flat"
        .into()
}

/// Adds the mean pose that MANO's poses are measured from, if the model has one.
fn add_mean(frames: &mut [PoseFrame], model: &HandModel) {
    let Some(space) = &model.pose_space else { return };
    for frame in frames {
        frame.pose.rotations.iter_mut().skip(1).zip(&space.mean).for_each(|(rotation, mean)| *rotation += *mean);
    }
}

/// Poses of one rig for another. Shape parameters are those of the other model and stay behind.
fn carried_over(frames: Vec<PoseFrame>, from: &Rig, to: &Rig) -> Vec<PoseFrame> {
    let retarget = Retarget::new(from, to);
    let frame = |frame: PoseFrame| PoseFrame { pose: retarget.pose(&frame.pose), shape: vec![], id: frame.id };
    frames.into_iter().map(frame).collect()
}

/// Poses of the model that put its joints at the landmarks, as far as a hand of its rig can.
fn fitted(
    source: &Source,
    frames: &[landmarks::LandmarkFrame],
    side: Side,
    model: &HandModel,
    warnings: &mut Vec<String>,
) -> Result<Vec<PoseFrame>, PoseError> {
    let mirror = |points: &[DVec3; 21]| if side == model.side { *points } else { points.map(mirrored_point) };
    let points: Vec<[DVec3; 21]> = frames.iter().map(|frame| mirror(&frame.points)).collect();
    let ik = HandIk::new(&Rig::of(model)?).fitted(&points);
    let (mut posed, mut skipped): (Vec<PoseFrame>, _) = (Vec::new(), Skipped::default());
    let mut last: Option<Pose> = None;
    for (frame, points) in frames.iter().zip(&points) {
        match ik.solve(points, last.as_ref()) {
            Some(solution) => {
                last = Some(solution.pose.clone());
                posed.push(PoseFrame { id: frame.id.clone(), pose: solution.pose, shape: vec![] });
            }
            None => skipped.add(&frame.id, "its landmarks are no hand: they lie in one place or in a line"),
        }
    }
    warnings.extend(skipped.finish(source, frames.len())?);
    Ok(posed)
}

impl PoseSequence {
    /// Length in seconds, from the first frame to the last.
    pub fn duration(&self) -> f64 {
        self.frames.len().saturating_sub(1) as f64 / self.fps
    }

    /// The pose at a time in seconds, between two frames by the shortest way that each joint can turn; before the first frame
    /// and after the last, theirs.
    pub fn at(&self, seconds: f64) -> Option<Pose> {
        let last = self.frames.len().checked_sub(1)?;
        let place = (seconds * self.fps).clamp(0.0, last as f64);
        let place = if place.is_nan() { 0.0 } else { place };
        let (before, part) = (place.floor() as usize, place.fract());
        let first = self.frames.get(before)?;
        match self.frames.get(before + 1) {
            Some(second) if part > 0.0 => Some(between(&first.pose, &second.pose, part)),
            _ => Some(first.pose.clone()),
        }
    }

    /// The same motion at another rate. Ids are counted anew; shapes are those of the frame before.
    pub fn resampled(&self, fps: f64) -> PoseSequence {
        let count = (self.duration() * fps + 1e-9).floor() as usize + 1;
        let frame = |k: usize| {
            let seconds = k as f64 / fps;
            let before = ((seconds * self.fps).floor() as usize).min(self.frames.len().saturating_sub(1));
            let shape = self.frames.get(before).map(|frame| frame.shape.clone()).unwrap_or_default();
            Some(PoseFrame { id: format!("{k:04}"), pose: self.at(seconds)?, shape })
        };
        PoseSequence { fps, frames: (0..count).filter_map(frame).collect(), ..self.clone() }
    }
}

/// The pose a part of the way from one to another: each joint turns about one axis, by the shorter way.
pub fn between(from: &Pose, to: &Pose, part: f64) -> Pose {
    let turn = |(a, b): (&DVec3, &DVec3)| {
        let [a, b] = [a, b].map(|r| DQuat::from_mat3(&rotation_from_axis_angle(*r)).normalize());
        axis_angle_from_rotation(&DMat3::from_quat(a.slerp(b, part).normalize()))
    };
    Pose {
        rotations: from.rotations.iter().zip(&to.rotations).map(turn).collect(),
        translation: from.translation.lerp(to.translation, part),
    }
}

#[cfg(test)]
mod tests;

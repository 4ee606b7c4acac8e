//! Poses that drive a hand model, from many kinds of files.
//!
//! [`read_poses`] recognises a file from its contents and returns a [`PoseSequence`]: the rate, and for each frame a
//! translation and one axis-angle rotation for each joint of *your* model. It reads:
//!
//! | | file | format |
//! |---|---|---|
//! | ghand's own, or a capture | JSON, JSON Lines, `.npz` | [`ghand`] |
//! | MANO parameters: InterHand2.6M, HaMeR, WiLoR, HaWoR, Dyn-HaMR, ARCTIC, GRAB, DexYCB, AMASS | JSON, `.npz`, `.npy`, `.pkl`, `.pt`, joblib | [`mano`] |
//! | HO-3D | `.pkl`, or the folder of them | [`ho3d`] |
//! | joints of WebXR or OpenXR | JSON, JSON Lines, `.npz`, `.npy` | [`xr`] |
//! | bodies of SAM 3D Body, for their hands | JSON, `.npz`, `.pkl`, `.pt` | [`sam_3d_body`] |
//! | MediaPipe's world landmarks | JSON, JSON Lines, `.npz`, `.pkl` | [`landmarks`] |
//! | landmarks in images of calibrated cameras | JSON, JSON Lines; of other trackers: [`crate::image_landmarks`] | [`image_landmarks`] |
//! | arrays of MANO's rotations or of landmarks, FreiHAND | JSON, JSON Lines, `.npz`, `.npy` | [`plain`] |
//!
//! Any of them may be inside `{"right": ..}` or `{"left": ..}`. [`crate::retarget`] transfers rotations of another
//! skeleton, and [`crate::ik`] fits landmarks: one hand for all frames, whose shape is that of the poses. Poses of the other hand are mirrored, with a warning. ghand's own files
//! must be correct; in files of trackers, unusable frames are skipped and counted in one warning. No frame has a number
//! that is not finite or that no hand can have ([`Pose::check_range`]).

pub mod formats;
pub(crate) mod reading;
mod time;
pub mod transfer;

use std::path::Path;

use ghand_capture::cameras::list::LensCamera;
use ghand_core::rotation::{axis_angle_from_rotation, rotation_from_axis_angle};
use ghand_core::{HandModel, Pose, Side};
use ghand_files::value::Value;
use glam::{DMat3, DQuat, DVec3};

use crate::PoseError;
use crate::image_landmarks::files::{is_table, surely_of_images};
use crate::rest_skeleton::RestSkeleton;
use formats::{ghand, ho3d, image_landmarks, landmarks, mano, plain, sam_3d_body, xr};
pub(crate) use reading::recording::{Motion, Recording};
pub(crate) use reading::source::{Skipped, Source};
use reading::{folder, known_layouts, refusal, sides, unreadable};
use time::gaps;
use time::timeline::Timeline;
pub use transfer::landmark_report::LandmarkFit;
use transfer::to_model::retargeted;
pub(crate) use transfer::to_model::{mano_rows, rows};
use transfer::{landmark_fit, plausibility};

/// Default rate, frames per second.
pub const DEFAULT_FPS: f64 = 30.0;

/// Most frames that a motion is resampled to: nine hours at 30 per second.
const MOST_FRAMES: usize = 1_000_000;

/// One moment.
#[derive(Debug, Clone, PartialEq)]
pub struct PoseFrame {
    /// Id of the frame.
    pub id: String,
    /// The pose, one rotation per joint.
    pub pose: Pose,
    /// Shape parameters of the hand model; empty for the mean shape, and for poses of another model.
    pub shape: Vec<f64>,
}

/// Poses at a constant rate.
#[derive(Debug, Clone, PartialEq)]
pub struct PoseSequence {
    /// Frames per second.
    pub fps: f64,
    /// Names of the joints, in the order of the rotations.
    pub joint_names: Vec<String>,
    /// At least one frame.
    pub frames: Vec<PoseFrame>,
    /// Remarks for the user, one sentence each.
    pub warnings: Vec<String>,
}

/// Information that a file does not contain.
#[derive(Debug, Clone, Default)]
pub struct PoseOptions {
    /// Which hand the poses are of: selects a hand from a file that has both, and overrides the file. By default the
    /// model's side is used if it exists, else the other one, mirrored.
    pub side: Option<Side>,
    /// The model that the poses are for: its rest skeleton and mean pose make the transfer to another skeleton exact.
    /// Without it, an average hand, rotated into MANO's axes, is used for MANO parameters. ghand's own poses of
    /// another skeleton need it if the file does not describe that skeleton.
    pub pose_model: Option<HandModel>,
    /// Read poses as measured from the flat hand: a MANO model's mean pose is not added.
    pub flat_mean: bool,
    /// Whether the rotations of a left hand's MANO parameters are a right hand's, those of the mirrored image. By default
    /// the file decides, and a remark says what is assumed.
    pub mirrored: Option<bool>,
    /// Which capture to take from a file that holds several.
    pub take: Option<String>,
    /// The rate of the file's frames, frames per second, instead of the one that it states.
    pub file_fps: Option<f64>,
    /// Whether single frames that jump are interpolated and the poses smoothed.
    pub smooth: bool,
    /// Whether frames are used by their ids and not as a film: what has no pose stays without one, and no rate is needed.
    pub by_id: bool,
    /// Ignore the rotation and the position of the whole hand.
    pub in_place: bool,
    /// The cameras of landmarks in images.
    pub cameras: Vec<LensCamera>,
}

/// Reads a file of poses for a hand model, or the folder of a capture or of an HO-3D sequence; see the module.
///
/// ```no_run
/// use ghand_core::Side;
/// use ghand_hand_model::builtin::builtin_hand;
/// use ghand_motion::{PoseOptions, read_poses};
///
/// let hand = builtin_hand(Side::Right)?;
/// let poses = read_poses("hamer.json".as_ref(), &hand, &PoseOptions::default())?;
/// println!("{} frames", poses.frames.len());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`PoseError`] names the file, the field and a remedy when the file's kind is not supported, when no frame is usable,
/// or when the names of the model's joints do not identify their parts and the poses are not for them.
pub fn read_poses(path: &Path, model: &HandModel, options: &PoseOptions) -> Result<PoseSequence, PoseError> {
    Ok(read_poses_and_fit(path, model, options)?.0)
}

/// Like [`read_poses`], with how well the hand fits if the file has landmarks.
///
/// # Errors
/// As in [`read_poses`].
pub fn read_poses_and_fit(
    path: &Path,
    model: &HandModel,
    options: &PoseOptions,
) -> Result<(PoseSequence, Option<LandmarkFit>), PoseError> {
    if let Some(found) = other_trackers(path, model, options) {
        return found;
    }
    let (path, value) = folder::read(path)?;
    poses_and_fit(&path.display().to_string(), &value, model, options)
}

/// Poses from landmarks in images that another tracker wrote, if there are cameras; `None` for files of other kinds.
fn other_trackers(
    path: &Path,
    model: &HandModel,
    options: &PoseOptions,
) -> Option<Result<(PoseSequence, Option<LandmarkFit>), PoseError>> {
    if options.cameras.is_empty() {
        let text =
            "is a table of landmarks in the pixels of images, which need their cameras; give them with --cameras";
        let origin = path.display().to_string();
        let refused = || PoseError::Invalid { origin, field: "content".into(), problem: text.into() };
        return is_table(path).then(|| Err(refused()));
    }
    let ids: Vec<String> = options.cameras.iter().map(|lens| lens.camera.id.clone()).collect();
    let side = options.side.unwrap_or(model.side);
    let found = surely_of_images(path, &ids, side)?;
    Some(found.and_then(|found| {
        let value = image_landmarks::to_value(&found.frames, found.fps, side, found.tip_inset);
        let (mut sequence, fit) = poses_and_fit(&path.display().to_string(), &value, model, options)?;
        sequence.warnings.splice(0..0, found.remarks);
        Ok((sequence, fit))
    }))
}

/// Reads the bytes of a file as [`read_poses`] does. `origin` is the file's name, for messages; it is opened again only
/// if it is a capture of another skeleton.
///
/// # Errors
/// As in [`read_poses`].
pub fn read_poses_bytes(
    origin: &str,
    bytes: &[u8],
    model: &HandModel,
    options: &PoseOptions,
) -> Result<PoseSequence, PoseError> {
    let value = Value::from_bytes(bytes).map_err(|source| PoseError::File { path: origin.into(), source })?;
    Ok(poses_and_fit(origin, &value, model, options)?.0)
}

/// Reads a file of this kind; `None` for another kind.
type Reader = fn(&Source, &Value) -> Option<Result<Recording, PoseError>>;

/// Makes poses for a hand model from the content of a file. `origin` is the file's name, as for [`read_poses_bytes`].
/// Landmarks come with how well a hand fits them.
///
/// # Errors
/// As in [`read_poses`].
pub fn poses_and_fit(
    origin: &str,
    value: &Value,
    model: &HandModel,
    options: &PoseOptions,
) -> Result<(PoseSequence, Option<LandmarkFit>), PoseError> {
    let wanted = options.side.unwrap_or(model.side);
    let take = options.take.as_deref();
    let pose_model = options.pose_model.as_ref();
    let source = Source { origin, wanted, take, joint_count: model.joint_count(), model, pose_model };
    let (Recording { side, usual_fps, motion, skipped, mut warnings }, mut timeline) = timed_recording(&source, value)?;
    warnings.extend(skipped.finish(&source, motion.len())?);
    // The frames of a capture are photographs, whose ids are names.
    let is_capture = matches!(&motion, Motion::Rows(rows) if rows.capture_kind.is_some());
    let is_film = !is_capture && !options.by_id;
    let side = plausibility::side(&motion, side, model.side, options, &mut warnings);
    plausibility::unused_options(&motion, mano::is_interhand(value), side, options, &mut warnings);
    let mut fit = None;
    let (frames, side) = match motion {
        Motion::Rows(found) => rows(&source, *found, model, options, &mut warnings)?,
        Motion::Mano(rows) => (mano_rows(rows, side, model, options, &mut warnings)?, side),
        Motion::WebXr { frames } => (retargeted(frames, RestSkeleton::webxr(side), &RestSkeleton::of(model)?), side),
        Motion::Landmarks { frames, tip_inset } => {
            plausibility::check_landmarks(&source, &frames, &mut warnings)?;
            let (frames, found) = landmark_fit::from_points(&source, &frames, tip_inset, side, model, &mut warnings)?;
            fit = Some(found);
            (frames, side)
        }
        Motion::ImageLandmarks { frames, tip_inset } => {
            let (frames, found) =
                landmark_fit::from_images(&source, &frames, tip_inset, side, model, options, &mut warnings)?;
            fit = Some(found);
            (frames, side)
        }
    };
    if side != model.side {
        warnings.push(format!("the poses are of a {side} hand, mirrored for this {} one", model.side));
    }
    if frames.is_empty() {
        return Err(source.invalid("frames", "there are none; give at least one".into()));
    }
    let fps = timeline.rate(&source, value, usual_fps, options.file_fps)?;
    if is_film {
        warnings.append(&mut timeline.warnings);
    }
    let has_rate = fps.is_some();
    let fps = fps.unwrap_or(DEFAULT_FPS);
    let mut frames = if is_film && !mano::is_interhand(value) {
        let (frames, remarks) = gaps::filled(frames, &skipped.ids, &timeline, fps);
        warnings.extend(remarks);
        frames
    } else {
        frames
    };
    if !has_rate && frames.len() > 1 && is_film {
        warnings.push(format!(
            "the file does not give its rate, and {DEFAULT_FPS} frames per second are assumed; --file-fps gives it"
        ));
    }
    if is_film {
        plausibility::check_jumps(&mut frames, fps, options.smooth, &mut warnings);
        plausibility::check_bend(&frames, model, &mut warnings);
    }
    if options.smooth {
        frames = crate::one_euro::smoothed(&frames, fps);
    }
    if model.shape_directions.is_empty() {
        frames.iter_mut().for_each(|frame| frame.shape.clear());
    }
    if options.in_place {
        for frame in &mut frames {
            frame.pose.translation = DVec3::ZERO;
            frame.pose.rotations.iter_mut().take(1).for_each(|root| *root = DVec3::ZERO);
        }
    }
    Ok((PoseSequence { fps, joint_names: model.joint_names.clone(), frames, warnings }, fit))
}

/// The content of a file with its usable frames, of which there is at least one.
pub(crate) fn recording(source: &Source, value: &Value) -> Result<Recording, PoseError> {
    timed_recording(source, value).map(|(recording, _)| recording)
}

/// The content of a file with the places of its frames, and what is unreadable in it.
fn timed_recording(source: &Source, value: &Value) -> Result<(Recording, Timeline), PoseError> {
    // The numbers of a data set's frames are names.
    let mut timeline = if mano::is_interhand(value) { Timeline::default() } else { Timeline::of(value) };
    let usable = |recording: Recording| {
        recording.skipped.finish(source, recording.motion.len())?;
        Ok(recording)
    };
    let recording = unreadable::said(value, readable(source, value, &mut timeline).and_then(usable))?;
    plausibility::checked(source, recording).map(|recording| (recording, timeline))
}

/// The content of a file, read by the first reader that recognises its kind.
fn readable(source: &Source, value: &Value, timeline: &mut Timeline) -> Result<Recording, PoseError> {
    let readers: [Reader; 7] =
        [sam_3d_body::read, xr::read, image_landmarks::read, landmarks::read, mano::read, ho3d::read, plain::read];
    let trackers = |source: &Source, value: &Value| readers.iter().find_map(|read| read(source, value));
    let refused = |value: &Value| Err(source.invalid("content", refusal::problem(source, value)));
    if let Some(recording) = trackers(source, value) {
        return recording;
    }
    if let Some(sides::OneHand { side, value: hand, warning }) = sides::one_hand(value, source.wanted) {
        let source = Source { wanted: side, ..*source };
        let found = trackers(&source, &hand).or_else(|| ghand::read(&source, &hand));
        let mut recording = found.unwrap_or_else(|| refused(&hand))?;
        recording.side = recording.side.or(Some(side));
        if let Motion::Rows(rows) = &mut recording.motion {
            rows.side = rows.side.or(Some(side));
        }
        recording.warnings.extend(warning);
        if timeline.places.is_empty() {
            *timeline = Timeline::of(&hand);
        }
        return Ok(recording);
    }
    if let Some(problem) = known_layouts::problem(value) {
        return Err(source.invalid("content", problem.into()));
    }
    ghand::read(source, value).unwrap_or_else(|| refused(value))
}

impl PoseSequence {
    /// Length in seconds, from the first frame to the last.
    pub fn duration(&self) -> f64 {
        self.frames.len().saturating_sub(1) as f64 / self.fps
    }

    /// The pose at a time in seconds. Between two frames each joint takes the shortest rotation; before the first frame
    /// and after the last, their poses apply.
    pub fn pose_at(&self, seconds: f64) -> Option<Pose> {
        let last = self.frames.len().checked_sub(1)?;
        let place = (seconds * self.fps).clamp(0.0, last as f64);
        let place = if place.is_nan() { 0.0 } else { place };
        let before = place.floor() as usize;
        let part = place.fract();
        let first = self.frames.get(before)?;
        match self.frames.get(before + 1) {
            Some(second) if part > 0.0 => Some(between(&first.pose, &second.pose, part)),
            _ => Some(first.pose.clone()),
        }
    }

    /// The same motion at another rate. Ids are renumbered; shapes are those of the previous frame.
    ///
    /// # Errors
    /// [`PoseError::Invalid`] if that would be more than a million frames.
    pub fn resampled(&self, fps: f64) -> Result<PoseSequence, PoseError> {
        let last = (self.duration() * fps + 1e-9).floor();
        let fits = last < MOST_FRAMES as f64;
        if !fits {
            return Err(PoseError::Invalid {
                origin: "resampling".into(),
                field: "fps".into(),
                problem: format!(
                    "{} s at {fps} frames per second are more than {MOST_FRAMES} frames; give a lower rate, or a part \
                     of the motion",
                    self.duration()
                ),
            });
        }
        let frame = |k: usize| {
            let seconds = k as f64 / fps;
            let before = ((seconds * self.fps).floor() as usize).min(self.frames.len().saturating_sub(1));
            let shape = self.frames.get(before).map(|frame| frame.shape.clone()).unwrap_or_default();
            Some(PoseFrame { id: format!("{k:04}"), pose: self.pose_at(seconds)?, shape })
        };
        Ok(PoseSequence { fps, frames: (0..last as usize + 1).filter_map(frame).collect(), ..self.clone() })
    }
}

/// Interpolates two poses: each joint rotates about one axis, by the shorter rotation.
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

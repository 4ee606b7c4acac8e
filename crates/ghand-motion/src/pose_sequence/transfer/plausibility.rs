//! Checks what nobody would notice: degrees for radians, the other side, fingers that bend backwards, frames that jump.

use std::f64::consts::{PI, TAU};

use ghand_core::pose::LARGEST_ANGLE;
use ghand_core::rotation::rotation_from_axis_angle;
use ghand_core::{HandModel, Pose, Side};
use glam::{DQuat, DVec3};

use super::proportions;
use crate::ik::HandIk;
use crate::pose_sequence::reading::recording::{LandmarkFrame, LeftRotations};
use crate::pose_sequence::{Motion, PoseError, PoseFrame, PoseOptions, Recording, Source, between};
use crate::rest_skeleton::RestSkeleton;

/// Part of all rotations that may be longer than a turn: a tracker's optimiser may have gone round once.
const LONG_ROTATIONS: f64 = 0.1;
/// Part of the rotations of a hand's joints that may be longer than half a turn.
const WIDE_ROTATIONS: f64 = 0.3;
/// Bend of a finger, all joints together, below which it bends backwards, radians: a hand that is pressed reaches -0.5.
const BACKWARDS: f64 = -0.7;
/// A frame that jumps differs from the middle of its neighbours by at least this, radians and metres, ...
const LEAST_JUMP: (f64, f64) = (0.44, 0.05);
/// ... this many times as much as the neighbours do, and this many times as much as frames usually do.
const JUMP_TO_NEIGHBOURS: f64 = 2.5;
const JUMP_TO_USUAL: f64 = 8.0;
/// At lower rates a hand may well be elsewhere for one frame.
const LEAST_RATE: f64 = 15.0;

/// The content of a file, if its rotations can be radians.
pub(crate) fn checked(source: &Source, recording: Recording) -> Result<Recording, PoseError> {
    let frames = match &recording.motion {
        Motion::Mano(rows) => &rows.frames,
        Motion::Rows(rows) => &rows.frames,
        _ => return Ok(recording),
    };
    // What is out of range is named by frame and joint elsewhere.
    let lengths = |first: usize| {
        let turns = frames.iter().flat_map(move |frame| frame.pose.rotations.iter().skip(first));
        turns.map(|turn| turn.length()).filter(|length| *length <= LARGEST_ANGLE)
    };
    // The whole hand may be turned by any angle.
    let part = |first: usize, least: f64| {
        let moving = lengths(first).filter(|length| *length > 1e-6).count();
        lengths(first).filter(|length| *length > least).count() as f64 / moving.max(1) as f64
    };
    if part(0, TAU) <= LONG_ROTATIONS && part(1, PI) <= WIDE_ROTATIONS {
        return Ok(recording);
    }
    let largest = lengths(0).fold(0.0, f64::max);
    let problem = format!(
        "has rotations of up to {largest:.1}, {:.0} % of those of joints of more than half a turn; are they degrees? give \
         axis-angle rotations in radians (numpy.deg2rad)",
        100.0 * part(1, PI)
    );
    Err(source.invalid("rotations", problem))
}

/// Rejects landmarks that are not metres, and says if they are hardly a hand.
pub(crate) fn check_landmarks(
    source: &Source,
    frames: &[LandmarkFrame],
    warnings: &mut Vec<String>,
) -> Result<(), PoseError> {
    let points: Vec<_> = frames.iter().map(|frame| frame.points).collect();
    if !proportions::is_hand(&points) {
        warnings.push("the landmarks do not have a hand's proportions; see how far the hand is from them".into());
    }
    match proportions::unit_problem(&points) {
        Some(problem) => Err(source.invalid("landmarks", problem)),
        None => Ok(()),
    }
}

/// Which hand the poses are of: what the user says, else what landmarks show, else what the file says, else the model's.
pub(crate) fn side(
    motion: &Motion,
    stated: Option<Side>,
    of_model: Side,
    options: &PoseOptions,
    warnings: &mut Vec<String>,
) -> Side {
    let seen = match motion {
        Motion::Landmarks { frames, .. } => {
            let points: Vec<_> = frames.iter().map(|frame| frame.points).collect();
            proportions::is_hand(&points).then(|| proportions::side_by_bend(points.iter())).flatten()
        }
        _ => None,
    };
    if let Some(given) = options.side {
        if let Some(seen) = seen.filter(|seen| *seen != given) {
            warnings.push(format!(
                "the fingers of the landmarks bend as a {seen} hand's, but are read as a {given} one's, as --side says"
            ));
        }
        return given;
    }
    match (seen, stated) {
        (Some(seen), Some(stated)) if seen != stated => {
            warnings.push(format!(
                "the file says that the hand is a {stated} one, but its fingers bend as a {seen} hand's, and it is read as \
                 one; --side {stated} overrides this"
            ));
            seen
        }
        (Some(seen), _) => seen,
        (None, Some(stated)) => stated,
        (None, None) => {
            if let Motion::Mano(_) | Motion::WebXr { .. } | Motion::Landmarks { .. } | Motion::ImageLandmarks { .. } =
                motion
            {
                warnings.push(format!(
                    "the file does not say which hand it is; it is read as a {of_model} one, as the model; --side overrides this"
                ));
            }
            of_model
        }
    }
}

/// Says which of the user's options a file has no use for.
pub(crate) fn unused_options(
    motion: &Motion,
    is_interhand: bool,
    side: Side,
    options: &PoseOptions,
    warnings: &mut Vec<String>,
) {
    let is_mano = matches!(motion, Motion::Mano(_));
    let has_rotations = is_mano || matches!(motion, Motion::Rows(_));
    let is_image = matches!(motion, Motion::ImageLandmarks { .. });
    for (option, is_given, is_used, why) in [
        ("--take", options.take.is_some(), is_interhand, "it does not hold captures by name"),
        ("--cameras", !options.cameras.is_empty(), is_image, "it has no landmarks in images"),
        ("--pose-model", options.pose_model.is_some(), has_rotations, "it has no rotations of another model's joints"),
        ("--flat-mean", options.flat_mean, has_rotations, "it has no rotations from a mean pose"),
        (
            "--mirrored",
            options.mirrored.is_some(),
            is_mano && side == Side::Left,
            "it has no MANO rotations of a left hand",
        ),
    ] {
        if is_given && !is_used {
            warnings.push(format!("{option} is not used for this file: {why}"));
        }
    }
}

/// Whether a left hand's rotations are a right hand's, with a remark about what is assumed.
pub(crate) fn is_mirrored(left: LeftRotations, given: Option<bool>, warnings: &mut Vec<String>) -> bool {
    if let Some(given) = given {
        return given;
    }
    match left {
        LeftRotations::Own => false,
        LeftRotations::Mirrored => true,
        LeftRotations::Assumed => {
            warnings.push(
                "the rotations are taken as those of MANO's left model; if they are a right hand's in the mirrored image, as \
                 HaMeR and WiLoR give them, add --mirrored yes"
                    .into(),
            );
            false
        }
        LeftRotations::AssumedMirrored => {
            warnings.push(
                "the left hand's rotations are taken as a right hand's in the mirrored image, as HaMeR and WiLoR give them; if \
                 they are those of MANO's left model, add --mirrored no"
                    .into(),
            );
            true
        }
    }
}

/// Says if the fingers bend backwards in the mean, which hands cannot.
pub(crate) fn check_bend(frames: &[PoseFrame], model: &HandModel, warnings: &mut Vec<String>) {
    let Ok(skeleton) = RestSkeleton::of(model) else { return };
    let hand = HandIk::new(&skeleton);
    let sign = if skeleton.side == Side::Right { 1.0 } else { -1.0 };
    let bends = frames.iter().map(|frame| sign * proportions::right_bend(&hand.landmarks(&frame.pose)));
    let mean = bends.sum::<f64>() / frames.len().max(1) as f64;
    if mean < BACKWARDS {
        warnings.push(format!(
            "the fingers bend backwards by {:.0} degrees in the mean, which hands cannot: is it the other hand (--side), or are \
             its rotations mirrored (--mirrored)?",
            -mean.to_degrees()
        ));
    }
}

/// Finds single frames that jump and come back: interpolates them if asked, else says so.
pub(crate) fn check_jumps(frames: &mut [PoseFrame], fps: f64, mend: bool, warnings: &mut Vec<String>) {
    let jumps = if fps >= LEAST_RATE { jumps(frames) } else { vec![] };
    let Some(first) = jumps.first().and_then(|k| frames.get(*k)) else { return };
    let (are, frames_named) = if jumps.len() == 1 { ("is", "frame") } else { ("are", "frames") };
    let what = format!(
        "{} {frames_named} jump{} away for one frame, first {:?}",
        jumps.len(),
        if jumps.len() == 1 { "s" } else { "" },
        first.id
    );
    if !mend {
        warnings.push(format!("{what}; --smooth interpolates such frames"));
        return;
    }
    warnings.push(format!("{what}, and {are} interpolated"));
    for k in jumps {
        frames[k].pose = between(&frames[k - 1].pose, &frames[k + 1].pose, 0.5);
    }
}

fn jumps(frames: &[PoseFrame]) -> Vec<usize> {
    let jump = |three: &[PoseFrame]| {
        let [before, here, after] = [0, 1, 2].map(|k| &three[k].pose);
        let middle = between(before, after, 0.5);
        [distance(here, &middle), distance(before, after)]
    };
    let found: Vec<[[f64; 2]; 2]> = frames.windows(3).map(jump).collect();
    let usual = [0, 1].map(|kind| {
        let mut all: Vec<f64> = found.iter().map(|[off, _]| off[kind]).collect();
        all.sort_by(f64::total_cmp);
        all.get(all.len() / 2).copied().unwrap_or(0.0)
    });
    let least = [LEAST_JUMP.0, LEAST_JUMP.1];
    let is_jump = |[off, apart]: &[[f64; 2]; 2]| {
        (0..2)
            .any(|kind| off[kind] > least[kind].max(JUMP_TO_NEIGHBOURS * apart[kind]).max(JUMP_TO_USUAL * usual[kind]))
    };
    (0..found.len()).filter(|k| is_jump(&found[*k])).map(|k| k + 1).collect()
}

/// The largest angle between the rotations of two poses, radians, and the distance of their translations, metres.
fn distance(a: &Pose, b: &Pose) -> [f64; 2] {
    let turn = |v: &DVec3| DQuat::from_mat3(&rotation_from_axis_angle(*v));
    let angles = a.rotations.iter().zip(&b.rotations).map(|(a, b)| turn(a).angle_between(turn(b)));
    [angles.fold(0.0, f64::max), a.translation.distance(b.translation)]
}

//! Compares the frames of joints with their positions, and falls back on the positions.
//!
//! Engines have other axes, other orders of a quaternion, left-handed worlds, and joints without frames; nothing in a
//! file says so, but its positions do.

use ghand_core::rotation::axis_angle_from_rotation;
use ghand_core::{Pose, Side};
use glam::{DMat3, DVec3};

use super::Joint;
use crate::ik::LANDMARK_COUNT;
use crate::pose_sequence::reading::recording::LandmarkFrame;
use crate::pose_sequence::transfer::proportions::{XR_ORDER, back_of_hand, is_hand, side_by_bend, unit_problem};
use crate::pose_sequence::{Motion, PoseError, PoseFrame, Recording, Skipped, Source};
use crate::rest_skeleton::RestSkeleton;

/// The median angle between -Z of a joint and the direction to the next one may be this, degrees: trackers and skeletons
/// place joints a little beside the bones' axes.
const LARGEST_ANGLE: f64 = 35.0;
/// Mean cosine between +Y of the palm's joints and the direction out of the back of the hand.
const LEAST_BACK: f64 = 0.3;
/// Joints of the palm: the wrist and the metacarpals of four fingers.
const PALM: [usize; 5] = [0, 5, 10, 15, 20];
/// Joints nearer to each other than this are at one point, metres.
const ONE_POINT: f64 = 1e-5;

/// The 25 joints of a frame.
pub(super) struct XrFrame {
    pub id: String,
    pub joints: Vec<Joint>,
}

impl XrFrame {
    /// The frame of a world whose z axis points the other way, as it is in XR's.
    fn turned_from_left_handed(&self) -> XrFrame {
        let flip = DMat3::from_diagonal(DVec3::new(1.0, 1.0, -1.0));
        let joint = |joint: &Joint| Joint {
            position: flip * joint.position,
            orientation: joint.orientation.clone().map(|turn| flip * turn * flip),
        };
        XrFrame { id: self.id.clone(), joints: self.joints.iter().map(joint).collect() }
    }

    fn points(&self) -> [DVec3; LANDMARK_COUNT] {
        XR_ORDER.map(|k| self.joints.get(k).map_or(DVec3::ZERO, |joint| joint.position))
    }

    /// Whether positions are missing: all joints are at one point.
    fn is_at_one_point(&self) -> bool {
        let points = self.points();
        points.iter().all(|point| point.distance(points[0]) < ONE_POINT)
    }

    /// Whether only some joints have positions: two of a hand's landmarks are at one point.
    fn is_partly_tracked(&self) -> bool {
        let points = self.points();
        let is_double = |k: usize| points[..k].iter().any(|other| other.distance(points[k]) < ONE_POINT);
        !self.is_at_one_point() && (1..points.len()).filter(|k| is_double(*k)).count() > 1
    }

    /// The frames of all joints; the problem of the first that has none.
    fn orientations(&self) -> Result<Vec<DMat3>, String> {
        let names = &RestSkeleton::webxr(Side::Right).joint_names;
        let turn = |(joint, name): (&Joint, &String)| {
            joint.orientation.clone().map_err(|problem| format!("joint {name:?}: {problem}"))
        };
        self.joints.iter().zip(names).map(turn).collect()
    }

    /// Whether the frames of the joints of a hand of this side have XR's axes, by the positions.
    fn has_axes(&self, side: Side) -> bool {
        let Ok(turns) = self.orientations() else { return false };
        let skeleton = RestSkeleton::webxr(side);
        let mut angles: Vec<f64> = skeleton
            .parents
            .iter()
            .enumerate()
            .filter_map(|(k, parent)| Some((k, (*parent)?)))
            .filter(|(_, parent)| *parent > 0)
            .filter_map(|(k, parent)| {
                let bone = self.joints.get(k)?.position - self.joints.get(parent)?.position;
                Some((turns.get(parent)? * DVec3::NEG_Z).angle_between(bone.try_normalize()?).to_degrees())
            })
            .collect();
        angles.sort_by(f64::total_cmp);
        let is_along = angles.get(angles.len() / 2).is_none_or(|angle| *angle <= LARGEST_ANGLE);
        let back = back_of_hand(&self.points(), side);
        let up = |back: DVec3| {
            PALM.iter().filter_map(|k| turns.get(*k)).map(|turn| turn.y_axis.dot(back)).sum::<f64>() / PALM.len() as f64
        };
        is_along && back.is_none_or(|back| up(back) >= LEAST_BACK)
    }

    /// Rotations of each joint in the frame of its parent.
    fn pose(&self, side: Side) -> Result<Pose, String> {
        let turns = self.orientations()?;
        let rotation = |(k, parent): (usize, &Option<usize>)| {
            let above = parent.map_or(Some(DMat3::IDENTITY), |parent| turns.get(parent).copied())?;
            Some(axis_angle_from_rotation(&(above.transpose() * *turns.get(k)?)))
        };
        let parents = &RestSkeleton::webxr(side).parents;
        let rotations: Option<Vec<DVec3>> = parents.iter().enumerate().map(rotation).collect();
        match (rotations, self.joints.first()) {
            (Some(rotations), Some(wrist)) => Ok(Pose { rotations, translation: wrist.position }),
            _ => Err("lacks joints".into()),
        }
    }
}

/// The motion of joints in space, by their frames if these are XR's, else by their positions.
pub(super) fn recording(
    source: &Source,
    frames: Vec<XrFrame>,
    side: Option<Side>,
    mut skipped: Skipped,
) -> Result<Recording, PoseError> {
    let mut warnings = vec![];
    let (frames, partly): (Vec<XrFrame>, Vec<XrFrame>) =
        frames.into_iter().partition(|frame| !frame.is_partly_tracked());
    for frame in partly {
        let problem = frame.orientations().err();
        skipped.add(&frame.id, problem.unwrap_or_else(|| "has joints at one point, which were not tracked".into()));
    }
    let points: Vec<[DVec3; LANDMARK_COUNT]> = frames.iter().map(XrFrame::points).collect();
    // Positions that are not a hand's say nothing about its frames.
    let is_hand = !points.is_empty() && is_hand(&points);
    if !is_hand && frames.iter().any(|frame| !frame.is_at_one_point()) {
        warnings
            .push("the joints' positions do not have a hand's proportions; only their orientations are used".into());
    }
    let problem = if is_hand { unit_problem(&points) } else { None };
    if let Some(problem) = problem {
        return Err(source.invalid("positions", problem));
    }
    let bent = if is_hand { side_by_bend(points.iter()) } else { None };
    let is_usable =
        |frame: &XrFrame, side: Side| if is_hand { frame.has_axes(side) } else { frame.orientations().is_ok() };
    let most_have_axes = |frames: &[XrFrame], side: Side| {
        2 * frames.iter().filter(|frame| is_usable(frame, side)).count() >= frames.len().max(1)
    };
    let assumed = side.or(bent).unwrap_or(source.wanted);
    // Of an unknown side, the frames may show the other one.
    let other = side.is_none().then(|| assumed.other());
    let candidates = [Some(assumed), bent, other];
    let mut by_frames = candidates.into_iter().flatten().find(|side| most_have_axes(&frames, *side));
    let mut frames = frames;
    if by_frames.is_none() && is_hand {
        let flipped: Vec<XrFrame> = frames.iter().map(XrFrame::turned_from_left_handed).collect();
        if most_have_axes(&flipped, assumed) {
            warnings.push("the joints are those of a left-handed world, such as Unity's; z is turned round".into());
            (frames, by_frames) = (flipped, Some(assumed));
        }
    }
    if let Some(found) = by_frames {
        if side.is_some_and(|side| side != found) {
            warnings.push(format!(
                "the file says that the hand is a {assumed} one, but its joints are a {found} hand's and are read so"
            ));
        }
        let mut posed = vec![];
        for frame in &frames {
            match frame.pose(found) {
                Ok(pose) => posed.push(PoseFrame { id: frame.id.clone(), pose, shape: vec![] }),
                Err(problem) => skipped.add(&frame.id, problem),
            }
        }
        let motion = Motion::WebXr { frames: posed };
        // A side that nobody gave stays open, unless the positions decide it.
        let side = if is_hand { Some(found) } else { side.map(|_| found) };
        return Ok(Recording { side, usual_fps: None, motion, skipped, warnings });
    }
    if !is_hand {
        for frame in &frames {
            skipped.add(&frame.id, frame.orientations().err().unwrap_or_default());
        }
        let motion = Motion::WebXr { frames: vec![] };
        return Ok(Recording { side, usual_fps: None, motion, skipped, warnings });
    }
    let cause = frames.iter().find_map(|frame| frame.orientations().err());
    let cause =
        cause.unwrap_or_else(|| "they do not have -Z along the bones and +Y out of the back of the hand".into());
    warnings.push(format!("the joints' orientations are not used ({cause}); the hand is fitted to their positions"));
    let is_mirrored = side.is_some_and(|side| bent.is_some_and(|bent| bent != side));
    if is_mirrored {
        warnings.push(format!(
            "the positions are the mirror image of a {assumed} hand, as in a left-handed world such as Unity's, and are mirrored"
        ));
    }
    let flip = if is_mirrored { DVec3::new(1.0, 1.0, -1.0) } else { DVec3::ONE };
    let landmarks = frames.iter().zip(&points);
    let landmarks =
        landmarks.map(|(frame, points)| LandmarkFrame { id: frame.id.clone(), points: points.map(|at| at * flip) });
    let motion = Motion::Landmarks { frames: landmarks.collect(), tip_inset: 0.0 };
    Ok(Recording { side: side.or(bent), usual_fps: None, motion, skipped, warnings })
}

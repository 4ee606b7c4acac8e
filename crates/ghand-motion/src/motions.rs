//! Named motions for any hand whose joint names identify the fingers.
//!
//! A motion is a sequence of named poses ([`named_pose`]) with the times at which they are reached, and rotations of
//! the whole hand. Between two poses a joint rotates about one axis, with zero speed at both ends. A thumb that lies on
//! folded fingers ([`THUMB_ON_FINGERS`]) leaves them before they move, and comes back last.

use ghand_core::rotation::{axis_angle_from_rotation, rotation_from_axis_angle};
use ghand_core::{HandModel, Pose};
use ghand_hand_model::joints::names::{Finger, JointRole, finger_joints};
use ghand_hand_model::named_poses::named_pose;
use glam::DVec3;

use crate::PoseError;
use crate::pose_sequence::{PoseFrame, PoseSequence, between};
use crate::rest_skeleton::RestSkeleton;

/// Names that [`motion`] knows.
pub const MOTION_NAMES: [&str; 7] = ["grasp", "pinching", "pointing", "count", "wave", "ripple", "tour"];

/// Poses in which the thumb holds folded fingers.
const THUMB_ON_FINGERS: [&str; 4] = ["fist", "point", "victory", "three"];
/// The part of a transition in which the fingers move while the thumb leaves them in its first half and comes back in
/// its second.
const FINGERS_MOVE: [f64; 2] = [0.25, 0.75];
/// The part of its way in which the thumb's base rests on the fingers' side while the joints beyond it move: they lift
/// off the fingers first and close last, instead of being dragged through them.
const BASE_STAYS: f64 = 0.3;
/// How far the fingers of a ripple close, as a part of the way from open to a fist: there they rub along one another.
const RIPPLE_CLOSES: f64 = 0.94;

/// A pose that is reached and then held.
struct Key {
    pose: Pose,
    /// Whether the thumb holds folded fingers.
    thumb_on_fingers: bool,
    /// Duration of the transition to it, and of holding it, seconds.
    way: f64,
    hold: f64,
}

/// The motion of that name at this many frames per second. It ends in its first pose, so that it can be repeated.
/// `None` if the name is not in [`MOTION_NAMES`].
///
/// # Errors
/// [`PoseError::Invalid`] if the names of the model's joints do not identify their parts.
pub fn motion(name: &str, model: &HandModel, fps: f64) -> Option<Result<PoseSequence, PoseError>> {
    MOTION_NAMES.contains(&name).then(|| {
        let keys = keys(name, model)?;
        let frames = frames(&keys, &Thumb::of(model), fps);
        Ok(PoseSequence { fps, joint_names: model.joint_names.clone(), frames, warnings: vec![] })
    })
}

fn keys(name: &str, model: &HandModel) -> Result<Vec<Key>, PoseError> {
    let rig = RestSkeleton::of(model)?;
    let pose = |name: &str| named_pose(name, model).unwrap_or_else(|| Pose::rest(model.joint_count()));
    let on_fingers = |name: &str| THUMB_ON_FINGERS.contains(&name);
    let key = |name: &str, way: f64, hold: f64| Key { pose: pose(name), thumb_on_fingers: on_fingers(name), way, hold };
    let [forward, back, across] = rig.palm().unwrap_or([DVec3::NEG_Y, DVec3::X, DVec3::Z]);
    // Rotations of the whole hand about its own axes at rest.
    let turned = |name: &str, axis: DVec3, degrees: f64, way: f64, hold: f64| {
        let mut pose = pose(name);
        if let Some(root) = pose.rotations.first_mut() {
            let turn = rotation_from_axis_angle(axis * degrees.to_radians()) * rotation_from_axis_angle(*root);
            *root = axis_angle_from_rotation(&turn);
        }
        Key { pose, thumb_on_fingers: on_fingers(name), way, hold }
    };
    Ok(match name {
        "grasp" => vec![key("open", 0.0, 0.3), key("fist", 0.7, 0.5), key("open", 0.6, 0.2)],
        "pinching" => vec![
            key("relaxed", 0.0, 0.2),
            key("pinch", 0.5, 0.25),
            key("relaxed", 0.4, 0.15),
            key("pinch", 0.45, 0.25),
            key("relaxed", 0.5, 0.1),
        ],
        "pointing" => vec![
            key("relaxed", 0.0, 0.2),
            key("point", 0.6, 0.3),
            turned("point", back, 14.0, 0.3, 0.0),
            turned("point", back, -14.0, 0.4, 0.0),
            turned("point", across, 10.0, 0.35, 0.1),
            key("relaxed", 0.6, 0.1),
        ],
        "count" => vec![
            key("fist", 0.0, 0.4),
            key("point", 0.35, 0.45),
            key("victory", 0.35, 0.45),
            key("three", 0.35, 0.45),
            key("four", 0.35, 0.45),
            key("spread", 0.35, 0.6),
            key("fist", 0.6, 0.1),
        ],
        "wave" => vec![
            key("open", 0.0, 0.1),
            turned("open", back, 20.0, 0.3, 0.0),
            turned("open", back, -20.0, 0.4, 0.0),
            turned("open", back, 20.0, 0.4, 0.0),
            turned("open", back, -20.0, 0.4, 0.0),
            key("open", 0.3, 0.1),
        ],
        "ripple" => {
            let open = pose("open");
            ripple(&rig, &open, &between(&open, &pose("fist"), RIPPLE_CLOSES))
        }
        _ => vec![
            key("rest", 0.0, 0.2),
            key("open", 0.5, 0.3),
            key("fist", 0.7, 0.3),
            key("thumbs-up", 0.5, 0.4),
            key("point", 0.6, 0.3),
            key("victory", 0.5, 0.4),
            key("ok", 0.6, 0.4),
            key("pinch", 0.5, 0.3),
            turned("relaxed", forward, 35.0, 0.6, 0.0),
            turned("relaxed", forward, -35.0, 0.8, 0.0),
            key("rest", 0.6, 0.1),
        ],
    })
}

/// Fingers close one after the other, little finger first, and open in the same order.
fn ripple(rig: &RestSkeleton, open: &Pose, closed: &Pose) -> Vec<Key> {
    let order = [Finger::Little, Finger::Ring, Finger::Middle, Finger::Index];
    let mut keys = vec![Key { pose: open.clone(), thumb_on_fingers: false, way: 0.0, hold: 0.1 }];
    let mut pose = open.clone();
    for target in [closed, open] {
        for finger in order {
            for joint in (1..=3).filter_map(|k| rig.joint(JointRole::Bend(finger, k))) {
                if let (Some(rotation), Some(to)) = (pose.rotations.get_mut(joint), target.rotations.get(joint)) {
                    *rotation = *to;
                }
            }
            keys.push(Key { pose: pose.clone(), thumb_on_fingers: false, way: 0.22, hold: 0.0 });
        }
        keys.iter_mut().last().into_iter().for_each(|key| key.hold = 0.15);
    }
    keys
}

/// A thumb away from the fingers.
struct Thumb {
    joints: Vec<usize>,
    lifted: Pose,
}

impl Thumb {
    fn of(model: &HandModel) -> Thumb {
        Thumb {
            joints: finger_joints(Finger::Thumb, model).map_or(vec![], Vec::from),
            lifted: named_pose("open", model).unwrap_or_else(|| Pose::rest(model.joint_count())),
        }
    }

    /// The pose at a part of the way from one key to the next.
    fn between(&self, from: &Key, to: &Key, part: f64) -> Pose {
        let stays = self.joints.iter().all(|k| from.pose.rotations.get(*k) == to.pose.rotations.get(*k));
        if stays || !(from.thumb_on_fingers || to.thumb_on_fingers) {
            return between(&from.pose, &to.pose, eased(part));
        }
        let [start, end] = FINGERS_MOVE;
        let mut pose = between(&from.pose, &to.pose, eased((part - start) / (end - start)));
        let thumb = |base: bool| {
            let stays = if base { BASE_STAYS } else { 0.0 };
            if part < 0.5 {
                between(&from.pose, &self.lifted, eased((2.0 * part - stays) / (1.0 - stays)))
            } else {
                between(&self.lifted, &to.pose, eased((2.0 * part - 1.0) / (1.0 - stays)))
            }
        };
        let base = thumb(true);
        let others = thumb(false);
        for (nth, k) in self.joints.iter().enumerate() {
            let thumb = if nth == 0 { &base } else { &others };
            if let (Some(rotation), Some(own)) = (pose.rotations.get_mut(*k), thumb.rotations.get(*k)) {
                *rotation = *own;
            }
        }
        pose
    }
}

fn frames(keys: &[Key], thumb: &Thumb, fps: f64) -> Vec<PoseFrame> {
    let duration: f64 = keys.iter().map(|key| key.way + key.hold).sum();
    let count = (duration * fps + 1e-9).floor() as usize + 1;
    let at = |seconds: f64| {
        let mut start = 0.0;
        let mut before: Option<&Key> = None;
        for key in keys {
            let arrived = start + key.way;
            let left = start + key.way + key.hold;
            if let Some(before) = before.filter(|_| seconds < arrived) {
                return Some(thumb.between(before, key, (seconds - start) / key.way));
            }
            if seconds <= left {
                return Some(key.pose.clone());
            }
            (start, before) = (left, Some(key));
        }
        before.map(|key| key.pose.clone())
    };
    let frame = |k: usize| Some(PoseFrame { id: format!("{k:04}"), pose: at(k as f64 / fps)?, shape: vec![] });
    (0..count).filter_map(frame).collect()
}

/// From 0 to 1 with no speed and no acceleration at either end.
fn eased(part: f64) -> f64 {
    let t = part.clamp(0.0, 1.0);
    t * t * t * (10.0 + t * (6.0 * t - 15.0))
}

#[cfg(test)]
mod self_penetration_tests;
#[cfg(test)]
mod tests;

//! A skeleton with a frame on each bone that is defined in the same way on every skeleton.
//!
//! A bone's frame is OpenXR's: -Z along the bone towards the fingertip, +Y out of the back of the hand (of the thumb:
//! out of its nail), +X to the right of both. On the wrist, -Z points to the knuckle of the middle finger. For a
//! skeleton known only by its rest pose, the frames come from the rest positions of the joints. WebXR and OpenXR give
//! joints by their frames in space, so that all their rest frames are the identity.

use ghand_core::{HandModel, Side};
use ghand_hand_model::joint_names::{Finger, JointRole};
use glam::{DMat3, DVec3};

use crate::PoseError;

/// How much the thumb's nail faces the back of the hand: its hinges bend across the palm and, a little, into it.
const THUMB_TOWARDS_BACK: f64 = 0.45;

/// A skeleton at rest, with frames.
#[derive(Debug, Clone, PartialEq)]
pub struct RestSkeleton {
    /// Name for messages.
    pub name: String,
    /// Which hand it is.
    pub side: Side,
    /// Names of the `n_b` joints; joint 0 is the wrist.
    pub joint_names: Vec<String>,
    /// Roles of the joints, if their names identify them, `n_b`.
    pub roles: Vec<Option<JointRole>>,
    /// Parent of each joint, which precedes it.
    pub parents: Vec<Option<usize>>,
    /// Rest positions, metres, axes of the skeleton, `n_b`.
    pub joints: Vec<DVec3>,
    /// Rest frames: rotations from the bone's axes to the axes of the skeleton, `n_b`; the identity if no role is
    /// known.
    pub frames: Vec<DMat3>,
    /// The same with the frame of a hinge for the thumb: its joints bend about X.
    pub hinges: Vec<DMat3>,
    /// Rest positions of the fingertips, thumb to little finger, metres.
    pub tips: [DVec3; 5],
}

impl RestSkeleton {
    /// The skeleton of a hand model.
    ///
    /// # Errors
    /// [`PoseError::Invalid`] if the names of its joints do not identify three joints for each finger, or if joints of
    /// a finger are at one point.
    pub fn of(model: &HandModel) -> Result<RestSkeleton, PoseError> {
        let roles = JointRole::of_joints(&model.joint_names);
        let tips = Finger::ALL.map(|finger| tip(model, &roles, finger).unwrap_or(DVec3::NAN));
        RestSkeleton::from_rest_pose(&model.name, model.side, &model.joint_names, &model.parents, &model.joints, tips)
    }

    /// The skeleton of joints with names, parents that precede them, and rest positions in metres, `n_b` each; `tips`
    /// are the fingertips at rest, thumb to little finger.
    ///
    /// # Errors
    /// As in [`RestSkeleton::of`].
    pub fn from_rest_pose(
        name: &str,
        side: Side,
        joint_names: &[String],
        parents: &[Option<usize>],
        joints: &[DVec3],
        tips: [DVec3; 5],
    ) -> Result<RestSkeleton, PoseError> {
        let rig = RestSkeleton {
            name: name.into(),
            side,
            joint_names: joint_names.to_vec(),
            roles: JointRole::of_joints(joint_names),
            parents: parents.to_vec(),
            joints: joints.to_vec(),
            frames: vec![],
            hinges: vec![],
            tips,
        };
        let [frames, hinges] = [0.0, THUMB_TOWARDS_BACK].map(|towards_back| rig.rest_frames(towards_back));
        let usable = |frames: &Option<Vec<DMat3>>| frames.as_ref().is_some_and(|f| f.iter().all(|f| f.is_finite()));
        match (frames, hinges) {
            (frames, Some(hinges)) if usable(&frames) => {
                Ok(RestSkeleton { frames: frames.unwrap_or_default(), hinges, ..rig })
            }
            _ => Err(PoseError::Invalid {
                origin: name.into(),
                field: "joints".into(),
                problem: format!(
                    "their names do not identify the three joints of each finger, or they are at one point ({}); use \
                     MANO's or WebXR's names",
                    joint_names.join(", ")
                ),
            }),
        }
    }

    /// The 25 joints of WebXR. Only their frames in space are known: all rest frames are the identity, all joints at 0.
    pub fn webxr(side: Side) -> RestSkeleton {
        let mut names = vec!["wrist".to_owned()];
        let mut parents = vec![None];
        for finger in ["thumb", "index-finger", "middle-finger", "ring-finger", "pinky-finger"] {
            let parts: &[&str] = if finger == "thumb" {
                &["metacarpal", "phalanx-proximal", "phalanx-distal", "tip"]
            } else {
                &["metacarpal", "phalanx-proximal", "phalanx-intermediate", "phalanx-distal", "tip"]
            };
            for (k, part) in parts.iter().enumerate() {
                parents.push(Some(if k == 0 { 0 } else { names.len() - 1 }));
                names.push(format!("{finger}-{part}"));
            }
        }
        let count = names.len();
        RestSkeleton {
            name: "WebXR hand".into(),
            side,
            roles: JointRole::of_joints(&names),
            joint_names: names,
            parents,
            joints: vec![DVec3::ZERO; count],
            frames: vec![DMat3::IDENTITY; count],
            hinges: vec![DMat3::IDENTITY; count],
            tips: [DVec3::ZERO; 5],
        }
    }

    /// The joint of that role.
    pub fn joint(&self, role: JointRole) -> Option<usize> {
        self.roles.iter().position(|known| *known == Some(role))
    }

    /// Rest position of the joint of that role.
    pub fn joint_position(&self, role: JointRole) -> Option<DVec3> {
        self.joints.get(self.joint(role)?).copied()
    }

    /// Directions at rest from the wrist to the middle knuckle, from the palm through the back of the hand, and from
    /// the index finger to the ring finger; orthonormal.
    ///
    /// The little finger is not used: its knuckle is lower, and the palm of WebXR's frames does not tilt with it.
    pub fn palm(&self) -> Option<[DVec3; 3]> {
        let knuckle = |finger| self.joint_position(JointRole::Bend(finger, 1));
        let forward = (knuckle(Finger::Middle)? - *self.joints.first()?).try_normalize()?;
        let across = knuckle(Finger::Ring)? - knuckle(Finger::Index)?;
        let across = across.reject_from_normalized(forward).try_normalize()?;
        let back = across.cross(forward) * if self.side == Side::Right { 1.0 } else { -1.0 };
        Some([forward, back, across])
    }

    fn rest_frames(&self, thumb_towards_back: f64) -> Option<Vec<DMat3>> {
        let [forward, back, across] = self.palm()?;
        let nail = thumb_towards_back * back - across;
        let bone = |finger: Finger, from: u8| {
            let start = self.joint_position(JointRole::Bend(finger, from))?;
            let end =
                if from < 3 { self.joint_position(JointRole::Bend(finger, from + 1))? } else { *self.tip(finger)? };
            Some((end - start, if finger == Finger::Thumb { nail } else { back }))
        };
        let frame = |role: &Option<JointRole>| {
            let (along, up) = match role {
                None => return Some(DMat3::IDENTITY),
                Some(JointRole::Wrist | JointRole::Palm) => (forward, back),
                Some(JointRole::Metacarpal(finger)) => {
                    let start = self.joint_position(JointRole::Metacarpal(*finger))?;
                    (self.joint_position(JointRole::Bend(*finger, 1))? - start, back)
                }
                Some(JointRole::Bend(finger, k)) => bone(*finger, *k)?,
                Some(JointRole::Tip(finger)) => bone(*finger, 3)?,
            };
            bone_frame(along, up)
        };
        Finger::ALL.iter().all(|finger| (1..=3).all(|k| bone(*finger, k).is_some())).then_some(())?;
        self.roles.iter().map(frame).collect()
    }

    /// The rest position of a fingertip.
    pub fn tip(&self, finger: Finger) -> Option<&DVec3> {
        let place = Finger::ALL.iter().position(|known| *known == finger)?;
        self.tips.get(place)
    }
}

/// The frame with -Z along a bone and +Y as near to `up` as possible.
fn bone_frame(along: DVec3, up: DVec3) -> Option<DMat3> {
    let z = -along.try_normalize()?;
    let y = up.reject_from_normalized(z).try_normalize()?;
    Some(DMat3::from_cols(y.cross(z), y, z))
}

/// A skeleton's own joint at the tip, or else the skin's outermost point along the last bone.
fn tip(model: &HandModel, roles: &[Option<JointRole>], finger: Finger) -> Option<DVec3> {
    let joint = |role| model.joints.get(roles.iter().position(|known| *known == Some(role))?).copied();
    if let Some(tip) = joint(JointRole::Tip(finger)) {
        return Some(tip);
    }
    let last = roles.iter().position(|known| *known == Some(JointRole::Bend(finger, 3)))?;
    let along = joint(JointRole::Bend(finger, 3))? - joint(JointRole::Bend(finger, 2))?;
    let moved = |(i, _): &(usize, &DVec3)| model.vertex_weights(*i).get(last).is_some_and(|weight| *weight > 0.5);
    let points = model.vertices.iter().enumerate().filter(moved);
    points.map(|(_, point)| *point).max_by(|a, b| a.dot(along).total_cmp(&b.dot(along)))
}

//! A skeleton with a frame on each bone that is defined in the same way on every skeleton.
//!
//! The frames are OpenXR's. For a skeleton known only by its rest pose, they come from the rest positions of the joints
//! ([`ghand_hand_model::joints::axes`]). WebXR and OpenXR give joints by their frames in space, so that all their rest
//! frames are the identity.

use std::sync::OnceLock;

use ghand_core::{HandModel, Side};
use ghand_hand_model::joints::axes::{JointAxes, RestBones, fingertips, why_without_axes};
use ghand_hand_model::joints::names::{Finger, JointRole};
use glam::{DMat3, DVec3};

use crate::PoseError;

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
    /// Axes of the joints, `n_b`; the skeleton's own axes if no role is known.
    pub axes: Vec<JointAxes>,
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
        let tips = fingertips(model, &roles);
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
        let roles = JointRole::of_joints(joint_names);
        let bones = RestBones { side, roles: &roles, joints, tips: &tips };
        let (Some(frames), Some(axes)) = (bones.frames(), bones.axes()) else {
            return Err(PoseError::Invalid {
                origin: name.into(),
                field: "joints".into(),
                problem: why_without_axes(joint_names),
            });
        };
        Ok(RestSkeleton {
            name: name.into(),
            side,
            joint_names: joint_names.to_vec(),
            roles,
            parents: parents.to_vec(),
            joints: joints.to_vec(),
            frames,
            axes,
            tips,
        })
    }

    /// The 25 joints of WebXR. Only their frames in space are known: all rest frames are the identity, all joints at 0.
    pub fn webxr(side: Side) -> &'static RestSkeleton {
        static HANDS: [OnceLock<RestSkeleton>; 2] = [const { OnceLock::new() }; 2];
        let [right, left] = &HANDS;
        let kept = if side == Side::Right { right } else { left };
        kept.get_or_init(|| RestSkeleton::new_webxr(side))
    }

    fn new_webxr(side: Side) -> RestSkeleton {
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
            axes: vec![JointAxes::OF_MODEL; count],
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
    pub fn palm(&self) -> Option<[DVec3; 3]> {
        RestBones { side: self.side, roles: &self.roles, joints: &self.joints, tips: &self.tips }.palm()
    }

    /// The rest position of a fingertip.
    pub fn tip(&self, finger: Finger) -> Option<&DVec3> {
        let place = Finger::ALL.iter().position(|known| *known == finger)?;
        self.tips.get(place)
    }
}

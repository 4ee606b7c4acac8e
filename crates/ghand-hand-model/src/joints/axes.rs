//! Frames of a hand's bones at rest, and the axes about which its joints rotate.
//!
//! Both come from the rest positions of joints whose names identify them, so that they mean the same on every rig. A
//! bone's frame is OpenXR's: -Z along the bone towards the fingertip, +Y out of the back of the hand (of the thumb: out
//! of its nail), +X to the right of both. On the wrist, -Z points to the knuckle of the middle finger.

use ghand_core::{HandModel, Side};
use glam::{DMat3, DVec3};

use super::names::{Finger, JointRole, unidentified};

/// How much the axes of the thumb's hinges let its nail face the back of the hand: they bend it across the palm and, a
/// little, into it.
pub(crate) const THUMB_TOWARDS_BACK: f64 = 0.45;

/// Why a hand has no axes although its joints are known.
const UNKNOWN_BONE: &str = "joints of a finger are at one point, or no skin and no joint shows its tip; bind the skin to \
                            the last joint of each finger, or rename joints that are counted from elsewhere";

/// Why [`JointAxes::of_joints`] and [`RestBones::frames`] have nothing for joints of these names.
pub fn why_without_axes(names: &[String]) -> String {
    unidentified(names).unwrap_or_else(|| UNKNOWN_BONE.into())
}

/// The axes about which a joint rotates at rest, unit vectors in model axes, at right angles to each other.
///
/// A joint's three angles are the components of its axis-angle vector along these axes. On the left hand, the same
/// angles give the mirror image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointAxes {
    /// Rotation about it bends the finger towards the palm; the thumb across the palm.
    pub flexion: DVec3,
    /// Rotation about it moves ring and little finger and their metacarpals towards the little finger's side, the
    /// thumb away from the palm, and everything else towards the thumb's side.
    pub abduction: DVec3,
    /// Rotation about it pronates: the nail turns towards the thumb's side, the thumb's pad towards the fingers.
    pub twist: DVec3,
}

impl JointAxes {
    /// The model's x, y and z axis, for joints whose part of the hand is unknown.
    pub const OF_MODEL: JointAxes = JointAxes { flexion: DVec3::X, abduction: DVec3::Y, twist: DVec3::Z };

    /// The axes of a model's joints, `n_b`; [`JointAxes::OF_MODEL`] where no role is known. `None` if the names do not
    /// identify the three joints of each finger, or if joints of a finger are at one point.
    pub fn of_joints(model: &HandModel) -> Option<Vec<JointAxes>> {
        let roles = JointRole::of_joints(&model.joint_names);
        let tips = fingertips(model, &roles);
        RestBones { side: model.side, roles: &roles, joints: &model.joints, tips: &tips }.axes()
    }

    fn of_frame(frame: &DMat3, side: Side, role: JointRole) -> JointAxes {
        // +X and +Z are the same anatomical directions on both hands, but a mirror turns rotations about them round.
        let pronation = if side == Side::Right { 1.0 } else { -1.0 };
        let outwards = match role {
            JointRole::Metacarpal(Finger::Ring | Finger::Little)
            | JointRole::Bend(Finger::Ring | Finger::Little, _)
            | JointRole::Tip(Finger::Ring | Finger::Little) => -pronation,
            _ => pronation,
        };
        JointAxes { flexion: -frame.x_axis, abduction: outwards * frame.y_axis, twist: pronation * frame.z_axis }
    }

    /// The axis-angle vector with these angles: flexion, abduction, twist, radians.
    pub fn rotation(&self, angles: DVec3) -> DVec3 {
        self.matrix() * angles
    }

    /// Flexion, abduction and twist of an axis-angle vector, radians.
    pub fn angles(&self, rotation: DVec3) -> DVec3 {
        self.matrix().transpose() * rotation
    }

    /// The axes of a rotated hand.
    pub fn turned(&self, turn: DMat3) -> JointAxes {
        JointAxes { flexion: turn * self.flexion, abduction: turn * self.abduction, twist: turn * self.twist }
    }

    /// The axes as columns. The determinant may be -1.
    fn matrix(&self) -> DMat3 {
        DMat3::from_cols(self.flexion, self.abduction, self.twist)
    }
}

/// Bones of a hand at rest. Lengths in metres.
#[derive(Debug, Clone, Copy)]
pub struct RestBones<'a> {
    /// Which hand it is.
    pub side: Side,
    /// Roles of the joints, if their names identify them, `n_b`. Joint 0 is the wrist.
    pub roles: &'a [Option<JointRole>],
    /// Rest positions, `n_b`.
    pub joints: &'a [DVec3],
    /// Rest positions of the fingertips, thumb to little finger.
    pub tips: &'a [DVec3; 5],
}

impl RestBones<'_> {
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

    /// Frames of the bones as WebXR has them, `n_b`: rotations from the bone's axes to the axes of the skeleton; the
    /// identity where no role is known. `None` if the roles do not contain the three joints of each finger, or if joints
    /// of a finger are at one point.
    pub fn frames(&self) -> Option<Vec<DMat3>> {
        self.frames_with_thumb(0.0)
    }

    /// The axes of the joints, `n_b`; [`JointAxes::OF_MODEL`] where no role is known. `None` as in
    /// [`RestBones::frames`].
    pub fn axes(&self) -> Option<Vec<JointAxes>> {
        let frames = self.frames_with_thumb(THUMB_TOWARDS_BACK)?;
        let axes = |(frame, role): (&DMat3, &Option<JointRole>)| {
            role.map_or(JointAxes::OF_MODEL, |role| JointAxes::of_frame(frame, self.side, role))
        };
        Some(frames.iter().zip(self.roles).map(axes).collect())
    }

    fn frames_with_thumb(&self, towards_back: f64) -> Option<Vec<DMat3>> {
        let [forward, back, across] = self.palm()?;
        let nail = towards_back * back - across;
        let bone = |finger: Finger, from: u8| {
            let start = self.joint_position(JointRole::Bend(finger, from))?;
            let end =
                if from < 3 { self.joint_position(JointRole::Bend(finger, from + 1))? } else { self.tip(finger)? };
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

    fn joint_position(&self, role: JointRole) -> Option<DVec3> {
        self.joints.get(self.roles.iter().position(|known| *known == Some(role))?).copied()
    }

    fn tip(&self, finger: Finger) -> Option<DVec3> {
        self.tips.get(Finger::ALL.iter().position(|known| *known == finger)?).copied()
    }
}

/// The frame with -Z along a bone and +Y as near to `up` as possible.
fn bone_frame(along: DVec3, up: DVec3) -> Option<DMat3> {
    let z = -along.try_normalize()?;
    let y = up.reject_from_normalized(z).try_normalize()?;
    Some(DMat3::from_cols(y.cross(z), y, z))
}

/// Rest positions of a model's fingertips, thumb to little finger, metres: a skeleton's own joint at the tip, or else
/// the skin's outermost point along the last bone. NaN if the model has neither. `roles` are those of its joints.
pub fn fingertips(model: &HandModel, roles: &[Option<JointRole>]) -> [DVec3; 5] {
    Finger::ALL.map(|finger| fingertip(model, roles, finger).unwrap_or(DVec3::NAN))
}

pub(crate) fn fingertip(model: &HandModel, roles: &[Option<JointRole>], finger: Finger) -> Option<DVec3> {
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

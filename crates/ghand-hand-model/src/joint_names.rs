//! Names of hand joints, and the parts of the hand that they stand for.
//!
//! Recognised are MANO's names (`index1`), WebXR's (`index-finger-phalanx-proximal`), OpenXR's
//! (`XR_HAND_JOINT_INDEX_PROXIMAL_EXT`), those of a few animation tools (`LeftHandIndex1`, `index_01_r`,
//! `RightIndexProximal`), and all other names that contain a finger and either its part or a number counted from the
//! knuckle.

use ghand_core::HandModel;

/// A finger.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Finger {
    /// Thumb.
    Thumb,
    /// Index finger.
    Index,
    /// Middle finger.
    Middle,
    /// Ring finger.
    Ring,
    /// Little finger.
    Little,
}

impl Finger {
    /// All of them, thumb to little finger.
    pub const ALL: [Finger; 5] = [Finger::Thumb, Finger::Index, Finger::Middle, Finger::Ring, Finger::Little];
}

/// The part of a hand that a joint moves, independent of the rig's names.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum JointRole {
    /// The wrist, root of the hand.
    Wrist,
    /// The middle of the palm, an additional joint of OpenXR.
    Palm,
    /// The start of a finger's metacarpal bone; the thumb's is its first [`JointRole::Bend`].
    Metacarpal(Finger),
    /// One of the three joints that bend a finger, 1 to 3 counted from the palm.
    Bend(Finger, u8),
    /// The tip.
    Tip(Finger),
}

impl JointRole {
    /// The part that a joint of that name moves, if the name identifies one.
    pub fn of(name: &str) -> Option<JointRole> {
        let name = name.to_lowercase();
        let words = || name.split(|c: char| !c.is_alphabetic()).filter(|word| !word.is_empty());
        let finger = finger(&name);
        let number = name.bytes().filter(u8::is_ascii_digit).map(|d| usize::from(d - b'0'));
        let number = number
            .fold(None, |sum: Option<usize>, digit| Some(sum.unwrap_or(0).saturating_mul(10).saturating_add(digit)));
        let Some(finger) = finger else {
            return if name.contains("wrist") {
                Some(JointRole::Wrist)
            } else if words().any(|word| word == "palm") {
                Some(JointRole::Palm)
            } else {
                None
            };
        };
        let has = |part: &str| name.contains(part);
        let thumb = finger == Finger::Thumb;
        Some(if has("tip") || words().any(|word| word == "end") {
            JointRole::Tip(finger)
        } else if has("metacarpal") {
            if thumb { JointRole::Bend(finger, 1) } else { JointRole::Metacarpal(finger) }
        } else if has("proximal") {
            JointRole::Bend(finger, if thumb { 2 } else { 1 })
        } else if has("intermediate") && !thumb {
            JointRole::Bend(finger, 2)
        } else if has("distal") {
            JointRole::Bend(finger, 3)
        } else {
            match number? {
                0 if !thumb => JointRole::Metacarpal(finger),
                4 => JointRole::Tip(finger),
                k @ 1..=3 => JointRole::Bend(finger, k as u8),
                _ => return None,
            }
        })
    }

    /// The part that each joint of a model moves. The root is the wrist, with any name; if two joints seem to be the
    /// same part, the first one counts.
    pub fn of_joints(names: &[String]) -> Vec<Option<JointRole>> {
        let mut roles: Vec<Option<JointRole>> = Vec::with_capacity(names.len());
        for (k, name) in names.iter().enumerate() {
            let role = if k == 0 { Some(JointRole::Wrist) } else { JointRole::of(name) };
            roles.push(role.filter(|_| !roles.contains(&role)));
        }
        roles
    }
}

fn finger(name: &str) -> Option<Finger> {
    // "middle" comes last: some rigs use it for the second joint of a finger.
    let words = [
        ("thumb", Finger::Thumb),
        ("index", Finger::Index),
        ("ring", Finger::Ring),
        ("pinky", Finger::Little),
        ("little", Finger::Little),
        ("middle", Finger::Middle),
    ];
    words.into_iter().find(|(word, _)| name.contains(word)).map(|(_, finger)| finger)
}

/// The three joints that bend a finger, starting at the palm, if the model has them.
pub fn finger_joints(finger: Finger, model: &HandModel) -> Option<[usize; 3]> {
    let roles = JointRole::of_joints(&model.joint_names);
    let find = |k: u8| roles.iter().position(|role| *role == Some(JointRole::Bend(finger, k)));
    Some([find(1)?, find(2)?, find(3)?])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_all_conventions_mean_the_same_parts() {
        use Finger::{Index, Little, Middle, Ring, Thumb};
        for (name, role) in [
            ("wrist", JointRole::Wrist),
            ("XR_HAND_JOINT_WRIST_EXT", JointRole::Wrist),
            ("XR_HAND_JOINT_PALM_EXT", JointRole::Palm),
            ("index1", JointRole::Bend(Index, 1)),
            ("pinky3", JointRole::Bend(Little, 3)),
            ("thumb1", JointRole::Bend(Thumb, 1)),
            ("thumb-metacarpal", JointRole::Bend(Thumb, 1)),
            ("thumb-phalanx-proximal", JointRole::Bend(Thumb, 2)),
            ("thumb-phalanx-distal", JointRole::Bend(Thumb, 3)),
            ("thumb-tip", JointRole::Tip(Thumb)),
            ("middle-finger-metacarpal", JointRole::Metacarpal(Middle)),
            ("ring-finger-phalanx-intermediate", JointRole::Bend(Ring, 2)),
            ("pinky-finger-tip", JointRole::Tip(Little)),
            ("XR_HAND_JOINT_LITTLE_PROXIMAL_EXT", JointRole::Bend(Little, 1)),
            ("XR_HAND_JOINT_THUMB_PROXIMAL_EXT", JointRole::Bend(Thumb, 2)),
            ("XR_HAND_JOINT_MIDDLE_INTERMEDIATE_EXT", JointRole::Bend(Middle, 2)),
            ("LeftHandIndex4", JointRole::Tip(Index)),
            ("mixamorig:RightHandThumb2", JointRole::Bend(Thumb, 2)),
            ("ring_01_l", JointRole::Bend(Ring, 1)),
            ("RightLittleDistal", JointRole::Bend(Little, 3)),
        ] {
            assert_eq!(JointRole::of(name), Some(role), "{name}");
        }
        for name in ["elbow", "bone", "index", "index9", "thumb0", ""] {
            assert_eq!(JointRole::of(name), None, "{name}");
        }
    }

    #[test]
    fn the_root_is_the_wrist_and_no_part_occurs_twice() {
        let names = ["hand_r", "index1", "index1", "wrist"].map(String::from);
        let index = Some(JointRole::Bend(Finger::Index, 1));
        assert_eq!(JointRole::of_joints(&names), [Some(JointRole::Wrist), index, None, None]);
    }
}

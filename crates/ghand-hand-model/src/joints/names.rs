//! Names of hand joints, and the parts of the hand that they stand for.
//!
//! The words of a name decide (`spring1` is no ring finger): a finger, and its part or a number. Rigs count and name
//! their parts differently, so that all names of a rig are read together. Known are the names of MANO and SMPL-X, WebXR,
//! OpenXR, ARKit, Ultraleap, Quest and SteamVR, Unity and VRM 0, VRM 1, Unreal, Mixamo, Biped, Character Creator, Daz,
//! Rigify, MakeHuman and MikuMikuDance, also with the suffixes of Blender's copies and of Sketchfab's nodes.

mod rig;
mod words;

use std::fmt;

use ghand_core::HandModel;

pub use words::side_in_name;
pub(crate) use words::{Limb, limb};

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
    /// The part that a joint of that name moves, if the name alone identifies one.
    pub fn of(name: &str) -> Option<JointRole> {
        rig::roles(&[name.to_owned()])[0]
    }

    /// The part that each joint of a model moves. The root is the wrist, with any name; if two joints seem to be the
    /// same part, the one with the shorter name counts, or else the first.
    pub fn of_joints(names: &[String]) -> Vec<Option<JointRole>> {
        let mut roles = JointRole::of_any_joints(names);
        roles.iter_mut().filter(|role| **role == Some(JointRole::Wrist)).for_each(|role| *role = None);
        if let Some(root) = roles.first_mut() {
            *root = Some(JointRole::Wrist);
        }
        roles
    }

    /// The part that each joint moves if the first one need not be the wrist.
    pub fn of_any_joints(names: &[String]) -> Vec<Option<JointRole>> {
        rig::roles(names)
    }
}

impl fmt::Display for JointRole {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            JointRole::Wrist => f.write_str("wrist"),
            JointRole::Palm => f.write_str("palm"),
            JointRole::Metacarpal(finger) => write!(f, "{finger} metacarpal"),
            JointRole::Bend(finger, k) => write!(f, "{finger} {k}"),
            JointRole::Tip(finger) => write!(f, "{finger} tip"),
        }
    }
}

impl fmt::Display for Finger {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match self {
            Finger::Thumb => "thumb",
            Finger::Index => "index",
            Finger::Middle => "middle",
            Finger::Ring => "ring",
            Finger::Little => "little",
        })
    }
}

/// The finger that each joint belongs to; also the joints of both hands of a body.
pub(crate) fn fingers(names: &[String]) -> Vec<Option<Finger>> {
    rig::fingers(names)
}

/// What the names of a model's joints do not tell, if they do not identify the three joints of each finger: the missing
/// parts and the joints without a part.
pub fn unidentified(names: &[String]) -> Option<String> {
    let roles = JointRole::of_joints(names);
    let bends = Finger::ALL.into_iter().flat_map(|finger| (1..=3).map(move |k| JointRole::Bend(finger, k)));
    let missing: Vec<String> =
        bends.filter(|bend| !roles.contains(&Some(*bend))).map(|bend| bend.to_string()).collect();
    let unplaced: Vec<&str> =
        names.iter().zip(&roles).filter(|(_, role)| role.is_none()).map(|(name, _)| name.as_str()).collect();
    let missing_parts = missing.join(", ");
    let cause = match unplaced.len() {
        0 => format!(
            "has no joints {missing_parts}, counted from the palm; poses by name and of other hands need three for each \
             finger"
        ),
        _ => format!(
            "the joints' names do not tell {missing_parts}, counted from the palm (joints without a part: {}); name them \
             like MANO's (index1) or WebXR's",
            unplaced.join(", ")
        ),
    };
    (!missing.is_empty()).then_some(cause)
}

/// The three joints that bend a finger, starting at the palm, if the model has them.
pub fn finger_joints(finger: Finger, model: &HandModel) -> Option<[usize; 3]> {
    let roles = JointRole::of_joints(&model.joint_names);
    let find = |k: u8| roles.iter().position(|role| *role == Some(JointRole::Bend(finger, k)));
    Some([find(1)?, find(2)?, find(3)?])
}

#[cfg(test)]
mod tests {
    use ghand_core::Side;

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

    /// The joints that bend fingers, as `T1 I2` and so on, in the order of the names; `-` for joints without a part, and
    /// `M`, `tip` and `palm` for the others.
    fn read(names: &str) -> String {
        let names: Vec<String> = names.split(' ').map(|name| name.replace('~', " ")).collect();
        let roles = JointRole::of_joints(&names);
        let text = |role: &Option<JointRole>| match role {
            None => "-".into(),
            Some(JointRole::Bend(finger, k)) => format!("{}{k}", &format!("{finger:?}")[..1]),
            Some(JointRole::Metacarpal(finger)) => format!("{}M", &format!("{finger:?}")[..1]),
            Some(JointRole::Tip(finger)) => format!("{}tip", &format!("{finger:?}")[..1]),
            Some(other) => other.to_string(),
        };
        roles.iter().skip(1).map(text).collect::<Vec<_>>().join(" ")
    }

    #[test]
    fn a_thumbs_parts_are_those_of_its_own_convention() {
        for names in [
            "RightHand RightThumbProximal RightThumbIntermediate RightThumbDistal RightIndexProximal",
            "rightHand rightThumbProximal rightThumbIntermediate rightThumbDistal rightIndexProximal",
            "Right~Hand Thumb~Proximal.R Thumb~Intermediate.R Thumb~Distal.R Index~Proximal.R",
            "hand thumbMetacarpal thumbProximal thumbDistal indexProximal",
            "hand THUMB_CMC THUMB_MCP THUMB_IP INDEX_FINGER_MCP",
            "hand b_r_thumb1 b_r_thumb2 b_r_thumb3 b_r_index1",
            "hand Thumb0_R Thumb1_R Thumb2_R IndexFinger1_R",
            "右手首 右親指０ 右親指１ 右親指２ 右人指１",
            "R_Wrist R_thumb_meta R_thumb_a R_thumb_b R_index_a",
            "wrist handThumbStart handThumb_1 handThumb_2 handIndex_1",
            "wrist thumbKnuckle thumbIntermediateBase thumbIntermediateTip indexFingerKnuckle",
        ] {
            assert_eq!(read(names), "T1 T2 T3 I1", "{names}");
        }
        assert_eq!(read("h ThumbMetacarpal ThumbProximal ThumbIntermediate ThumbDistal ThumbTip"), "- T1 T2 T3 Ttip");
        assert_eq!(read("h b_thumb0 b_thumb1 b_thumb2 b_thumb3 b_thumb_null"), "- T1 T2 T3 Ttip");
    }

    #[test]
    fn numbers_count_from_where_their_finger_begins() {
        for (names, expected) in [
            (
                "h finger_index_meta_r finger_index_0_r finger_index_1_r finger_index_2_r finger_index_r_end",
                "IM I1 I2 I3 Itip",
            ),
            ("h J_Bip_R_Ring0 J_Bip_R_Ring1 J_Bip_R_Ring2 J_Bip_R_Ring3 J_Bip_R_Ring3_end", "RM R1 R2 R3 Rtip"),
            ("h LeftHandPinky1 LeftHandPinky2 LeftHandPinky3 LeftHandPinky4 LeftHandPinky4_end", "L1 L2 L3 Ltip -"),
            ("h mid1 mid2 mid3 mid4 mid_tip", "MM M1 M2 M3 Mtip"),
            ("h Index Index.001 Index.002", "I1 I2 I3"),
            ("h Thumb Thumb.001 Thumb.002 Thumb.003", "T1 T2 T3 Ttip"),
            ("h InHandThumb HandThumb1 HandThumb2 HandThumb3", "- T1 T2 T3"),
            ("h index1_base.r index1.r index2.r index3.r", "IM I1 I2 I3"),
            ("h RightInHandRing RightHandRing1 RightHandRing2 RightHandRing3", "RM R1 R2 R3"),
            ("h index_meta index_a index_b index_c index_end", "IM I1 I2 I3 Itip"),
            ("h IndexKnuckle IndexMiddleJoint IndexDistalJoint MiddleKnuckle MiddleMiddleJoint", "I1 I2 I3 M1 M2"),
        ] {
            assert_eq!(read(names), expected, "{names}");
        }
    }

    #[test]
    fn numbers_before_the_finger_and_after_the_name_are_not_the_parts() {
        for names in [
            "mixamorig1:RightHand mixamorig1:RightHandIndex1 mixamorig1:RightHandIndex2 mixamorig1:RightHandIndex3",
            "hand.R.001 f_index.01.R.001 f_index.02.R.001 f_index.03.R.001",
            "hand_r_010 index_01_r_012 index_02_r_013 index_03_r_014 spine_02_015",
            "Hand_00 Index_07 Index.001_08 Index.002_09 Root_010",
            "CC_Base_R_Hand_05 CC_Base_R_Index1_08 CC_Base_R_Index2_07 CC_Base_R_Index3_09 CC_Base_R_Twist_010",
            "Armature2|hand Armature2|rIndex1 Armature2|rIndex2 Armature2|rIndex3",
        ] {
            assert!(read(names).starts_with("I1 I2 I3"), "{names}: {}", read(names));
        }
        assert_eq!(
            read("h index_01 index_02 index_03 mid_04 mid_05 mid_06 ring_07 ring_08 ring_09"),
            "I1 I2 I3 M1 M2 M3 R1 R2 R3"
        );
    }

    #[test]
    fn fingers_with_numbers_for_names_are_counted_from_the_thumb() {
        let biped = "Bip01~R~Hand Bip01~R~Finger0 Bip01~R~Finger01 Bip01~R~Finger02 Bip01~R~Finger0Nub Bip01~R~Finger1 \
                     Bip01~R~Finger11 Bip01~R~Finger12 Bip01~R~Finger4 Bip01~R~Finger41 Bip01~R~Finger42";
        assert_eq!(read(biped), "T1 T2 T3 Ttip I1 I2 I3 L1 L2 L3");
        let make_human = "wrist.R finger1-1.R finger1-2.R finger1-3.R metacarpal1.R finger2-1.R finger2-2.R metacarpal2.R \
                          metacarpal3.R metacarpal4.R finger5-3.R";
        assert_eq!(read(make_human), "T1 T2 T3 IM I1 I2 MM RM LM L3");
        assert_eq!(read("h thumb1 finger1_1 finger2_1 finger3_1 finger4_1"), "T1 I1 M1 R1 L1");
        assert_eq!(read("h finger1_1 finger2_1 finger3_1 finger4_1"), "- - - -", "it may be that 1 is the thumb");
        assert_eq!(read("hand.R palm.01.R palm.02.R palm.03.R palm.04.R f_pinky.01.R"), "IM MM RM LM L1");
    }

    #[test]
    fn words_decide_and_not_letters_in_them() {
        for name in [
            "spring1",
            "string_2",
            "earring1",
            "thumbnail1",
            "forearm1",
            "middleware2",
            "wristband",
            "wrist_twist_01",
            "toe_index1",
            "ring_ik_target1",
            "indexer1",
            "index_pinky_1",
            "lower_leg_middle_1",
            "forehead1",
        ] {
            assert_eq!(JointRole::of(name), None, "{name}");
        }
        for (name, side) in [
            ("leftover1", None),
            ("copyright", None),
            ("LeftHandIndex1", Some(Side::Left)),
            ("hand_l", Some(Side::Left)),
            ("rIndex1", Some(Side::Right)),
            ("Bip01 L Finger0", Some(Side::Left)),
            ("f_index.01.R.001", Some(Side::Right)),
            ("rightindex1", Some(Side::Right)),
            ("lhand", Some(Side::Left)),
            ("left_right", None),
            ("little1", None),
            ("ring1", None),
            ("rhino", None),
            ("MANO_RIGHT", Some(Side::Right)),
            ("左手首", Some(Side::Left)),
        ] {
            assert_eq!(side_in_name(name), side, "{name}");
        }
    }

    #[test]
    fn what_names_do_not_tell_is_named() {
        let names = ["wrist", "thumb1", "thumb2", "blob", "spring1"].map(String::from);
        let told = unidentified(&names).unwrap();
        assert!(told.contains("thumb 3, index 1,") && told.contains("without a part: blob, spring1"), "{told}");
        let whole: Vec<String> = crate::files::mano::JOINT_NAMES.map(String::from).to_vec();
        assert_eq!(unidentified(&whole), None);
    }

    #[test]
    fn the_root_is_the_wrist_and_no_part_occurs_twice() {
        let names = ["hand_r", "index1", "index1", "wrist"].map(String::from);
        let index = Some(JointRole::Bend(Finger::Index, 1));
        assert_eq!(JointRole::of_joints(&names), [Some(JointRole::Wrist), index, None, None]);
    }
}

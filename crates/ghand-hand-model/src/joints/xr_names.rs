//! The names that OpenXR and WebXR give to the joints of a hand.

use super::names::{Finger, JointRole};

/// Whose names joints are given.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum XrNames {
    /// OpenXR's `XrHandJointEXT`, such as `XR_HAND_JOINT_INDEX_PROXIMAL_EXT`.
    OpenXr,
    /// WebXR's `XRHandJoint`, such as `index-finger-phalanx-proximal`.
    WebXr,
}

/// The joints' names, from the parts that their own names tell; those that stand for none keep theirs.
pub fn xr_joint_names(names: &[String], wanted: XrNames) -> Vec<String> {
    let roles = JointRole::of_joints(names);
    let name =
        |(own, role): (&String, Option<JointRole>)| role.map_or_else(|| own.clone(), |role| xr_name(role, wanted));
    names.iter().zip(roles).map(name).collect()
}

fn xr_name(role: JointRole, wanted: XrNames) -> String {
    let web = match role {
        JointRole::Wrist => "wrist".to_owned(),
        JointRole::Palm => "palm".to_owned(),
        JointRole::Metacarpal(finger) => format!("{}-metacarpal", finger_name(finger)),
        JointRole::Bend(finger, k) => format!("{}-{}", finger_name(finger), bone(finger, k)),
        JointRole::Tip(finger) => format!("{}-tip", finger_name(finger)),
    };
    match wanted {
        XrNames::WebXr => web,
        XrNames::OpenXr => {
            // The same words in another spelling: `pinky-finger-phalanx-distal` is `LITTLE_DISTAL`.
            let words = web.replace("pinky", "little").replace("-finger", "").replace("phalanx-", "").replace('-', "_");
            format!("XR_HAND_JOINT_{}_EXT", words.to_uppercase())
        }
    }
}

fn finger_name(finger: Finger) -> &'static str {
    match finger {
        Finger::Thumb => "thumb",
        Finger::Index => "index-finger",
        Finger::Middle => "middle-finger",
        Finger::Ring => "ring-finger",
        Finger::Little => "pinky-finger",
    }
}

/// The bone that a joint begins, 1 to 3 counted from the palm. The thumb has one bone less, and its first is in the palm.
fn bone(finger: Finger, k: u8) -> &'static str {
    match (finger, k) {
        (Finger::Thumb, 1) => "metacarpal",
        (Finger::Thumb, 2) | (_, 1) => "phalanx-proximal",
        (Finger::Thumb, _) | (_, 3) => "phalanx-distal",
        _ => "phalanx-intermediate",
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

    use ghand_core::Side;

    use super::*;
    use crate::builtin::builtin_hand;

    #[test]
    fn the_built_in_hand_has_webxrs_names_already_and_gets_openxrs() {
        let names = builtin_hand(Side::Right).unwrap().joint_names;
        assert_eq!(xr_joint_names(&names, XrNames::WebXr), names);
        let open = xr_joint_names(&names, XrNames::OpenXr);
        for (name, wanted) in [
            (0, "XR_HAND_JOINT_WRIST_EXT"),
            (1, "XR_HAND_JOINT_THUMB_METACARPAL_EXT"),
            (3, "XR_HAND_JOINT_THUMB_DISTAL_EXT"),
            (6, "XR_HAND_JOINT_INDEX_PROXIMAL_EXT"),
            (22, "XR_HAND_JOINT_LITTLE_INTERMEDIATE_EXT"),
            (24, "XR_HAND_JOINT_LITTLE_TIP_EXT"),
        ] {
            assert_eq!(open[name], wanted);
        }
        assert_eq!(JointRole::of_joints(&open), JointRole::of_joints(&names));
    }

    #[test]
    fn joints_of_mano_get_the_names_of_their_parts() {
        let mano: Vec<String> =
            ["wrist", "index1", "index2", "index3", "pinky1", "thumb1", "thumb2", "thumb3"].map(String::from).to_vec();
        let web = xr_joint_names(&mano, XrNames::WebXr);
        assert_eq!(
            web[1..4].join(" "),
            "index-finger-phalanx-proximal index-finger-phalanx-intermediate index-finger-phalanx-distal"
        );
        assert_eq!(web[5..].join(" "), "thumb-metacarpal thumb-phalanx-proximal thumb-phalanx-distal");
    }

    #[test]
    fn a_joint_that_stands_for_no_part_keeps_its_name() {
        let names = ["wrist", "ring_on_finger_9", "index1"].map(String::from);
        let roles = JointRole::of_joints(&names);
        assert_eq!(roles[1], None);
        assert_eq!(xr_joint_names(&names, XrNames::OpenXr)[1], "ring_on_finger_9");
    }
}

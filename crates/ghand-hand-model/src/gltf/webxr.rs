//! The joints of a WebXR hand.

use ::gltf::Node;

use super::Source;
use crate::HandModelError;

/// The joints of a WebXR hand: parents precede their children, and each finger hangs from the wrist.
pub(super) const WEBXR_JOINTS: [&str; 25] = [
    "wrist",
    "thumb-metacarpal",
    "thumb-phalanx-proximal",
    "thumb-phalanx-distal",
    "thumb-tip",
    "index-finger-metacarpal",
    "index-finger-phalanx-proximal",
    "index-finger-phalanx-intermediate",
    "index-finger-phalanx-distal",
    "index-finger-tip",
    "middle-finger-metacarpal",
    "middle-finger-phalanx-proximal",
    "middle-finger-phalanx-intermediate",
    "middle-finger-phalanx-distal",
    "middle-finger-tip",
    "ring-finger-metacarpal",
    "ring-finger-phalanx-proximal",
    "ring-finger-phalanx-intermediate",
    "ring-finger-phalanx-distal",
    "ring-finger-tip",
    "pinky-finger-metacarpal",
    "pinky-finger-phalanx-proximal",
    "pinky-finger-phalanx-intermediate",
    "pinky-finger-phalanx-distal",
    "pinky-finger-tip",
];

/// Parent of a joint of [`WEBXR_JOINTS`].
pub(super) fn webxr_parent(joint: usize) -> Option<usize> {
    match joint {
        0 => None,
        k if WEBXR_JOINTS[k].ends_with("-metacarpal") => Some(0),
        k => Some(k - 1),
    }
}

/// Joints of the skin in the order of [`WEBXR_JOINTS`]; `None` if the rig has other names.
pub(super) fn webxr_order(nodes: &[Node], source: &Source) -> Result<Option<Vec<usize>>, HandModelError> {
    let find = |name: &str| nodes.iter().position(|node| node.name() == Some(name));
    let found: Vec<Option<usize>> = WEBXR_JOINTS.iter().map(|name| find(name)).collect();
    // Rigs of other kinds may also have a joint called "wrist".
    if found.iter().flatten().count() <= 1 {
        return Ok(None);
    }
    let missing = WEBXR_JOINTS.iter().zip(&found).find(|(_, at)| at.is_none());
    match missing {
        Some((name, _)) => {
            Err(source.invalid("skin", format!("has WebXR joints but no '{name}'; export all 25 joints of the hand")))
        }
        None => Ok(Some(found.into_iter().flatten().collect())),
    }
}

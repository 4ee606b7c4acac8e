//! The joints of a WebXR hand.

use ::gltf::Node;

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

/// Joints of the skin in the order of [`WEBXR_JOINTS`]; `None` if it lacks one of these names.
pub(super) fn webxr_order(nodes: &[Node]) -> Option<Vec<usize>> {
    WEBXR_JOINTS.iter().map(|name| nodes.iter().position(|node| node.name() == Some(name))).collect()
}

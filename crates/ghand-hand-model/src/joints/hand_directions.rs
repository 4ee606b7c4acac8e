//! Directions of a whole hand at rest.

use ghand_core::{HandModel, Side};
use glam::DVec3;

use super::names::{Finger, finger_joints};

/// Directions of a flat hand, unit vectors in model axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HandDirections {
    /// From the wrist to the middle finger's knuckle.
    pub forward: DVec3,
    /// From the index finger's knuckle to the little finger's.
    pub across: DVec3,
    /// The direction that the back of the hand faces.
    pub back: DVec3,
}

/// Directions of a model at rest; `None` if the names of its joints do not identify the three joints of each finger.
pub fn hand_directions(model: &HandModel) -> Option<HandDirections> {
    let knuckle = |finger| Some(model.joints[finger_joints(finger, model)?[0]]);
    let across = (knuckle(Finger::Little)? - knuckle(Finger::Index)?).normalize_or_zero();
    let forward = (knuckle(Finger::Middle)? - model.joints[0]).normalize_or_zero();
    let back = across.cross(forward).normalize_or_zero() * if model.side == Side::Right { 1.0 } else { -1.0 };
    Some(HandDirections { forward, across, back })
}

//! The left hand: everything is made for a right hand and mirrored in x, as the built-in left hand is.

use ghand_core::Pose;
use glam::DVec3;

/// A point, or a direction, mirrored in x.
pub(crate) fn mirrored_point(point: DVec3) -> DVec3 {
    DVec3::new(-point.x, point.y, point.z)
}

/// The same pose of the other hand, mirrored in x.
pub(crate) fn mirrored_pose(pose: &Pose) -> Pose {
    pose.mirrored()
}

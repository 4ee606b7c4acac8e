//! A pose: one rotation per joint and a global translation.

use glam::{DMat3, DVec3};
use serde::{Deserialize, Serialize};

use crate::rotation::{axis_angle_from_rotation, rotation_from_axis_angle};

/// Largest angle of a joint's rotation that [`Pose::check_range`] accepts, radians: 16 whole turns. Optimised or
/// integrated rotation vectors may accumulate a few turns; larger ones are in degrees, or not rotations at all.
pub const LARGEST_ANGLE: f64 = 100.0;
/// Largest global translation that [`Pose::check_range`] accepts, metres. Beyond a kilometre the f32 coordinates of the
/// GPU are coarser than 0.06 mm, and wrong units or a broken track are more likely than a hand.
pub const LARGEST_TRANSLATION: f64 = 1000.0;

/// Largest shape parameter that [`check_shape_range`] accepts. They are standard deviations, or weights from 0 to 1;
/// fits stay below ten.
pub const LARGEST_SHAPE: f64 = 100.0;

/// Joint rotations and global translation of a hand.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    /// Axis-angle rotation of each joint in the model's axes, radians, in the order of the model's joints. The root's
    /// rotation rotates the hand about the root joint.
    pub rotations: Vec<DVec3>,
    /// Global translation, metres, added last.
    pub translation: DVec3,
}

impl Pose {
    /// The pose of the hand moved as a whole: turned by `rotation` about the origin, then shifted by `translation`,
    /// metres. `root` is the rest position of the root joint, metres.
    #[must_use]
    pub fn moved(&self, rotation: &DMat3, translation: DVec3, root: DVec3) -> Pose {
        let mut moved = self.clone();
        if let Some(first) = moved.rotations.first_mut() {
            *first = axis_angle_from_rotation(&(*rotation * rotation_from_axis_angle(*first)));
        }
        // The root joint is where the rotation of the root leaves it.
        moved.translation = *rotation * (root + self.translation) + translation - root;
        moved
    }

    /// The pose of the other hand that is the mirror image in x.
    #[must_use]
    pub fn mirrored(&self) -> Pose {
        let translation = DVec3::new(-self.translation.x, self.translation.y, self.translation.z);
        Pose { rotations: self.rotations.iter().map(|r| DVec3::new(r.x, -r.y, -r.z)).collect(), translation }
    }
}

/// An impossible part of a pose.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PoseRangeError {
    /// A joint's rotation is too large or not finite.
    #[error(
        "joint {joint} rotates by {angle:?} rad, at most {LARGEST_ANGLE} is allowed; give axis-angle rotations in \
         radians"
    )]
    Rotation {
        /// The joint's name, or its number if it has none.
        joint: String,
        /// Length of its axis-angle vector, radians.
        angle: f64,
    },
    /// The hand is too far away, or its position is not finite.
    #[error("is {distance:?} m long, at most {LARGEST_TRANSLATION} is allowed; give metres")]
    Translation {
        /// Length of the translation, metres.
        distance: f64,
    },
    /// A shape parameter is too large or not finite.
    #[error("number {index} is {value:?}, must be from -{LARGEST_SHAPE} to {LARGEST_SHAPE}; give standard deviations")]
    Shape {
        /// Index of the parameter.
        index: usize,
        /// Its value.
        value: f64,
    },
}

/// Checks that shape parameters are finite and possible for a hand.
///
/// # Errors
/// [`PoseRangeError::Shape`] for the first beyond [`LARGEST_SHAPE`].
pub fn check_shape_range(shape: &[f64]) -> Result<(), PoseRangeError> {
    match shape.iter().enumerate().find(|(_, v)| !(-LARGEST_SHAPE..=LARGEST_SHAPE).contains(*v)) {
        Some((index, &value)) => Err(PoseRangeError::Shape { index, value }),
        None => Ok(()),
    }
}

impl Pose {
    /// The rest pose of a model of `joint_count` joints: no rotation, no translation.
    pub fn rest(joint_count: usize) -> Pose {
        Pose { rotations: vec![DVec3::ZERO; joint_count], translation: DVec3::ZERO }
    }

    /// Checks that every number is finite and possible for a hand. Readers of files call this, because only they can
    /// name the position of a mistake: later, a rotation of 1e30 rad would only give an empty picture. `joint_names`
    /// are the model's, for the message.
    ///
    /// # Errors
    /// [`PoseRangeError`] for the first joint beyond [`LARGEST_ANGLE`], else for a translation beyond
    /// [`LARGEST_TRANSLATION`].
    pub fn check_range(&self, joint_names: &[String]) -> Result<(), PoseRangeError> {
        for (joint, rotation) in self.rotations.iter().enumerate() {
            let angle = rotation.length();
            // Not `> LARGEST_ANGLE`: NaN is out of range, too.
            let in_range = angle <= LARGEST_ANGLE;
            if !in_range {
                let joint = joint_names.get(joint).map_or_else(|| format!("{joint}"), |name| format!("{name:?}"));
                return Err(PoseRangeError::Rotation { joint, angle });
            }
        }
        let distance = self.translation.length();
        if distance <= LARGEST_TRANSLATION { Ok(()) } else { Err(PoseRangeError::Translation { distance }) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn poses_out_of_range_are_named_by_joint_and_accepted_at_the_limit() {
        let names = ["wrist", "index1"].map(String::from);
        let mut pose = Pose::rest(3);
        pose.rotations[1] = DVec3::new(0.0, -LARGEST_ANGLE, 0.0);
        pose.translation = DVec3::new(0.0, 0.0, -LARGEST_TRANSLATION);
        assert_eq!(pose.check_range(&names), Ok(()));
        for (joint, value, said) in [
            (1, -101.0, "\"index1\" rotates by 101.0 rad"),
            (2, -1e30, "joint 2 rotates by 1e30 rad"),
            (1, f64::NAN, "NaN"),
        ] {
            let mut wrong = pose.clone();
            wrong.rotations[joint] = DVec3::new(value, 0.0, 0.0);
            let message = wrong.check_range(&names).unwrap_err().to_string();
            assert!(message.contains(said) && message.contains("radians"), "{message}");
        }
        for value in [1000.1, 1e300, f64::INFINITY, f64::NAN] {
            let wrong = Pose { translation: DVec3::new(value, 0.0, 0.0), ..pose.clone() };
            let message = wrong.check_range(&names).unwrap_err().to_string();
            assert!(message.contains("metres"), "{message}");
        }
    }

    #[test]
    fn shapes_out_of_range_are_named_by_number_and_accepted_at_the_limit() {
        assert_eq!(check_shape_range(&[0.0, LARGEST_SHAPE, -LARGEST_SHAPE]), Ok(()));
        for (value, said) in [(1e30, "number 1 is 1e30"), (-100.5, "number 1 is -100.5"), (f64::NAN, "number 1 is NaN")]
        {
            let message = check_shape_range(&[0.0, value]).unwrap_err().to_string();
            assert!(message.contains(said), "{message}");
        }
    }
}

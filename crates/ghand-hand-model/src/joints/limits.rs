//! How far the joints of a hand can move: one table for every rig whose joint names identify the joints.
//!
//! A joint's flexion, abduction and twist are the components of its axis-angle vector along its axes at rest
//! ([`JointAxes`]). Zero is the model's rest pose, which must be roughly flat with the thumb spread. The ranges are
//! strict: those of a healthy adult, active motion. Whoever fits a model to measurements must add a margin, because a
//! model at rest is not exactly at an anatomist's zero, and because its axes are not exactly a person's.
//!
//! Sources:
//! - AAOS: American Academy of Orthopaedic Surgeons, "Joint motion: method of measuring and recording", 1965. Fingers,
//!   wrist, the forearm's rotation, and the thumb's knuckle and hinge.
//! - El-shennawy, Nakamura, Patterson and Viegas, "Three-dimensional kinematic analysis of the second through fifth
//!   carpometacarpal joints", J. Hand Surg. 26A, 2001. The whole arcs of the metacarpals of index, middle, ring and
//!   little finger: flexion 11, 7, 20 and 27 degrees, sideways 2, 4, 7 and 13, twist 5, 5, 27 and 22.
//! - Cooney, Lucca, Chao and Linscheid, "The kinesiology of the thumb trapeziometacarpal joint", J. Bone Joint Surg.
//!   63A, 1981. The whole arcs of the thumb's base: flexion 53 degrees, abduction 42, twist 17.
//! - Lin, Wu and Huang, "Modeling the constraints of human hand motion", 2000. The coupled hinges of a finger.
//!
//! Sources that give a whole arc do not say where a hand at rest is within it. How the table divides an arc is our choice
//! and noted there.

use ghand_core::{HandModel, Pose};
use glam::DVec3;
use rand::{Rng, RngExt};

use super::axes::JointAxes;
use super::names::{Finger, JointRole};

/// The range of an angle, radians; it contains 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AngleRange {
    /// Smallest angle.
    pub low: f64,
    /// Largest angle.
    pub high: f64,
}

impl AngleRange {
    /// The nearest angle in the range.
    pub fn clamp(&self, angle: f64) -> f64 {
        angle.clamp(self.low, self.high)
    }

    /// The part of the range that is at most `spread` from an angle in it.
    fn near(&self, angle: f64, spread: f64) -> AngleRange {
        AngleRange { low: self.clamp(angle - spread), high: self.clamp(angle + spread) }
    }
}

/// The ranges of a joint's three angles; their signs are those of [`JointAxes`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointLimits {
    /// Towards the palm.
    pub flexion: AngleRange,
    /// Away from the middle finger, or the thumb away from the palm.
    pub abduction: AngleRange,
    /// Pronation.
    pub twist: AngleRange,
}

/// The table in degrees.
const fn limits(flexion: [f64; 2], abduction: [f64; 2], twist: [f64; 2]) -> JointLimits {
    const fn range([low, high]: [f64; 2]) -> AngleRange {
        AngleRange { low: low.to_radians(), high: high.to_radians() }
    }
    JointLimits { flexion: range(flexion), abduction: range(abduction), twist: range(twist) }
}

const NONE: [f64; 2] = [0.0, 0.0];

impl JointLimits {
    /// The ranges of a joint.
    ///
    /// Those of the wrist are relative to the forearm. Models have no forearm: their root turns freely.
    pub const fn of(role: JointRole) -> JointLimits {
        use Finger::{Index, Little, Middle, Ring, Thumb};
        match role {
            // AAOS; twist is the forearm's.
            JointRole::Wrist => limits([-70.0, 80.0], [-30.0, 20.0], [-80.0, 80.0]),
            JointRole::Palm | JointRole::Tip(_) => limits(NONE, NONE, NONE),
            // El-shennawy. A flat hand is near the stretched end of the arc: about a quarter of it is extension, and
            // about a quarter of the twist of ring and little finger, which turn to face the thumb as they flex, is
            // pronation. All other arcs are halved.
            JointRole::Metacarpal(Index) => limits([-3.0, 8.0], [-1.0, 1.0], [-2.5, 2.5]),
            JointRole::Metacarpal(Middle) => limits([-2.0, 5.0], [-2.0, 2.0], [-2.5, 2.5]),
            JointRole::Metacarpal(Ring) => limits([-5.0, 15.0], [-3.5, 3.5], [-20.0, 7.0]),
            JointRole::Metacarpal(Little) => limits([-7.0, 20.0], [-6.5, 6.5], [-16.0, 6.0]),
            // Cooney. A spread thumb is near the stretched end of its arc; about a quarter is extension. A third of the
            // sideways arc leads towards the palm, and the thumb pronates as it opposes the fingers.
            JointRole::Metacarpal(Thumb) | JointRole::Bend(Thumb, 1) => {
                limits([-15.0, 38.0], [-14.0, 28.0], [-5.0, 12.0])
            }
            // AAOS. That a hinge has play, and how far axes are off, is part of margins.
            JointRole::Bend(Thumb, 2) => limits([0.0, 50.0], NONE, NONE),
            JointRole::Bend(Thumb, _) => limits([-20.0, 80.0], NONE, NONE),
            JointRole::Bend(_, 1) => limits([-45.0, 90.0], [-20.0, 20.0], NONE),
            JointRole::Bend(_, 2) => limits([0.0, 100.0], NONE, NONE),
            JointRole::Bend(..) => limits([0.0, 90.0], NONE, NONE),
        }
    }

    /// Flexion, abduction, twist.
    pub fn ranges(&self) -> [AngleRange; 3] {
        [self.flexion, self.abduction, self.twist]
    }
}

/// The last hinge of a finger flexes with the one before, because they share a tendon: by [`COUPLED_RATIO`] times its
/// angle, give or take [`COUPLED_SPREAD`]. The thumb's hinges are free (Lin, Wu and Huang; the spread is our choice).
pub const COUPLED_RATIO: f64 = 2.0 / 3.0;

/// See [`COUPLED_RATIO`]; radians.
pub const COUPLED_SPREAD: f64 = 20f64.to_radians();

/// A pose whose angles are uniform in their ranges, each alone, but for the last hinge of a finger, which is uniform in
/// what the one before allows. The root turns as a wrist on a resting forearm does. Fingers may penetrate each other.
/// `None` if the names of the model's joints do not identify the three joints of each finger.
pub fn random_pose(model: &HandModel, rng: &mut impl Rng) -> Option<Pose> {
    let joints = JointRole::of_joints(&model.joint_names).into_iter().zip(JointAxes::of_joints(model)?);
    let mut pose = Pose::rest(model.joint_count());
    // Of the middle hinges, thumb to little finger.
    let mut flexions = [0.0; 5];
    for (rotation, (role, axes)) in pose.rotations.iter_mut().zip(joints) {
        let Some(role) = role else { continue };
        let [mut flexion, abduction, twist] = JointLimits::of(role).ranges();
        if let JointRole::Bend(finger, 3) = role
            && finger != Finger::Thumb
        {
            flexion = flexion.near(COUPLED_RATIO * flexions[finger as usize], COUPLED_SPREAD);
        }
        let angles = [flexion, abduction, twist].map(|range| rng.random_range(range.low..=range.high));
        if let JointRole::Bend(finger, 2) = role {
            flexions[finger as usize] = angles[0];
        }
        *rotation = axes.rotation(DVec3::from_array(angles));
    }
    Some(pose)
}

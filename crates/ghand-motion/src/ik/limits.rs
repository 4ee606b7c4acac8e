//! Ranges of motion of a hand's joints.
//!
//! The ranges are those of the American Academy of Orthopaedic Surgeons ("Joint motion: method of measuring and
//! recording"): fingers, knuckle 90 degrees of bending and 45 of stretching, 20 to either side; middle hinge 100 and 0,
//! last hinge 90 and 0; thumb, base 15 and 20 with 70 away from the palm, knuckle 50 and 0, hinge 80 and 20. A margin
//! is added to each: a skeleton at rest is not at the surgeons' zero, its axes are not exactly a person's, and the
//! three angles of the thumb's base mix. The ranges apply to the components of a joint's axis-angle vector along the
//! axes of its hinge.

use ghand_hand_model::joint_names::Finger;

/// Allowed and likely values of a component, radians.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Range {
    pub low: f64,
    pub high: f64,
    pub mean: f64,
    pub spread: f64,
}

const fn degrees(low: f64, high: f64, mean: f64, spread: f64) -> Range {
    const RADIANS: f64 = std::f64::consts::PI / 180.0;
    Range { low: low * RADIANS, high: high * RADIANS, mean: mean * RADIANS, spread: spread * RADIANS }
}

/// For the three components of a joint, 1 to 3 counted from the palm: bending (negative towards the palm), sideways,
/// twist.
pub(crate) fn ranges(finger: Finger, joint: u8) -> [Range; 3] {
    match (finger, joint) {
        (Finger::Thumb, 1) => {
            [degrees(-75.0, 50.0, 0.0, 50.0), degrees(-75.0, 75.0, 0.0, 40.0), degrees(-50.0, 50.0, 0.0, 20.0)]
        }
        (Finger::Thumb, 2) => {
            [degrees(-75.0, 25.0, -15.0, 50.0), degrees(-35.0, 35.0, 0.0, 20.0), degrees(-20.0, 20.0, 0.0, 8.0)]
        }
        (Finger::Thumb, _) => {
            [degrees(-95.0, 35.0, -20.0, 50.0), degrees(-40.0, 40.0, 0.0, 20.0), degrees(-20.0, 20.0, 0.0, 8.0)]
        }
        (_, 1) => [degrees(-105.0, 45.0, -20.0, 60.0), degrees(-32.0, 32.0, 0.0, 12.0), degrees(-20.0, 20.0, 0.0, 6.0)],
        (_, 2) => [degrees(-120.0, 10.0, -30.0, 60.0), degrees(-15.0, 15.0, 0.0, 4.0), degrees(-12.0, 12.0, 0.0, 4.0)],
        (_, _) => [degrees(-100.0, 20.0, -15.0, 50.0), degrees(-15.0, 15.0, 0.0, 4.0), degrees(-12.0, 12.0, 0.0, 4.0)],
    }
}

/// Two coupled components: `(of - ratio with) / spread` is likely to be small.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Coupling {
    /// Indices into the components of all joints.
    pub of: usize,
    pub with: usize,
    pub ratio: f64,
    pub spread: f64,
}

/// The last hinge of a finger bends with the one before, by about two thirds of it: they share a tendon (Lin, Wu and
/// Huang, "Modeling the constraints of human hand motion", 2000). The thumb's does not.
pub(crate) fn couplings() -> Vec<Coupling> {
    let bend = |finger: usize, joint: usize| 3 * (3 * finger + joint - 1);
    let spread = 20f64.to_radians();
    (1..5).map(|finger| Coupling { of: bend(finger, 3), with: bend(finger, 2), ratio: 2.0 / 3.0, spread }).collect()
}

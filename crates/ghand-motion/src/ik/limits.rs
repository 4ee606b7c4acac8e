//! Ranges of the angles that inverse kinematics fits: the anatomical ones ([`JointLimits`]) with a margin, and what is
//! likely within them.
//!
//! The margins are our choice. A skeleton at rest is not at the zero of an anatomist, its axes are not exactly a
//! person's, and the three angles of the thumb's base mix. Trackers' landmarks also lie on the skin: that a hinge of
//! theirs twists or moves sideways does not mean that the person's does.

use ghand_hand_model::joints::limits::{AngleRange, COUPLED_RATIO, COUPLED_SPREAD, JointLimits};
use ghand_hand_model::joints::names::{Finger, JointRole};

/// Allowed and likely values of an angle, radians.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Range {
    pub low: f64,
    pub high: f64,
    pub mean: f64,
    pub spread: f64,
}

/// What is added to an anatomical range at either end, and the likely value with its spread, degrees.
struct Fit {
    margin: [f64; 2],
    mean: f64,
    spread: f64,
}

const fn fit(margin: [f64; 2], mean: f64, spread: f64) -> Fit {
    Fit { margin, mean, spread }
}

/// For flexion, abduction and twist of a joint, 1 to 3 counted from the palm.
pub(crate) fn ranges(finger: Finger, joint: u8) -> [Range; 3] {
    let fits = match (finger, joint) {
        (Finger::Thumb, 1) => {
            [fit([35.0, 37.0], 0.0, 50.0), fit([61.0, 47.0], 0.0, 40.0), fit([45.0, 38.0], 0.0, 20.0)]
        }
        (Finger::Thumb, 2) => {
            [fit([25.0, 25.0], 15.0, 50.0), fit([35.0, 35.0], 0.0, 20.0), fit([20.0, 20.0], 0.0, 8.0)]
        }
        (Finger::Thumb, _) => {
            [fit([15.0, 15.0], 20.0, 50.0), fit([40.0, 40.0], 0.0, 20.0), fit([20.0, 20.0], 0.0, 8.0)]
        }
        (_, 1) => [fit([0.0, 15.0], 20.0, 60.0), fit([12.0, 12.0], 0.0, 12.0), fit([20.0, 20.0], 0.0, 6.0)],
        (_, 2) => [fit([10.0, 20.0], 30.0, 60.0), fit([15.0, 15.0], 0.0, 4.0), fit([12.0, 12.0], 0.0, 4.0)],
        (_, _) => [fit([20.0, 10.0], 15.0, 50.0), fit([15.0, 15.0], 0.0, 4.0), fit([12.0, 12.0], 0.0, 4.0)],
    };
    let anatomical = JointLimits::of(JointRole::Bend(finger, joint)).ranges();
    std::array::from_fn(|k| widened(anatomical[k], &fits[k]))
}

fn widened(range: AngleRange, fit: &Fit) -> Range {
    let [below, above] = fit.margin.map(f64::to_radians);
    Range {
        low: range.low - below,
        high: range.high + above,
        mean: fit.mean.to_radians(),
        spread: fit.spread.to_radians(),
    }
}

/// Two coupled angles: `(of - ratio with - offset) / spread` is likely to be small.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Coupling {
    /// Indices into the angles of all joints.
    pub of: usize,
    pub with: usize,
    pub ratio: f64,
    pub offset: f64,
    pub spread: f64,
}

impl Coupling {
    /// How far these angles of all joints are from being coupled, radians.
    pub fn error(&self, angles: &[f64]) -> f64 {
        angles[self.of] - self.ratio * angles[self.with] - self.offset
    }
}

/// The flexion of each finger's last hinge is coupled to that of the hinge before.
pub(crate) fn couplings() -> Vec<Coupling> {
    let flexion = |finger: usize, joint: usize| 3 * (3 * finger + joint - 1);
    let coupling = |finger| Coupling {
        of: flexion(finger, 3),
        with: flexion(finger, 2),
        ratio: COUPLED_RATIO,
        offset: 0.0,
        spread: COUPLED_SPREAD,
    };
    (1..5).map(coupling).collect()
}

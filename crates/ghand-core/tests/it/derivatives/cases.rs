//! Random cases and the extremes from which they are drawn.

use std::f64::consts::{PI, TAU};

use proptest::prelude::*;
use proptest::sample::select;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Critical angles: of all joints at once, about random axes.
const ANGLES: [(&str, f64); 12] = [
    ("0", 0.0),
    ("1e-300", 1e-300),
    ("1e-12", 1e-12),
    ("1e-8", 1e-8),
    ("1e-4", 1e-4),
    ("0.5 (branches meet)", 0.5),
    ("pi - 1e-9", PI - 1e-9),
    ("pi", PI),
    ("pi + 1e-9", PI + 1e-9),
    ("2 pi", TAU),
    ("100", 100.0),
    // Each joint has one of the above or a random one.
    ("mixed", f64::NAN),
];

/// Sizes of the hand and of its distance from the origin, metres.
const PLACES: [(&str, f64, f64); 5] = [
    ("1e-6 m", 1e-6, 0.0),
    ("0.1 m", 0.1, 0.0),
    ("1 m", 1.0, 0.0),
    ("1e3 m", 1e3, 0.0),
    ("0.1 m, 1e3 m away", 0.1, 1e3),
];

#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Weights {
    OneHot,
    Uniform,
    Unnormalised,
    Normalised,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Residuals {
    Zero,
    PlusMinusOne,
    Any,
}

/// The parameters of a case; all numbers follow from `seed`.
#[derive(Debug, Clone)]
pub struct Case {
    pub angle: (&'static str, f64),
    pub place: (&'static str, f64, f64),
    pub joints: usize,
    pub points: usize,
    pub bases: usize,
    pub weights: Weights,
    pub residuals: Residuals,
    pub zero_sum: bool,
    pub anchored: bool,
    /// Whether the loss has a quadratic part.
    pub quadratic: bool,
    /// Largest shape parameter.
    pub shape: f64,
    pub seed: u64,
}

/// The extremes that matter for a problem.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum About {
    Angle,
    Place,
    Rig,
    Weights,
    Residuals,
    ZeroSum,
    Anchored,
}

prop_compose! {
    pub fn cases()(
        angle in select(&ANGLES[..]),
        place in select(&PLACES[..]),
        // Enough skeletons of one joint and of 25 for every extreme to occur with both.
        joints in prop_oneof![3 => Just(1_usize), 5 => 2_usize..7, 1 => Just(25_usize)],
        points in 1_usize..5,
        bases in 0_usize..3,
        weights in select(&[Weights::OneHot, Weights::Uniform, Weights::Unnormalised, Weights::Normalised][..]),
        residuals in select(&[Residuals::Zero, Residuals::PlusMinusOne, Residuals::Any][..]),
        (zero_sum, anchored, quadratic) in any::<(bool, bool, bool)>(),
        shape in select(&[0.0, 1.0, 10.0][..]),
        seed in 0_u64..1_000_000_000,
    ) -> Case {
        Case { angle, place, joints, points, bases, weights, residuals, zero_sum, anchored, quadratic, shape, seed }
    }
}

impl Case {
    pub fn rng(&self) -> ChaCha8Rng {
        ChaCha8Rng::seed_from_u64(self.seed)
    }

    pub fn extremes(&self, about: &[About]) -> Vec<String> {
        let name = |a: &About| match a {
            About::Angle => format!("angle {}", self.angle.0),
            About::Place => format!("coordinates {}", self.place.0),
            About::Rig if [1, 25].contains(&self.joints) => format!("joints {}", self.joints),
            About::Rig => "joints 2 to 6".into(),
            About::Weights => format!("weights {:?}", self.weights),
            About::Residuals => format!("residual weights {:?}", self.residuals),
            About::ZeroSum => format!("ResidualWeights {}", if self.zero_sum { "ZeroSum" } else { "Paper" }),
            About::Anchored => format!("ResidualSkeleton {}", if self.anchored { "Anchored" } else { "Paper" }),
        };
        about.iter().map(name).collect()
    }

    /// A random tree, and sometimes one long chain; parents first.
    pub fn parents(&self, rng: &mut ChaCha8Rng) -> Vec<Option<usize>> {
        let long = rng.random_range(0..4) == 0;
        (0..self.joints)
            .map(|k| k.checked_sub(1).map(|last| if long { last } else { rng.random_range(0..k) }))
            .collect()
    }

    /// `n` axis-angle vectors, flat.
    pub fn rotations(&self, rng: &mut ChaCha8Rng, n: usize) -> Vec<f64> {
        let one = |rng: &mut ChaCha8Rng| {
            let mut angle = self.angle.1;
            if angle.is_nan() {
                let chosen = ANGLES[rng.random_range(0..ANGLES.len())].1;
                angle = if chosen.is_nan() { rng.random_range(0.0..7.0) } else { chosen };
            }
            let axis = axis(rng);
            axis.map(|a| a * angle)
        };
        (0..n).flat_map(|_| one(rng)).collect()
    }

    /// Coordinates of `n` points, flat, metres.
    pub fn points(&self, rng: &mut ChaCha8Rng, n: usize) -> Vec<f64> {
        let (_, size, away) = self.place;
        (0..3 * n).map(|_| away + size * rng.random_range(-1.0..1.0)).collect()
    }

    /// Skinning weights, `[n_b][n]`.
    pub fn weights(&self, rng: &mut ChaCha8Rng, n: usize) -> Vec<f64> {
        let joints = self.joints;
        let mut all = vec![0.0; joints * n];
        for p in 0..n {
            let chosen = rng.random_range(0..joints);
            let column: Vec<f64> = (0..joints)
                .map(|k| match self.weights {
                    Weights::OneHot => f64::from(k == chosen),
                    Weights::Uniform => 1.0 / joints as f64,
                    Weights::Unnormalised => rng.random_range(-0.5..2.0),
                    Weights::Normalised => rng.random_range(0.0..1.0),
                })
                .collect();
            let sum: f64 = if self.weights == Weights::Normalised { column.iter().sum() } else { 1.0 };
            column.iter().enumerate().for_each(|(k, w)| all[k * n + p] = w / sum);
        }
        all
    }

    /// Residual weights, `[n_b][n]`.
    pub fn residual_weights(&self, rng: &mut ChaCha8Rng, n: usize) -> Vec<f64> {
        let one = |rng: &mut ChaCha8Rng| match self.residuals {
            Residuals::Zero => 0.0,
            Residuals::PlusMinusOne => [-1.0, 1.0][rng.random_range(0..2)],
            Residuals::Any => rng.random_range(-1.0..1.0),
        };
        (0..self.joints * n).map(|_| one(rng)).collect()
    }
}

/// `n` numbers in -1..1.
pub fn uniform(rng: &mut ChaCha8Rng, n: usize) -> Vec<f64> {
    (0..n).map(|_| rng.random_range(-1.0..1.0)).collect()
}

/// A unit vector, sometimes along a coordinate axis.
fn axis(rng: &mut ChaCha8Rng) -> [f64; 3] {
    let mut axis = [0.0; 3];
    if rng.random_range(0..5) == 0 {
        axis[rng.random_range(0..3)] = [-1.0, 1.0][rng.random_range(0..2)];
        return axis;
    }
    loop {
        axis = std::array::from_fn(|_| rng.random_range(-1.0..1.0));
        let length = axis.iter().map(|a| a * a).sum::<f64>().sqrt();
        if (0.1..1.0).contains(&length) {
            return axis.map(|a| a / length);
        }
    }
}

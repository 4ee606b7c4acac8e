//! How much each cue counts, from how far the cues' estimates of the poses disagree: variance components, by maximum
//! likelihood (Förstner's estimator). A cue that claims to be surer than it is disagrees with the others by more than it
//! claims.

use nalgebra::{DMatrix, DVector, SymmetricEigen};
use rayon::prelude::*;

use crate::alignment::inverse;

/// A cue's directions count if it knows the pose along them better than this: rotations in radians, translation in
/// metres.
const ROTATION: f64 = 3.0_f64.to_radians();
const TRANSLATION: f64 = 0.001;
/// Before anything is measured a cue is believed, as if so many directions had agreed as it claims.
const BELIEVED: f64 = 5.0;
/// Rounds in which poses and factors settle.
const ROUNDS: usize = 8;

/// What a cue says about a frame's pose: half its squared residuals, to second order about the present pose.
#[derive(Debug, Clone, PartialEq)]
pub struct Cue {
    pub information: DMatrix<f64>,
    pub gradient: DVector<f64>,
}

impl Cue {
    /// A cue that says nothing.
    pub fn nothing(unknowns: usize) -> Cue {
        Cue { information: DMatrix::zeros(unknowns, unknowns), gradient: DVector::zeros(unknowns) }
    }
}

/// A direction that a cue alone knows: in scaled axes an eigenvector of its information.
struct Direction {
    information: f64,
    /// Gradient along it.
    gradient: f64,
    /// Turns a step into how far it goes along the direction.
    along: DVector<f64>,
}

/// A frame's step and the covariance of its error.
type Solved = (DVector<f64>, DMatrix<f64>);

/// Steps of all frames, and how many times larger than claimed each cue's variance is.
#[derive(Debug, Clone, PartialEq)]
pub struct Agreed {
    pub steps: Vec<DVector<f64>>,
    pub factors: Vec<f64>,
}

/// Solves for all frames' steps. `cues` are by frame, `priors` are always believed. No factor becomes smaller than
/// `least`'s. All unknowns have a part in the factors, but only those in `moving` change.
pub fn agree(cues: &[Vec<Cue>], priors: &[Cue], least: &[f64], moving: &[usize]) -> Agreed {
    let directions: Vec<Vec<Vec<Direction>>> =
        cues.par_iter().map(|frame| frame.iter().map(directions).collect()).collect();
    let mut factors = vec![1.0; least.len()];
    for _ in 0..ROUNDS {
        let solve = |(frame, prior): (&Vec<Cue>, &Cue)| {
            let sum = sum(frame, prior, &factors);
            let covariance = inverse(&sum.information);
            (-(&covariance * sum.gradient), covariance)
        };
        let solved: Vec<Solved> = cues.par_iter().zip(priors).map(solve).collect();
        let of_frame = |(frame, solved): (&Vec<Vec<Direction>>, &Solved)| {
            let (step, covariance) = solved;
            let of_cue = |(directions, factor): (&Vec<Direction>, &f64)| -> [f64; 2] {
                let known = directions.iter().filter(|direction| direction.information > *factor);
                known.fold([0.0; 2], |[squares, free], direction| {
                    let left = direction.gradient + direction.information * direction.along.dot(step);
                    let posterior = direction.along.dot(&(covariance * &direction.along));
                    [
                        squares + left * left / direction.information,
                        free + 1.0 - direction.information / factor * posterior,
                    ]
                })
            };
            frame.iter().zip(&factors).map(of_cue).collect::<Vec<[f64; 2]>>()
        };
        let parts: Vec<Vec<[f64; 2]>> = directions.par_iter().zip(&solved).map(of_frame).collect();
        for (cue, factor) in factors.iter_mut().enumerate() {
            let [squares, free] = [0, 1].map(|k| parts.iter().map(|part| part[cue][k]).sum::<f64>());
            *factor = ((squares + BELIEVED) / (free + BELIEVED)).max(least[cue]);
        }
    }
    let step = |(frame, prior): (&Vec<Cue>, &Cue)| {
        let sum = sum(frame, prior, &factors);
        let covariance = inverse(&sum.information.select_rows(moving).select_columns(moving));
        let found = -(covariance * sum.gradient.select_rows(moving));
        let mut step = DVector::zeros(sum.gradient.len());
        moving.iter().zip(found.iter()).for_each(|(unknown, value)| step[*unknown] = *value);
        step
    };
    Agreed { steps: cues.par_iter().zip(priors).map(step).collect(), factors }
}

fn sum(frame: &[Cue], prior: &Cue, factors: &[f64]) -> Cue {
    let mut sum = prior.clone();
    for (cue, factor) in frame.iter().zip(factors) {
        sum.information += &cue.information / *factor;
        sum.gradient += &cue.gradient / *factor;
    }
    sum
}

fn directions(cue: &Cue) -> Vec<Direction> {
    let count = cue.gradient.len();
    let scale = DVector::from_fn(count, |k, _| if k + 3 < count { ROTATION } else { TRANSLATION });
    let scaled = DMatrix::from_fn(count, count, |i, j| scale[i] * cue.information[(i, j)] * scale[j]);
    let gradient = cue.gradient.component_mul(&scale);
    let eigen = SymmetricEigen::new(scaled);
    let direction = |(information, vector): (&f64, nalgebra::DVectorView<f64>)| Direction {
        information: *information,
        gradient: vector.dot(&gradient),
        along: vector.component_div(&scale),
    };
    eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()).map(direction).collect()
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    #[test]
    fn factors_are_those_by_which_cues_claim_too_much() {
        // Three cues of nine unknowns in 200 frames; the second errs with three times the variance that it claims, the
        // third with a quarter of it.
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let mut normal = || (0..12).map(|_| rng.random::<f64>() - 0.5).sum::<f64>();
        let frames = 200;
        let count = 9;
        let true_factors = [1.0, 3.0, 0.25];
        let scale = DVector::from_fn(count, |k, _| if k < 6 { 0.1 * ROTATION } else { 0.1 * TRANSLATION });
        let cues: Vec<Vec<Cue>> = (0..frames)
            .map(|_| {
                let of_cue = |factor: &f64| {
                    let mixed = DMatrix::from_fn(count, count, |i, j| f64::from(u8::from(i == j)) + 0.2 * normal());
                    let root = mixed * DMatrix::from_diagonal(&scale.map(f64::recip));
                    // Pulls towards 0 with an error of covariance factor x information^-1.
                    let noise = DVector::from_fn(count, |_, _| factor.sqrt() * normal());
                    Cue { information: root.transpose() * &root, gradient: root.transpose() * noise }
                };
                true_factors.iter().map(of_cue).collect()
            })
            .collect();
        let priors = vec![Cue { information: DMatrix::identity(count, count), ..Cue::nothing(count) }; frames];
        let all: Vec<usize> = (0..count).collect();
        let agreed = agree(&cues, &priors, &[0.01; 3], &all);
        for (found, truth) in agreed.factors.iter().zip(true_factors) {
            assert!((found / truth - 1.0).abs() < 0.2, "{:?}", agreed.factors);
        }
        // Steps are nearer to the truth than those of cues that are all believed.
        let error =
            |steps: &[DVector<f64>]| -> f64 { steps.iter().map(|s| s.component_div(&scale).norm_squared()).sum() };
        let believed = agree(&cues, &priors, &[1e9; 3], &all);
        assert!(believed.factors.iter().all(|factor| *factor == 1e9), "no factor below its bound");
        let equal: Vec<DVector<f64>> = (cues.iter())
            .map(|frame| {
                let information: DMatrix<f64> = frame.iter().map(|cue| &cue.information).sum();
                let gradient: DVector<f64> = frame.iter().map(|cue| &cue.gradient).sum();
                -(inverse(&information) * gradient)
            })
            .collect();
        assert!(error(&agreed.steps) < 0.6 * error(&equal), "{} {}", error(&agreed.steps), error(&equal));
    }

    #[test]
    fn cues_that_say_nothing_are_neither_doubted_nor_trusted() {
        let mut sure = Cue { information: 1e6 * DMatrix::identity(6, 6), ..Cue::nothing(6) };
        sure.gradient[1] = 1e4;
        let priors = vec![Cue { information: DMatrix::identity(6, 6), ..Cue::nothing(6) }; 3];
        let cues = vec![vec![sure, Cue::nothing(6)]; 3];
        let agreed = agree(&cues, &priors, &[0.01, 0.01], &[0, 1, 2, 3, 4, 5]);
        assert_eq!(agreed.factors[1], 1.0);
        assert!((agreed.steps[0][1] + 0.01).abs() < 1e-4, "{}", agreed.steps[0]);
        let others = agree(&cues, &priors, &[0.01, 0.01], &[0, 4]);
        assert!(others.steps[0].norm() == 0.0 && others.factors == agreed.factors, "only unknown 1 is pulled");
    }
}

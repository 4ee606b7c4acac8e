use ghand_core::{HandModel, Pose, Side};
use ghand_hand_model::builtin::builtin_hand;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::ik::HandIk;
use crate::ik::person::sightings::{SeenFrame, Sighting, SightingPosition};
use crate::motions::motion;
use crate::rest_skeleton::RestSkeleton;

const FRAMES: usize = 90;
const STEP: f64 = 1.0 / 30.0;
const NOISE: f64 = 0.003;

/// A hand, its poses, and landmarks with noise. Those of the little finger are hidden for [`HIDDEN`].
struct Film {
    hand: HandIk,
    truth: Vec<[f64; UNKNOWNS]>,
    seen: Vec<SeenFrame>,
}

/// Frames in which the little finger is hidden.
const HIDDEN: std::ops::Range<usize> = 40..46;
const LITTLE_FINGER: std::ops::Range<usize> = 18..21;

fn model() -> HandModel {
    builtin_hand(Side::Right).unwrap()
}

impl Film {
    fn new(seed: u64) -> Film {
        let model = model();
        let hand = HandIk::new(&RestSkeleton::of(&model).unwrap());
        let tour = motion("tour", &model, 1.0 / STEP).unwrap().unwrap().frames;
        let start = 70 * seed as usize % (tour.len() - FRAMES);
        let poses: Vec<Pose> = tour[start..start + FRAMES].iter().map(|frame| frame.pose.clone()).collect();
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut noise = || (0..12).map(|_| rng.random_range(-0.5..0.5)).sum::<f64>() * NOISE;
        let mut seen = vec![];
        for (k, pose) in poses.iter().enumerate() {
            let mut sightings = vec![];
            for (landmark, at) in hand.landmarks(pose).into_iter().enumerate() {
                let place = SightingPosition::Point(at + DVec3::new(noise(), noise(), noise()));
                if !(HIDDEN.contains(&k) && LITTLE_FINGER.contains(&landmark)) {
                    sightings.push(Sighting { landmark, confidence: 1.0, place });
                }
            }
            seen.push(SeenFrame { id: String::new(), sightings });
        }
        let truth = poses.iter().map(|pose| hand.unknowns(pose)).collect();
        Film { hand, truth, seen }
    }

    /// Each frame by itself.
    fn frames(&self) -> Vec<FilmFrame<'_>> {
        let frame = |(k, (seen, x)): (usize, (&'_ SeenFrame, &[f64; UNKNOWNS]))| {
            let fit = FrameFit { hand: &self.hand, seen, cameras: &[], scales: &[], noise: NOISE };
            (fit.solve(*x, 60).1, k)
        };
        let solved: Vec<_> = self.seen.iter().zip(&self.truth).enumerate().map(frame).collect();
        let film = solved.into_iter().zip(&self.seen).map(|((x, k), seen)| {
            let fit = FrameFit { hand: &self.hand, seen, cameras: &[], scales: &[], noise: NOISE };
            FilmFrame::new(fit, STEP * k as f64, x)
        });
        film.collect()
    }

    /// Root mean square distance of landmarks from the true ones, metres.
    fn error(&self, frames: &[FilmFrame], chosen: std::ops::Range<usize>, landmarks: std::ops::Range<usize>) -> f64 {
        let mut squares = vec![];
        for k in chosen {
            let [found, truth] = [&frames[k].x, &self.truth[k]].map(|x| self.hand.landmarks(&self.hand.pose(x)));
            squares.extend(landmarks.clone().map(|i| found[i].distance_squared(truth[i])));
        }
        (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
    }
}

#[test]
fn poses_of_a_film_are_nearer_to_the_truth_together_and_a_hidden_finger_follows_its_film() {
    for seed in [1, 2, 3] {
        let film = Film::new(seed);
        let mut frames = film.frames();
        let errors =
            |frames: &[FilmFrame]| [film.error(frames, 0..FRAMES, 0..21), film.error(frames, HIDDEN, LITTLE_FINGER)];
        let alone = errors(&frames);
        let multiple = smooth(&mut frames).unwrap();
        let together = errors(&frames);
        println!(
            "multiple {multiple}; mm: {:.2?} alone, {:.2?} together",
            alone.map(|e| 1e3 * e),
            together.map(|e| 1e3 * e)
        );
        assert!(together[0] < 0.8 * alone[0] && together[1] < 0.5 * alone[1], "{alone:?} {together:?}");
    }
}

#[test]
fn pictures_that_do_not_follow_each_other_stay_as_they_are() {
    let film = Film::new(4);
    // In no order of time.
    let mut frames = film.frames();
    let ordered = frames.clone();
    for (k, frame) in frames.iter_mut().enumerate() {
        *frame = FilmFrame { time: frame.time, ..ordered[k * 37 % FRAMES] };
    }
    let before: Vec<_> = frames.iter().map(|frame| frame.x).collect();
    let multiple = smooth(&mut frames).unwrap();
    assert_eq!(multiple, MULTIPLES[MULTIPLES.len() - 1]);
    let moved = |(frame, x): (&FilmFrame, &[f64; UNKNOWNS])| {
        let [a, b] = [&frame.x, x].map(|x| film.hand.landmarks(&film.hand.pose(x)));
        a.iter().zip(b).map(|(a, b)| a.distance(b)).fold(0.0, f64::max)
    };
    let largest = frames.iter().zip(&before).map(moved).fold(0.0, f64::max);
    assert!(largest < 0.002, "{largest}");
}

#[test]
fn steps_are_along_the_derivative_of_the_cost() {
    let film = Film::new(5);
    let mut frames = film.frames();
    frames.truncate(5);
    // Uneven times, and a root far from rest.
    for (k, frame) in frames.iter_mut().enumerate() {
        frame.time += 0.004 * (k % 2) as f64;
        write(&mut frame.x, 0, DVec3::new(1.2, -1.5, 0.4 + 0.05 * k as f64));
        frame.is_left_out = k == 3;
    }
    let (_, gradient) = normal_equations(&frames, 1.0);
    let slope = |at: usize| {
        let cost = |by: f64| {
            let mut step = vec![0.0; UNKNOWNS];
            step[at % UNKNOWNS] = by;
            let mut moved = frames.clone();
            follow(&mut moved[at / UNKNOWNS], &step);
            total_cost(&moved, 1.0)
        };
        (cost(-1e-6) - cost(1e-6)) / 2e-6
    };
    let largest = gradient.iter().fold(0.0, |most: f64, value| most.max(value.abs()));
    for (at, value) in gradient.iter().enumerate() {
        // Angles at an end of their range do not move.
        if *value != 0.0 && (at % UNKNOWNS) < 6 {
            assert!(
                (slope(at) - 2.0 * value).abs() < 2e-3 * value.abs() + 1e-5 * largest,
                "{at}: {} {value}",
                slope(at)
            );
        }
    }
}

#[test]
fn banded_equations_have_the_solution_of_dense_ones() {
    let film = Film::new(6);
    let frames = &film.frames()[..6];
    let (band, gradient) = normal_equations(frames, 1.0);
    let count = gradient.len();
    let dense = nalgebra::DMatrix::from_fn(count, count, |i, j| {
        let (i, j) = (i.min(j), i.max(j));
        band[i].get(j - i).copied().unwrap_or(0.0)
    });
    let expected = dense.cholesky().unwrap().solve(&nalgebra::DVector::from_vec(gradient.clone()));
    let step = solve(&band, &gradient, 0.0).unwrap();
    let largest = expected.amax();
    assert!(step.iter().zip(expected.iter()).all(|(a, b)| (a - b).abs() < 1e-7 * largest));
}

//! The choice of frames: sharp and sure ones that differ most, in the hand's pose and in the side that it shows.

use glam::DVec3;

use crate::rig::LANDMARKS;

/// Frames whose landmarks are this many times the median off the fitted hand are wrong.
const MOST_ERROR: f64 = 2.5;
/// Frames in which the hand is less sharp than this, relative to the sharpest tenth of its camera, are blurred.
const LEAST_SHARPNESS: f64 = 0.55;
/// Frames that are next to each other show the same; chosen ones are at least so far apart, seconds.
const LEAST_INTERVAL: f64 = 0.1;
/// One chosen frame of so many is held out.
const HELD_OUT_EVERY: usize = 5;

/// A frame that may be chosen.
#[derive(Debug, Clone)]
pub struct Candidate {
    /// Its time by the first camera's clock, seconds.
    pub time: f64,
    /// The hand's landmarks, metres, world.
    pub points: [DVec3; LANDMARKS],
    /// How far landmarks are off the fitted hand, relative to the hand's length.
    pub error: f64,
    /// How sharp the hand is in its worst image, relative to the sharpest tenth of that camera's images.
    pub sharpness: f64,
    /// Whether the whole hand is in all images.
    pub is_inside: bool,
    /// How far the hand moves between the moments that its images show, and while each is exposed, relative to its
    /// length.
    pub blur: f64,
    /// Number of cameras that see the hand.
    pub views: usize,
}

/// The largest [`Candidate::blur`].
const MOST_BLUR: f64 = 0.04;

/// Chosen frames.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Choice {
    /// Frames to train with and to hold out, as indices of the candidates, in the order of time.
    pub train: Vec<usize>,
    /// See above.
    pub test: Vec<usize>,
    /// Why frames cannot be used, with their number.
    pub rejected: Vec<(&'static str, usize)>,
}

/// Why a frame cannot be used, and whether it can.
type Test<'a> = (&'static str, &'a dyn Fn(&Candidate) -> bool);

/// Chooses at most `count` frames, all seen by as many cameras as can be asked of enough frames.
pub fn choose(candidates: &[Candidate], count: usize) -> Choice {
    let mut errors: Vec<f64> = candidates.iter().map(|frame| frame.error).collect();
    errors.sort_by(f64::total_cmp);
    let most_error = MOST_ERROR * errors.get(errors.len() / 2).copied().unwrap_or(0.0);
    let most_views = candidates.iter().map(|frame| frame.views).max().unwrap_or(0);
    let tests: [Test; 5] = [
        ("the hand is not in the images of all cameras", &|frame| frame.views == most_views),
        ("the hand reaches over the border of an image", &|frame| frame.is_inside),
        ("the landmarks contradict each other", &|frame| frame.error <= most_error),
        ("the hand moves too fast", &|frame| frame.blur <= MOST_BLUR),
        ("the image of the hand is blurred", &|frame| frame.sharpness >= LEAST_SHARPNESS),
    ];
    let mut rejected: Vec<(&'static str, usize)> = tests.iter().map(|(reason, _)| (*reason, 0)).collect();
    let mut usable = vec![];
    for (k, frame) in candidates.iter().enumerate() {
        match tests.iter().position(|(_, test)| !test(frame)) {
            Some(failed) => rejected[failed].1 += 1,
            None => usable.push(k),
        }
    }
    rejected.retain(|(_, frames)| *frames > 0);
    let mut chosen = vec![];
    // The distance of each usable frame from the nearest chosen one.
    let mut distances = vec![f64::INFINITY; usable.len()];
    while chosen.len() < count {
        let score = |place: usize| {
            let frame = &candidates[usable[place]];
            let quality = frame.sharpness.min(1.0) / (1.0 + frame.error / most_error.max(1e-12));
            distances[place].min(1e6) * quality
        };
        let Some(best) =
            (0..usable.len()).filter(|p| distances[*p] > 0.0).max_by(|a, b| score(*a).total_cmp(&score(*b)))
        else {
            break;
        };
        chosen.push(usable[best]);
        let of_best = &candidates[usable[best]];
        for (place, k) in usable.iter().enumerate() {
            let near = (candidates[*k].time - of_best.time).abs() < LEAST_INTERVAL;
            let distance = if near { 0.0 } else { difference(&candidates[*k].points, &of_best.points) };
            distances[place] = distances[place].min(distance);
        }
    }
    chosen.sort_unstable();
    let (mut train, mut test) = (vec![], vec![]);
    for (place, k) in chosen.into_iter().enumerate() {
        if place % HELD_OUT_EVERY == HELD_OUT_EVERY / 2 { test.push(k) } else { train.push(k) }
    }
    Choice { train, test, rejected }
}

/// How differently the hand is posed and turned: root mean square distance of landmarks from the wrists, metres.
fn difference(a: &[DVec3; LANDMARKS], b: &[DVec3; LANDMARKS]) -> f64 {
    let squares: f64 = (0..LANDMARKS).map(|k| ((a[k] - a[0]) - (b[k] - b[0])).length_squared()).sum();
    (squares / LANDMARKS as f64).sqrt()
}

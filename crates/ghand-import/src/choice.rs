//! The choice of frames: sharp and sure ones that differ most, in the hand's pose and in the side that it shows.

use glam::DVec3;

use crate::rig::LANDMARKS;

/// Frames whose landmarks are this many times the median off the fitted hand are wrong.
const MOST_ERROR: f64 = 2.5;
/// Frames in which the hand is less sharp than this, relative to the sharpest tenth of its camera, are blurred.
pub const LEAST_SHARPNESS: f64 = 0.55;
/// Frames that are next to each other show the same; chosen ones are at least so far apart, seconds.
const LEAST_INTERVAL: f64 = 0.1;
/// Frames to choose from, for each that is to be chosen.
const ENOUGH: usize = 2;
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
    /// Whether no other hand is before or behind it in any image.
    pub is_alone: bool,
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
    let views = views_to_ask(candidates, count);
    let tests: [Test; 6] = [
        ("too few cameras see the hand", &|frame| frame.views >= views),
        ("the hand reaches over the border of an image", &|frame| frame.is_inside),
        ("another hand is in front of it or behind it", &|frame| frame.is_alone),
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

/// In how many cameras' images the hand must be, so that enough frames are left to choose from.
fn views_to_ask(candidates: &[Candidate], count: usize) -> usize {
    let most = candidates.iter().map(|frame| frame.views).max().unwrap_or(0);
    let enough = (ENOUGH * count).min(candidates.len() / 2);
    let left = |views: usize| candidates.iter().filter(|frame| frame.views >= views).count();
    // One camera alone tells poses badly.
    let needed = |views: usize| if views == 2 { enough.min(count / 2) } else { enough };
    (1..=most).rev().find(|views| left(*views) >= needed(*views)).unwrap_or(1)
}

/// How differently the hand is posed and turned: root mean square distance of landmarks from the wrists, metres.
fn difference(a: &[DVec3; LANDMARKS], b: &[DVec3; LANDMARKS]) -> f64 {
    let squares: f64 = (0..LANDMARKS).map(|k| ((a[k] - a[0]) - (b[k] - b[0])).length_squared()).sum();
    (squares / LANDMARKS as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A frame at a time, with the hand turned by as many radians, in the images of some cameras.
    fn frame(time: f64, turn: f64, views: usize) -> Candidate {
        let points = std::array::from_fn(|k| 0.01 * k as f64 * DVec3::new(turn.cos(), turn.sin(), 0.0));
        Candidate { time, points, error: 0.01, sharpness: 1.0, is_inside: true, is_alone: true, blur: 0.0, views }
    }

    #[test]
    fn different_frames_are_chosen_and_unusable_ones_counted() {
        let mut frames: Vec<Candidate> = (0..100).map(|k| frame(f64::from(k) / 30.0, f64::from(k / 10), 2)).collect();
        frames[3].error = 0.1;
        frames[4].is_inside = false;
        frames[5].blur = 0.5;
        frames[6].sharpness = 0.2;
        frames[7].views = 1;
        frames[8].is_alone = false;
        let choice = choose(&frames, 10);
        assert_eq!((choice.train.len(), choice.test.len()), (8, 2));
        // One of each of the ten turns.
        let mut turns: Vec<usize> = choice.train.iter().chain(&choice.test).map(|k| k / 10).collect();
        turns.sort_unstable();
        assert_eq!(turns, (0..10).collect::<Vec<_>>());
        assert!(choice.rejected.len() == 6 && choice.rejected.iter().all(|(_, count)| *count == 1), "{choice:?}");
        assert!(choose(&[], 10).train.is_empty());
    }

    #[test]
    fn a_camera_that_seldom_sees_the_hand_does_not_decide() {
        let frames: Vec<Candidate> =
            (0..100).map(|k| frame(f64::from(k) / 5.0, f64::from(k), if k < 5 { 4 } else { 3 })).collect();
        let choice = choose(&frames, 20);
        assert_eq!(choice.train.len() + choice.test.len(), 20);
    }
}

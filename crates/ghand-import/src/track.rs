//! One hand in one camera's footage: where its landmarks are in each frame.

use ghand_core::Side;
use ghand_tracker::{HandTracker, TrackedHand, TrackerError};
use glam::{DVec2, DVec3};
use serde::{Deserialize, Serialize};

use crate::rig::LANDMARKS;
use crate::sharpness::sharpness;
use crate::stillness::Stillness;

/// Hands in more than this part of the frames with a hand are a second one; in fewer they are mistakes.
const SECOND_HAND: f64 = 0.05;
/// Frames from one to the next in which it is looked whether the camera moves.
const STILLNESS_EVERY: usize = 6;
/// Tracks shorter than this do not say which hand they are, frames.
const LEAST_TRACK: usize = 5;

/// A hand in a frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Sighting {
    /// Landmarks in MediaPipe's order, pixels of the image as filmed; the first one's middle is (0.5, 0.5).
    pub pixels: [DVec2; LANDMARKS],
    /// The same in space as the tracker guesses: metres, x right, y down, z away, any origin.
    pub world: [DVec3; LANDMARKS],
    /// How sure the tracker is that this is a hand, 0 to 1.
    pub presence: f64,
    /// How sharp the image is at the hand, relative to its contrast; 0 where that is unknown.
    pub sharpness: f64,
    /// The other hands in the image.
    #[serde(skip)]
    pub others: Vec<OtherHand>,
}

/// Another hand in the same image, as in [`Sighting`].
#[derive(Debug, Clone, PartialEq)]
pub struct OtherHand {
    /// Landmarks, pixels.
    pub pixels: [DVec2; LANDMARKS],
    /// Landmarks in space, metres.
    pub world: [DVec3; LANDMARKS],
}

impl Sighting {
    /// How near a landmark of another hand comes to one of this, pixels; `None` where the image shows no other.
    pub fn gap(&self) -> Option<f64> {
        let squared = |other: &OtherHand| {
            let to = |a: &DVec2| other.pixels.iter().map(|b| a.distance_squared(*b)).fold(f64::INFINITY, f64::min);
            self.pixels.iter().map(to).fold(f64::INFINITY, f64::min)
        };
        self.others.iter().map(squared).reduce(f64::min).map(f64::sqrt)
    }
}

/// One hand in the footage of one camera.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Track {
    /// Time of each frame by the camera's clock, seconds.
    pub times: Vec<f64>,
    /// The hand in each frame; `None` where it was not found.
    pub sightings: Vec<Option<Sighting>>,
}

/// All hands of a footage, while it is tracked.
pub struct Tracking {
    tracker: HandTracker,
    /// The hands of each frame, by identity.
    frames: Vec<Vec<(usize, Sighting)>>,
    /// By identity: the last estimate of how sure it is that this is a right hand, and the number of frames.
    right: Vec<(f64, usize)>,
    stillness: Stillness,
}

/// The hands of one footage.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Hands {
    /// Number of frames.
    pub frames: usize,
    /// Frames with a hand, with two or more, and with two or more of one side.
    pub with_hand: usize,
    /// See above.
    pub with_several: usize,
    /// See above.
    pub with_same_side: usize,
    /// Frames with a right and with a left hand.
    pub by_side: [usize; 2],
    /// How far what is behind the hands shifts in the images, relative to their width: 0 if the camera stands still.
    pub shift: f64,
    hands: Vec<Vec<SidedHand>>,
}

#[derive(Debug, Clone, Serialize, Deserialize)]
struct SidedHand {
    right: bool,
    sighting: Sighting,
}

impl Tracking {
    /// Begins.
    pub(crate) fn new() -> Tracking {
        Tracking { tracker: HandTracker::new(2), frames: vec![], right: vec![], stillness: Stillness::default() }
    }

    /// Looks at the next frame: red, green and blue, row by row.
    ///
    /// # Errors
    /// If the bytes are not an image of that size.
    pub fn add(&mut self, rgb: &[u8], width: u32, height: u32) -> Result<(), TrackerError> {
        let hands = self.tracker.track(rgb, width, height)?;
        let mut frame = vec![];
        for hand in hands {
            let identity = hand.identity as usize;
            if self.right.len() <= identity {
                self.right.resize(identity + 1, (0.5, 0));
            }
            let right = if hand.side == Side::Right { hand.side_score } else { 1.0 - hand.side_score };
            self.right[identity] = (right, self.right[identity].1 + 1);
            let sharpness = sharpness(rgb, width as usize, height as usize, &hand.landmarks);
            let TrackedHand { landmarks: pixels, world, presence, .. } = hand;
            frame.push((identity, Sighting { pixels, world, presence, sharpness, others: vec![] }));
        }
        self.push(rgb, width, height, frame);
        Ok(())
    }

    /// Takes the landmarks of a hand of a side in the next frame from elsewhere; `None` if it is not seen.
    ///
    /// # Errors
    /// If the bytes are not an image of that size.
    pub fn add_given(
        &mut self,
        rgb: &[u8],
        width: u32,
        height: u32,
        pixels: Option<&[DVec2; LANDMARKS]>,
        side: Side,
    ) -> Result<(), TrackerError> {
        let seen = |pixels: &[DVec2; LANDMARKS]| -> Result<Sighting, TrackerError> {
            let world = self.tracker.in_space(rgb, width, height, pixels)?;
            let sharpness = sharpness(rgb, width as usize, height as usize, pixels);
            Ok(Sighting { pixels: *pixels, world, presence: 1.0, sharpness, others: vec![] })
        };
        let found = pixels.map(seen).transpose()?;
        self.right = vec![(if side == Side::Right { 1.0 } else { 0.0 }, LEAST_TRACK)];
        self.push(rgb, width, height, found.into_iter().map(|sighting| (0, sighting)).collect());
        Ok(())
    }

    fn push(&mut self, rgb: &[u8], width: u32, height: u32, frame: Vec<(usize, Sighting)>) {
        if self.frames.len().is_multiple_of(STILLNESS_EVERY) {
            let hands: Vec<[DVec2; LANDMARKS]> = frame.iter().map(|(_, sighting)| sighting.pixels).collect();
            self.stillness.add(rgb, width as usize, height as usize, &hands);
        }
        self.frames.push(frame);
    }

    /// Counts a frame that cannot be looked at.
    pub fn skip(&mut self) {
        self.frames.push(vec![]);
    }

    /// All hands, each with the side that the whole of its track says.
    pub fn finish(self) -> Hands {
        let several = self.frames.iter().filter(|hands| hands.len() > 1).count();
        let with_hand = self.frames.iter().filter(|hands| !hands.is_empty()).count();
        let is_one_hand = several as f64 <= SECOND_HAND * with_hand as f64;
        // One hand alone keeps its side: by all frames together.
        let total: f64 = self.right.iter().map(|(right, frames)| (right - 0.5) * *frames as f64).sum();
        let is_right = |identity: usize| {
            let track = self.right.get(identity).filter(|(_, frames)| !is_one_hand && *frames >= LEAST_TRACK);
            track.map_or(total > 0.0, |(right, _)| *right > 0.5)
        };
        let sided = |(identity, sighting): &(usize, Sighting)| SidedHand {
            right: is_right(*identity),
            sighting: sighting.clone(),
        };
        let hands: Vec<Vec<SidedHand>> = self.frames.iter().map(|frame| frame.iter().map(sided).collect()).collect();
        let count = |right: bool| hands.iter().filter(|frame| frame.iter().any(|hand| hand.right == right)).count();
        let same = |frame: &&Vec<SidedHand>| {
            [true, false].iter().any(|right| frame.iter().filter(|hand| hand.right == *right).count() > 1)
        };
        Hands {
            frames: hands.len(),
            with_hand,
            with_several: several,
            with_same_side: hands.iter().filter(same).count(),
            by_side: [count(true), count(false)],
            shift: self.stillness.largest_shift(),
            hands,
        }
    }
}

impl Hands {
    /// The track of the hand of a side. Where several are of that side, the one that is nearest to the last one.
    pub fn track(&self, side: Side, times: &[f64]) -> Track {
        let mut last: Option<DVec2> = None;
        let pick = |frame: &Vec<SidedHand>| {
            let off = |hand: &&SidedHand| match last {
                Some(last) => middle(&hand.sighting).distance(last),
                None => -hand.sighting.presence,
            };
            let of_side = frame.iter().filter(|hand| hand.right == (side == Side::Right));
            let own = of_side.min_by(|a, b| off(a).total_cmp(&off(b)))?;
            last = Some(middle(&own.sighting));
            let others = frame.iter().filter(|hand| !std::ptr::eq(*hand, own));
            let other = |hand: &SidedHand| OtherHand { pixels: hand.sighting.pixels, world: hand.sighting.world };
            Some(Sighting { others: others.map(other).collect(), ..own.sighting.clone() })
        };
        let mut sightings: Vec<Option<Sighting>> = self.hands.iter().map(pick).collect();
        sightings.truncate(times.len());
        Track { times: times[..sightings.len()].to_vec(), sightings }
    }
}

fn middle(sighting: &Sighting) -> DVec2 {
    sighting.pixels.iter().sum::<DVec2>() / LANDMARKS as f64
}

impl Track {
    /// In how many frames the hand was found.
    pub fn found(&self) -> usize {
        self.sightings.iter().flatten().count()
    }

    /// Frames per second, by the median of the steps; 30 for a single frame.
    pub fn rate(&self) -> f64 {
        let mut steps: Vec<f64> =
            self.times.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| *step > 0.0).collect();
        steps.sort_by(f64::total_cmp);
        steps.get(steps.len() / 2).map_or(30.0, |step| 1.0 / step)
    }
}

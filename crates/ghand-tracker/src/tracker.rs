//! Follows hands from picture to picture.

use ghand_core::Side;
use glam::{DVec2, DVec3};

use crate::landmarks::{LandmarkDetector, Landmarks};
use crate::palms::PalmDetector;
use crate::picture::Picture;
use crate::{Region, TrackerError};

/// Least presence of a hand.
const LEAST_PRESENCE: f64 = 0.5;

/// Regions that overlap by more than this are of the same hand.
const SAME_HAND: f64 = 0.5;

/// While one hand is followed, the other is searched in every fifth picture only.
const SEARCH_EVERY: u64 = 5;

/// A hand in one picture.
#[derive(Debug, Clone, PartialEq)]
pub struct TrackedHand {
    /// The same number as long as this hand is followed without a gap.
    pub identity: u64,
    /// Right or left, of the person, by all pictures since the hand was found. Pictures must not be mirrored.
    pub side: Side,
    /// How certain the side is, 0.5 to 1.
    pub side_score: f64,
    /// How certain it is that this is a hand, 0.5 to 1.
    pub presence: f64,
    /// MediaPipe's landmarks in the picture, pixels: the wrist, then four from the palm to the tip of each finger, thumb
    /// first. The middle of the first pixel is at (0.5, 0.5).
    pub landmarks: [DVec2; 21],
    /// The same in space, metres: x right, y down, z away; the origin is near the hand's middle. Their size is a guess.
    pub world: [DVec3; 21],
    /// Where the hand was searched.
    pub region: Region,
}

/// A hand that is being followed.
struct Track {
    identity: u64,
    region: Region,
    /// Sum over pictures of how certain it is that the hand is a right one.
    right: f64,
    pictures: f64,
}

/// Finds and follows hands. The same pictures give the same numbers on the same machine.
pub struct HandTracker {
    palms: PalmDetector,
    landmarks: LandmarkDetector,
    most_hands: usize,
    tracks: Vec<Track>,
    next_identity: u64,
    pictures: u64,
}

impl HandTracker {
    /// A tracker of at most `most_hands` hands.
    pub fn new(most_hands: usize) -> HandTracker {
        HandTracker {
            palms: PalmDetector::new(),
            landmarks: LandmarkDetector::new(),
            most_hands,
            tracks: Vec::new(),
            next_identity: 0,
            pictures: 0,
        }
    }

    /// The hands of the next picture, in the order in which they were found. Where no hand is followed, palms are
    /// searched in the whole picture; while some are followed and others are missing, in every fifth picture.
    ///
    /// # Errors
    /// If `rgb` is not `width` x `height` x 3 bytes.
    pub fn track(&mut self, rgb: &[u8], width: u32, height: u32) -> Result<Vec<TrackedHand>, TrackerError> {
        let picture = Picture::new(rgb, width, height)?;
        let mut hands = Vec::new();
        let mut tracks = Vec::new();
        for track in std::mem::take(&mut self.tracks) {
            self.follow(picture, track, &mut tracks, &mut hands);
        }
        let is_due = tracks.is_empty() || self.pictures.is_multiple_of(SEARCH_EVERY);
        if tracks.len() < self.most_hands && is_due {
            for palm in self.palms.detect(picture) {
                let region = palm.region();
                let is_new = tracks.iter().all(|track: &Track| track.region.overlap(&region) <= SAME_HAND);
                if tracks.len() < self.most_hands && is_new {
                    let track = Track { identity: self.next_identity, region, right: 0.0, pictures: 0.0 };
                    if self.follow(picture, track, &mut tracks, &mut hands) {
                        self.next_identity += 1;
                    }
                }
            }
        }
        self.tracks = tracks;
        self.pictures += 1;
        Ok(hands)
    }

    /// The hand whose landmarks are known, in pixels, as the network sees it in space. Does not change what is followed.
    ///
    /// # Errors
    /// If `rgb` is not `width` x `height` x 3 bytes, or the landmarks are no region of a picture.
    pub fn in_space(
        &self,
        rgb: &[u8],
        width: u32,
        height: u32,
        landmarks: &[DVec2; 21],
    ) -> Result<[DVec3; 21], TrackerError> {
        let region = Region::from_landmarks(landmarks);
        if !region.is_usable() {
            return Err(TrackerError::Landmarks);
        }
        Ok(self.landmarks.detect(Picture::new(rgb, width, height)?, &region).world)
    }

    /// Looks for a track's hand in its region. Adds it, with the region for the next picture, if it is there and is not
    /// one of those found before.
    fn follow(&self, picture: Picture, track: Track, tracks: &mut Vec<Track>, hands: &mut Vec<TrackedHand>) -> bool {
        if !track.region.is_usable() {
            return false;
        }
        let Landmarks { pixels, world, presence, right } = self.landmarks.detect(picture, &track.region);
        let next = Region::from_landmarks(&pixels);
        let is_new = tracks.iter().all(|other| other.region.overlap(&next) <= SAME_HAND);
        // Rejects NaN, too.
        let is_there = presence > LEAST_PRESENCE && next.is_usable();
        if !is_there || !is_new {
            return false;
        }
        let track = Track { right: track.right + right, pictures: track.pictures + 1.0, ..track };
        let right = track.right / track.pictures;
        hands.push(TrackedHand {
            identity: track.identity,
            side: if right > 0.5 { Side::Right } else { Side::Left },
            side_score: right.max(1.0 - right),
            presence,
            landmarks: pixels,
            world,
            region: track.region,
        });
        tracks.push(Track { region: next, ..track });
        true
    }
}

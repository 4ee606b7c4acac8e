//! The hands of all pictures, each with one side as long as it is followed.

use std::collections::HashMap;

use ghand_core::Side;
use ghand_tracker::TrackedHand;

/// The hands of all pictures of some footage.
pub(super) struct SeenHands {
    frames: Vec<Vec<TrackedHand>>,
    /// Side of each hand by its identity, from the last picture in which it was followed, which knows all before it.
    sides: HashMap<u64, Side>,
    /// Pictures in which each hand was followed.
    lengths: HashMap<u64, usize>,
}

impl SeenHands {
    /// Of that many pictures, none of which has a hand yet.
    pub fn new(count: usize) -> SeenHands {
        SeenHands { frames: vec![vec![]; count], sides: HashMap::new(), lengths: HashMap::new() }
    }

    /// Adds the hands of a picture.
    pub fn add(&mut self, number: usize, hands: Vec<TrackedHand>) {
        for hand in &hands {
            self.sides.insert(hand.identity, hand.side);
            *self.lengths.entry(hand.identity).or_default() += 1;
        }
        if let Some(frame) = self.frames.get_mut(number) {
            *frame = hands;
        }
    }

    /// The hand of a side in a picture. Of two, the one that was followed for longer.
    pub fn hand(&self, number: usize, side: Side) -> Option<&TrackedHand> {
        let hands = self.frames.get(number)?.iter();
        let of_side = hands.filter(|hand| self.sides.get(&hand.identity) == Some(&side));
        of_side.max_by_key(|hand| (self.lengths.get(&hand.identity), std::cmp::Reverse(hand.identity)))
    }

    /// Number of pictures with a hand of a side.
    pub fn frames_with(&self, side: Side) -> usize {
        (0..self.frames.len()).filter(|number| self.hand(*number, side).is_some()).count()
    }

    /// The side that is seen in more pictures; the right one if both are seen in as many.
    pub fn more_often(&self) -> Side {
        if self.frames_with(Side::Left) > self.frames_with(Side::Right) { Side::Left } else { Side::Right }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ghand_tracker::Region;
    use glam::{DVec2, DVec3};

    fn hand(identity: u64, side: Side) -> TrackedHand {
        TrackedHand {
            identity,
            side,
            side_score: 0.9,
            presence: 0.9,
            landmarks: [DVec2::ZERO; 21],
            world: [DVec3::ZERO; 21],
            region: Region { center: DVec2::ZERO, size: 1.0, turn: 0.0 },
        }
    }

    #[test]
    fn a_hand_has_the_side_that_all_its_pictures_say() {
        let mut hands = SeenHands::new(4);
        hands.add(0, vec![hand(0, Side::Left)]);
        hands.add(1, vec![hand(0, Side::Right), hand(1, Side::Right)]);
        hands.add(3, vec![hand(0, Side::Right), hand(2, Side::Left)]);
        assert_eq!((hands.frames_with(Side::Right), hands.frames_with(Side::Left)), (3, 1));
        assert_eq!(hands.more_often(), Side::Right);
        // Of two right ones, the one followed for longer.
        assert_eq!(hands.hand(1, Side::Right).map(|hand| hand.identity), Some(0));
        assert!(hands.hand(2, Side::Right).is_none() && hands.hand(9, Side::Right).is_none());
    }
}

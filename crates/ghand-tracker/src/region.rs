//! The square of a picture in which a hand is.

use std::f64::consts::FRAC_PI_2;

use glam::DVec2;

/// A square of a picture, turned.
///
/// Pixels as in the whole project: x right, y down, the middle of the first one at (0.5, 0.5).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Region {
    /// Its middle, pixels.
    pub center: DVec2,
    /// Length of an edge, pixels.
    pub size: f64,
    /// How far it is turned, radians, clockwise as one sees the picture.
    pub turn: f64,
}

/// Landmarks that move little when fingers bend, which give the next region: the wrist, the thumb without its tip, and
/// the first two joints of each finger.
const STEADY: [usize; 12] = [0, 1, 2, 3, 5, 6, 9, 10, 13, 14, 17, 18];

impl Region {
    /// The pixel at a place of the region: (0, 0) is its first corner, (1, 1) the opposite one.
    pub fn to_picture(&self, place: DVec2) -> DVec2 {
        self.center + DVec2::from_angle(self.turn).rotate((place - 0.5) * self.size)
    }

    /// The region of a hand from its palm: the palm's box, turned until the wrist is below the middle finger's knuckle,
    /// moved by half its height towards the fingers, and 2.6 times as large.
    pub(crate) fn from_palm(center: DVec2, size: DVec2, wrist: DVec2, knuckle: DVec2) -> Region {
        let turn = turn_towards(knuckle - wrist);
        let shift = DVec2::from_angle(turn).rotate(DVec2::new(0.0, -0.5 * size.y));
        Region { center: center + shift, size: 2.6 * size.max_element(), turn }
    }

    /// The region of a hand in the next frame: the box around its landmarks that do not move with the fingers, moved by
    /// a tenth of its height towards the fingers, and twice as large.
    pub(crate) fn from_landmarks(landmarks: &[DVec2; 21]) -> Region {
        let knuckles = (landmarks[9] + (landmarks[5] + landmarks[13]) / 2.0) / 2.0;
        let turn = turn_towards(knuckles - landmarks[0]);
        let upright = DVec2::from_angle(-turn);
        let steady = STEADY.map(|k| upright.rotate(landmarks[k]));
        let least = steady.into_iter().fold(DVec2::INFINITY, DVec2::min);
        let most = steady.into_iter().fold(DVec2::NEG_INFINITY, DVec2::max);
        let size = most - least;
        let center = (least + most) / 2.0 + DVec2::new(0.0, -0.1 * size.y);
        Region { center: DVec2::from_angle(turn).rotate(center), size: 2.0 * size.max_element(), turn }
    }

    /// The common area of two regions, both taken upright, divided by that of their union.
    pub(crate) fn overlap(&self, other: &Region) -> f64 {
        overlap([self.center, DVec2::splat(self.size)], [other.center, DVec2::splat(other.size)])
    }

    /// Whether a network can look at it: finite, and neither a point nor much larger than a picture.
    pub(crate) fn is_usable(&self) -> bool {
        self.center.is_finite() && self.turn.is_finite() && self.size > 1.0 && self.size < 1e6
    }
}

/// The common area of two boxes, each its middle and size, divided by that of their union; 0 for empty boxes.
pub(crate) fn overlap(a: [DVec2; 2], b: [DVec2; 2]) -> f64 {
    let least = (a[0] - a[1] / 2.0).max(b[0] - b[1] / 2.0);
    let most = (a[0] + a[1] / 2.0).min(b[0] + b[1] / 2.0);
    let common = (most - least).max(DVec2::ZERO).element_product();
    let union = a[1].element_product() + b[1].element_product() - common;
    if union > 0.0 { common / union } else { 0.0 }
}

/// The turn that makes the upward direction this one.
fn turn_towards(direction: DVec2) -> f64 {
    direction.y.atan2(direction.x) + FRAC_PI_2
}

//! Two hands that are near each other in an image: which pixels are the other one's.
//!
//! A pixel is the hand's to whose bones it is nearer, relative to how thick the flesh around these is. Where both have
//! flesh, one is in front of the other, and landmarks do not tell which.

use glam::{DVec2, DVec3};

use crate::rig::LANDMARKS;
use crate::rig::lengths::BONES;
use crate::track::Sighting;

/// Half the thickness of fingers, of the thumb, and of the flesh around the bones of the palm, metres, in an adult's hand.
const FINGER: f64 = 0.009;
const THUMB: f64 = 0.011;
const PALM: f64 = 0.014;
/// The same of the forearm, and how much of it is a hand's, relative to the distance from the wrist to the knuckles.
const ARM: f64 = 0.028;
const ARM_LENGTH: f64 = 2.0;
/// Landmarks and thicknesses are off: flesh may be so many times as thick.
const MOST_THICKNESS: f64 = 1.8;
/// Of the hand's own flesh this part may be another hand's, too: fingertips that touch.
pub const MOST_OVERLAP: f64 = 0.03;
/// The overlap is measured at one pixel in so many, along each axis.
const STRIDE: usize = 2;

/// Bones of a hand in an image with the flesh around them.
struct Flesh {
    /// From, to, and half the thickness, pixels.
    bones: Vec<(DVec2, DVec2, f64)>,
}

impl Flesh {
    /// `world` are the landmarks in the camera's axes, metres.
    fn of(pixels: &[DVec2; LANDMARKS], world: &[DVec3; LANDMARKS]) -> Flesh {
        let scale = pixels_per_metre(pixels, world);
        let bone = |(from, to): &(usize, usize)| {
            let is_palm = *from == 0 || (from % 4 == 1 && to % 4 == 1);
            let half = match to {
                1..=4 => THUMB,
                _ if is_palm => PALM,
                _ => FINGER,
            };
            (pixels[*from], pixels[*to], half * scale)
        };
        Flesh { bones: BONES.iter().map(bone).collect() }
    }

    /// With the forearm, which lies behind the palm.
    fn with_arm(pixels: &[DVec2; LANDMARKS], world: &[DVec3; LANDMARKS]) -> Flesh {
        let mut flesh = Flesh::of(pixels, world);
        let along = (pixels[0] - pixels[9]) * ARM_LENGTH;
        flesh.bones.push((pixels[0], pixels[0] + along, ARM * pixels_per_metre(pixels, world)));
        flesh
    }

    /// How far a pixel is from the nearest bone, relative to the thickness of its flesh: below 1 it is flesh.
    fn distance(&self, at: DVec2) -> f64 {
        let to_bone = |(from, to, half): &(DVec2, DVec2, f64)| {
            let along = *to - *from;
            let part = ((at - *from).dot(along) / along.length_squared().max(1e-12)).clamp(0.0, 1.0);
            (*from + part * along).distance_squared(at) / (half * half).max(1e-12)
        };
        self.bones.iter().map(to_bone).fold(f64::INFINITY, f64::min).sqrt()
    }

    /// Columns and rows in which all flesh lies, if it is `thickness` times as thick, within an image.
    fn extent(&self, thickness: f64, size: [usize; 2]) -> [std::ops::Range<usize>; 2] {
        let mut low = DVec2::INFINITY;
        let mut high = DVec2::NEG_INFINITY;
        for (from, to, half) in &self.bones {
            low = low.min(from.min(*to) - half * thickness);
            high = high.max(from.max(*to) + half * thickness);
        }
        // Casts of what is beyond the image, or not a number, end at its borders.
        [0, 1].map(|axis| {
            let end = (high[axis].ceil() as usize).min(size[axis]);
            (low[axis].floor() as usize).min(end)..end
        })
    }
}

/// How large a metre at the hand is in the image, as if all of the hand were equally far away.
fn pixels_per_metre(pixels: &[DVec2; LANDMARKS], world: &[DVec3; LANDMARKS]) -> f64 {
    let spread = |points: &mut dyn Iterator<Item = DVec2>| {
        let points: Vec<DVec2> = points.collect();
        let middle = points.iter().sum::<DVec2>() / LANDMARKS as f64;
        points.iter().map(|point| point.distance_squared(middle)).sum::<f64>()
    };
    let ratio = spread(&mut pixels.iter().copied()) / spread(&mut world.iter().map(|point| point.truncate()));
    if ratio.is_finite() { ratio.sqrt() } else { 0.0 }
}

/// The part of a hand's flesh that is another hand's, too: 0 to 1.
pub fn overlap(hand: &Sighting, size: [usize; 2]) -> f64 {
    let own = Flesh::of(&hand.pixels, &hand.world);
    let others: Vec<Flesh> = hand.others.iter().map(|other| Flesh::with_arm(&other.pixels, &other.world)).collect();
    let [columns, rows] = own.extent(1.0, size);
    let (mut all, mut both) = (0usize, 0usize);
    for y in rows.step_by(STRIDE) {
        for x in columns.clone().step_by(STRIDE) {
            let at = DVec2::new(x as f64, y as f64) + 0.5;
            if own.distance(at) < 1.0 {
                all += 1;
                both += usize::from(others.iter().any(|other| other.distance(at) < 1.0));
            }
        }
    }
    both as f64 / all.max(1) as f64
}

/// Whether each pixel of an image, row by row, is another hand's.
pub fn other_hands(hand: &Sighting, size: [usize; 2]) -> Vec<bool> {
    let [width, height] = size;
    let mut found = vec![false; width * height];
    let own = Flesh::of(&hand.pixels, &hand.world);
    for other in &hand.others {
        let other = Flesh::with_arm(&other.pixels, &other.world);
        let [columns, rows] = other.extent(MOST_THICKNESS, size);
        for y in rows {
            for x in columns.clone() {
                let at = DVec2::new(x as f64, y as f64) + 0.5;
                let distance = other.distance(at);
                if distance < MOST_THICKNESS && distance < own.distance(at) {
                    found[y * width + x] = true;
                }
            }
        }
    }
    found
}

//! What is behind the hand: a desk with things on it, another one for each camera, the same in all frames.
//!
//! Its colours are those that make masks hard: wood near skin, and things of many colours, some of them like skin.

use ghand_core::Camera;
use glam::{DVec2, DVec3};

use crate::noise::{fractal, lattice, noise};

/// Display colours of wood, of its grain, and of the things on it: three of them are like skin of some complexion.
const WOOD: [f64; 3] = [0.66, 0.52, 0.38];
const GRAIN: [f64; 3] = [0.47, 0.33, 0.22];
const THINGS: [[f64; 3]; 9] = [
    [0.13, 0.14, 0.17],
    [0.86, 0.86, 0.83],
    [0.20, 0.34, 0.55],
    [0.83, 0.64, 0.54],
    [0.30, 0.45, 0.28],
    [0.58, 0.40, 0.31],
    [0.62, 0.16, 0.15],
    [0.70, 0.52, 0.42],
    [0.45, 0.47, 0.50],
];
/// Things on the desk.
const COUNT: i64 = 14;
/// Extent of a thing, relative to the image's width.
const SIZES: [f64; 2] = [0.06, 0.30];

/// Display colours in `[0, 1]` of a camera's pixels, row-major.
pub(crate) fn clutter(camera: &Camera, index: usize, seed: u64) -> Vec<DVec3> {
    let seed = seed ^ 0xDE5C ^ ((index as u64) << 32);
    let width = f64::from(camera.width);
    let things = Things::scattered(COUNT, DVec2::new(1.0, f64::from(camera.height) / width), seed);
    let pixel = |i: u32| {
        let place = DVec2::new(f64::from(i % camera.width) + 0.5, f64::from(i / camera.width) + 0.5) / width;
        let color = things.color(place).unwrap_or_else(|| wood(place, seed));
        // Light falls off towards one side, and every surface is a little uneven.
        let light = 1.05 - 0.3 * place.x + 0.05 * fractal(place.extend(3.0), 0.03, seed);
        (color * light).clamp(DVec3::ZERO, DVec3::ONE)
    };
    (0..camera.width * camera.height).map(pixel).collect()
}

/// Display colour of a wooden plate. Its grain is 0.06 wide and long in the first direction.
pub(crate) fn wood(place: DVec2, seed: u64) -> DVec3 {
    // Grain is long in one direction.
    let along = DVec3::new(place.x * 0.12, place.y, 0.5);
    let grain = 0.5 + 0.5 * fractal(along, 0.06, seed);
    DVec3::from(WOOD).lerp(DVec3::from(GRAIN), grain * grain)
}

/// Things that lie on a plane, one over the other.
pub(crate) struct Things(Vec<Thing>);

impl Things {
    /// Things with extents of 0.06 to 0.3, with their middles between the origin and `area`.
    pub(crate) fn scattered(count: i64, area: DVec2, seed: u64) -> Things {
        Things((0..count).map(|k| Thing::drawn(k, seed, area)).collect())
    }

    /// Display colour of the uppermost thing at a place, if there is any.
    pub(crate) fn color(&self, place: DVec2) -> Option<DVec3> {
        self.0.iter().rev().find_map(|thing| thing.color(place))
    }
}

/// A rectangle or an ellipse of one colour, perhaps with stripes.
struct Thing {
    middle: DVec2,
    /// Unit vector along its first side.
    along: DVec2,
    half: DVec2,
    is_round: bool,
    color: DVec3,
    stripes: f64,
    seed: u64,
}

impl Thing {
    fn drawn(k: i64, seed: u64, area: DVec2) -> Thing {
        let draw = |what: i64| lattice(k, what, 11, seed);
        let half = DVec2::new(draw(0), draw(1)).map(|part| 0.5 * (SIZES[0] + (SIZES[1] - SIZES[0]) * part));
        Thing {
            middle: DVec2::new(draw(2), draw(3)) * area,
            along: DVec2::from_angle(draw(4) * std::f64::consts::TAU),
            half,
            is_round: draw(5) < 0.4,
            color: DVec3::from(THINGS[(draw(6) * THINGS.len() as f64) as usize]),
            stripes: if draw(7) < 0.5 { 0.0 } else { 0.25 * draw(8) },
            seed: seed.wrapping_add(k as u64),
        }
    }

    fn color(&self, place: DVec2) -> Option<DVec3> {
        let offset = place - self.middle;
        // Far from most things; the rest is exact.
        if offset.length_squared() > 1.001 * self.half.length_squared() {
            return None;
        }
        let local = DVec2::new(offset.dot(self.along), offset.perp_dot(self.along)) / self.half;
        let is_inside = if self.is_round { local.length() < 1.0 } else { local.abs().max_element() < 1.0 };
        if !is_inside {
            return None;
        }
        let stripe = 1.0 - self.stripes * f64::from(u8::from((local.x * 5.0).rem_euclid(2.0) < 0.7));
        Some(self.color * stripe * (1.0 + 0.06 * noise(place.extend(0.0), 0.012, self.seed)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_camera_has_the_same_textured_background_each_time_and_another_one_has_another() {
        let camera = Camera::look_at(DVec3::NEG_Z, DVec3::ZERO, DVec3::Y, 0.5, 60, 40);
        let found = clutter(&camera, 0, 7);
        assert_eq!(found.len(), 60 * 40);
        assert!(found == clutter(&camera, 0, 7) && found != clutter(&camera, 1, 7) && found != clutter(&camera, 0, 8));
        let mean = found.iter().sum::<DVec3>() / found.len() as f64;
        let deviation = found.iter().map(|c| (*c - mean).length_squared()).sum::<f64>() / found.len() as f64;
        assert!(deviation.sqrt() > 0.1, "{}", deviation.sqrt());
        // Some of it is like skin: red above green above blue, in a skin's proportions.
        let like_skin = |c: &&DVec3| (1.15..1.6).contains(&(c.x / c.y)) && (1.05..1.6).contains(&(c.y / c.z));
        assert!(found.iter().filter(like_skin).count() > found.len() / 10);
    }
}

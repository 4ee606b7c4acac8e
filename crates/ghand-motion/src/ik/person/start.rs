//! Where the fit of a frame starts: the previous pose, the palm of landmarks in space, or, for pixels alone, all
//! directions in which a hand can be turned.

use ghand_core::{Camera, Pose};
use glam::{DMat3, DVec2, DVec3};

use super::frame::FrameFit;
use super::sightings::{Gap, SeenFrame, Sighting, SightingPosition, WRONG};
use crate::ik::{COLD_STEPS, HandIk, LOST, UNKNOWNS, WARM_STEPS, median, write};

/// Bends that fingers start with, radians.
const BENDS: [f64; 2] = [0.0, 0.8];
/// And with which a finger is tried again.
const RETRIED_BENDS: [f64; 3] = [0.0, 0.8, 1.5];
/// Steps from each direction, and how many of the best go on.
const FIRST_STEPS: usize = 8;
const BEST: usize = 4;
/// The noise at first, metres: wrong directions are as far off.
const FIRST_NOISE: f64 = 0.02;
/// How much a depth from the hand's size in one image counts beside the crossing of the rays of several.
const DEPTH_WEIGHT: f64 = 0.05;

/// The pose of a frame: from that of the frame before, if that is good enough, else from the best of all starts. `None`
/// if the landmarks are not a hand.
pub(crate) fn first_pose(fit: &FrameFit, before: Option<&[f64; UNKNOWNS]>) -> Option<[f64; UNKNOWNS]> {
    let warm = before.map(|x| fit.solve(*x, WARM_STEPS));
    if let Some((_, x)) = warm.filter(|(_, x)| fit.median(x) <= LOST) {
        return Some(x);
    }
    let cold = match fit.seen.points() {
        Some(points) => {
            let pose: Pose = fit.hand.solve(&points, None)?.pose;
            Some(fit.solve(fit.hand.unknowns(&pose), COLD_STEPS))
        }
        None => from_all_directions(fit),
    };
    let best = [warm, cold].into_iter().flatten().min_by(|a, b| a.0.total_cmp(&b.0));
    best.filter(|(cost, _)| cost.is_finite()).map(|(_, x)| x)
}

/// The pose, or a better one in which fingers with several wrong landmarks bend otherwise: a finger that has gone astray
/// stays where it is as long as every small step makes it worse.
pub(crate) fn with_fingers_retried(fit: &FrameFit, x: [f64; UNKNOWNS]) -> [f64; UNKNOWNS] {
    let mut best = (fit.cost(&x), x);
    let rough = FrameFit { noise: FIRST_NOISE, ..*fit };
    for finger in 0..5 {
        let is_wrong = |(sighting, gap): (&Sighting, Gap)| {
            (4 * finger + 1..=4 * finger + 4).contains(&sighting.landmark) && gap.squared > (WRONG * fit.noise).powi(2)
        };
        let gaps = fit.gaps(&best.1);
        if fit.seen.sightings.iter().zip(gaps).filter(|pair| is_wrong(*pair)).count() < 2 {
            continue;
        }
        for bend in RETRIED_BENDS {
            let straight = fit.hand.start(DMat3::IDENTITY, DVec3::ZERO, bend);
            let angles = 6 + 9 * finger..15 + 9 * finger;
            let mut other = best.1;
            other[angles.clone()].copy_from_slice(&straight[angles]);
            let (_, other) = rough.solve(other, WARM_STEPS);
            let other = fit.solve(other, WARM_STEPS);
            if other.0 < best.0 {
                best = other;
            }
        }
    }
    best.1
}

fn from_all_directions(fit: &FrameFit) -> Option<(f64, [f64; UNKNOWNS])> {
    let center = center(fit.hand, fit.seen, fit.cameras)?;
    let scales = scales_at(center, fit.cameras);
    let rough = FrameFit { noise: FIRST_NOISE, scales: &scales, ..*fit };
    let mut found: Vec<(f64, [f64; UNKNOWNS])> = vec![];
    for turn in turns() {
        for bend in BENDS {
            let mut x = fit.hand.start(turn, DVec3::ZERO, bend);
            let places = fit.hand.places(&fit.hand.chain(&x), &x);
            let middle = places.iter().sum::<DVec3>() / places.len() as f64;
            write(&mut x, 3, center - middle);
            found.push(rough.solve(x, FIRST_STEPS));
        }
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    found.truncate(BEST);
    let finish = |(_, x): (f64, [f64; UNKNOWNS])| {
        let (_, x) = rough.solve(x, COLD_STEPS);
        fit.solve(x, COLD_STEPS)
    };
    found.into_iter().map(finish).min_by(|a, b| a.0.total_cmp(&b.0))
}

/// Metres per pixel of each camera at a point (metres, world).
pub(crate) fn scales_at(point: DVec3, cameras: &[Camera]) -> Vec<f64> {
    let scale = |camera: &Camera| {
        let depth = camera.camera_from_world(point).z.max(1e-3);
        depth / (0.5 * (camera.focal.x + camera.focal.y))
    };
    cameras.iter().map(scale).collect()
}

/// Metres per pixel of each camera at a posed hand.
pub(crate) fn scales_of(hand: &HandIk, x: &[f64; UNKNOWNS], cameras: &[Camera]) -> Vec<f64> {
    let places = hand.places(&hand.chain(x), x);
    scales_at(places.iter().sum::<DVec3>() / places.len() as f64, cameras)
}

/// Where the hand is, metres, world: where the lines of sight to it cross, and as far as its size says. Medians, so that
/// single wrong landmarks do not count.
fn center(hand: &HandIk, seen: &SeenFrame, cameras: &[Camera]) -> Option<DVec3> {
    let rest = hand.landmarks.map(|joint| hand.joints[joint]);
    let middle = rest.iter().sum::<DVec3>() / rest.len() as f64;
    // Seen from a random side, a length is pi / 4 of itself.
    let size = median(rest.iter().map(|p| p.distance(middle)).collect()) * std::f64::consts::FRAC_PI_4;
    let mut matrix = DMat3::ZERO;
    let mut vector = DVec3::ZERO;
    for (number, camera) in cameras.iter().enumerate() {
        let pixels: Vec<DVec2> = (seen.sightings.iter())
            .filter_map(|s| match s.place {
                SightingPosition::Pixel(of, at) if of == number => Some(at),
                _ => None,
            })
            .collect();
        let (x, y) = (pixels.iter().map(|p| p.x).collect(), pixels.iter().map(|p| p.y).collect());
        let at = DVec2::new(median(x), median(y));
        let spread = median(pixels.iter().map(|p| p.distance(at)).collect());
        if !(spread > 0.0 && spread.is_finite()) {
            continue;
        }
        let depth = size * 0.5 * (camera.focal.x + camera.focal.y) / spread;
        let sight = ((at - camera.principal) / camera.focal).extend(1.0);
        let along = camera.rotation.transpose() * sight.normalize();
        let place = camera.rotation.transpose() * (sight * depth - camera.translation);
        let line = DMat3::from_cols(along * along.x, along * along.y, along * along.z);
        let weight = DMat3::IDENTITY + line * (DEPTH_WEIGHT - 1.0);
        matrix += weight;
        vector += weight * place;
    }
    let center = matrix.inverse() * vector;
    center.is_finite().then_some(center)
}

/// The 24 rotations that take a cube to itself: every direction is within 45 degrees or so of one.
fn turns() -> Vec<DMat3> {
    let mut turns = vec![];
    for first in 0..3 {
        for second in (0..3).filter(|second| *second != first) {
            for signs in 0..4 {
                let sign = |bit: usize| if signs >> bit & 1 == 1 { -1.0 } else { 1.0 };
                let (x, y) = (DVec3::AXES[first] * sign(0), DVec3::AXES[second] * sign(1));
                turns.push(DMat3::from_cols(x, y, x.cross(y)));
            }
        }
    }
    turns
}

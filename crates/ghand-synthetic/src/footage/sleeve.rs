//! The sleeve on the forearm: a tube of ribbed cloth.

use std::f64::consts::TAU;

use ghand_core::HandModel;
use glam::{DVec2, DVec3};

use crate::noise::{fractal, lattice, noise, smoothstep};

/// Where it begins, and where it ends, from the wrist along the forearm, metres.
const BEGIN: f64 = 0.115;
const END: f64 = 0.40;
/// How far it is from the arm at least, and how high its folds are, metres.
const SLACK: f64 = 0.006;
const FOLDS: f64 = 0.004;
/// The length of the cuff, metres, and the ring inside it, relative to its radius.
const CUFF: f64 = 0.035;
const INSIDE: f64 = 0.6;
const COLUMNS: u32 = 64;
const RINGS: u32 = 48;
/// Display colours of cloth.
const CLOTHS: [[f64; 3]; 6] = [
    [0.16, 0.22, 0.36],
    [0.42, 0.43, 0.45],
    [0.30, 0.42, 0.36],
    [0.52, 0.16, 0.17],
    [0.14, 0.14, 0.15],
    [0.78, 0.76, 0.70],
];
/// Rows of its texture.
pub(crate) const TEXTURE_ROWS: u32 = 96;

/// A sleeve on the forearm of a right hand at rest.
pub(crate) struct Sleeve {
    /// Metres.
    pub vertices: Vec<DVec3>,
    pub triangles: Vec<[u32; 3]>,
    /// In its own texture.
    pub uvs: Vec<DVec2>,
    /// The fraction of the light that reaches each vertex: little inside.
    pub light_visibility: Vec<f64>,
    cloth: DVec3,
    seed: u64,
}

impl Sleeve {
    /// A sleeve over the forearm of a hand with one: its vertices farther from the fingers than `BEGIN`.
    pub(crate) fn on(hand: &HandModel, seed: u64) -> Sleeve {
        let seed = seed ^ 0x51EE;
        let from = hand.joints.first().map_or(0.0, |wrist| wrist.y) + BEGIN;
        let (low, high) = (hand.vertices.iter().filter(|v| v.y > from))
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), v| (low.min(*v), high.max(*v)));
        let middle = 0.5 * (low + high);
        let half = 0.5 * (high - low) + SLACK;
        let mut sleeve = Sleeve {
            vertices: vec![],
            triangles: vec![],
            uvs: vec![],
            light_visibility: vec![],
            cloth: DVec3::from(CLOTHS[(lattice(0, 0, 0, seed) * CLOTHS.len() as f64) as usize]),
            seed,
        };
        // The first ring is inside the cuff, the second its edge.
        for ring in 0..=RINGS {
            let along = f64::from(ring.saturating_sub(1)) / f64::from(RINGS - 1);
            for column in 0..=COLUMNS {
                let around = f64::from(column) / f64::from(COLUMNS);
                let (sin, cos) = (TAU * around).sin_cos();
                let y = from + along * (END - BEGIN);
                let folds = fractal(DVec3::new(cos * 0.03, y * 1.6, sin * 0.03), 0.04, seed);
                // A cuff is tighter and smooth.
                let loose = smoothstep(0.6 * CUFF, 1.3 * CUFF, y - from);
                let away = DVec2::new(half.x, half.z) + loose * (0.004 + FOLDS * folds);
                let away = if ring == 0 { away * INSIDE } else { away };
                sleeve.vertices.push(DVec3::new(middle.x + away.x * cos, y, middle.z + away.y * sin));
                sleeve.uvs.push(DVec2::new(around, along));
                sleeve.light_visibility.push(if ring == 0 { 0.25 } else { 0.85 + 0.15 * folds });
            }
        }
        let vertex = |ring: u32, column: u32| ring * (COLUMNS + 1) + column;
        for (ring, column) in (0..RINGS).flat_map(|ring| (0..COLUMNS).map(move |column| (ring, column))) {
            let [a, b] = [vertex(ring, column), vertex(ring, column + 1)];
            let [c, d] = [vertex(ring + 1, column), vertex(ring + 1, column + 1)];
            sleeve.triangles.extend([[a, c, b], [b, c, d]]);
        }
        sleeve
    }

    /// Normals of its posed vertices, outwards. `sign` is -1 for a mirrored sleeve.
    pub(crate) fn normals(&self, posed: &[DVec3], sign: f64) -> Vec<DVec3> {
        let mut sums = vec![DVec3::ZERO; posed.len()];
        for triangle in &self.triangles {
            let [a, b, c] = triangle.map(|v| posed[v as usize]);
            let normal = (b - a).cross(c - a) * sign;
            triangle.iter().for_each(|&v| sums[v as usize] += normal);
        }
        // The seam's vertices are there twice.
        for ring in 0..=RINGS as usize {
            let [first, last] = [0, COLUMNS as usize].map(|column| ring * (COLUMNS as usize + 1) + column);
            let sum = sums[first] + sums[last];
            sums[first] = sum;
            sums[last] = sum;
        }
        sums.into_iter().map(DVec3::normalize_or_zero).collect()
    }

    /// Its texture, [`TEXTURE_ROWS`] of `width` texels.
    pub(crate) fn texture(&self, width: u32) -> Vec<[u8; 3]> {
        let texel = |i: u32| {
            let around = f64::from(i % width) / f64::from(width);
            let along = f64::from(i / width) / f64::from(TEXTURE_ROWS);
            let (sin, cos) = (TAU * around).sin_cos();
            let place = DVec3::new(cos * 0.05, along * (END - BEGIN), sin * 0.05);
            let is_cuff = 1.0 - smoothstep(0.95 * CUFF, 1.05 * CUFF, place.y);
            let rib = 1.0 + 0.12 * is_cuff * (TAU * 40.0 * around).sin();
            let color = self.cloth * rib * (1.0 + 0.08 * noise(place, 0.002, self.seed) - 0.06 * is_cuff);
            color.to_array().map(|value| (255.0 * value).round().clamp(0.0, 255.0) as u8)
        };
        (0..width * TEXTURE_ROWS).map(texel).collect()
    }
}

#[cfg(test)]
mod tests {
    use ghand_core::Side;
    use ghand_hand_model::builtin::builtin_hand;

    use super::*;
    use crate::hand::forearm::with_forearm;

    #[test]
    fn a_sleeve_surrounds_the_forearm_and_its_normals_point_outwards() {
        let hand = with_forearm(&builtin_hand(Side::Right).unwrap().without_blend_shapes()).unwrap().model;
        let sleeve = Sleeve::on(&hand, 3);
        let middle = sleeve.vertices.iter().sum::<DVec3>() / sleeve.vertices.len() as f64;
        let begin = hand.joints[0].y + BEGIN;
        let radius = |v: &DVec3| (*v - middle).with_y(0.0).length();
        let nearest = sleeve.vertices[COLUMNS as usize + 1..].iter().map(radius).fold(f64::INFINITY, f64::min);
        assert!((0.02..0.06).contains(&nearest), "{nearest}");
        // No part of the arm is outside of it.
        for arm in hand.vertices.iter().filter(|v| v.y > begin + 0.005) {
            let same_side = |v: &&DVec3| (**v - middle).with_y(0.0).angle_between((*arm - middle).with_y(0.0)) < 0.1;
            let outer = sleeve.vertices[COLUMNS as usize + 1..].iter().filter(same_side).map(radius);
            assert!(outer.fold(f64::INFINITY, f64::min) > radius(arm), "{arm}");
        }
        let normals = sleeve.normals(&sleeve.vertices, 1.0);
        for (v, normal) in sleeve.vertices.iter().zip(&normals).skip(2 * (COLUMNS as usize + 1)) {
            assert!(normal.dot((*v - middle).with_y(0.0)) > 0.0);
        }
        let mirrored: Vec<DVec3> = sleeve.vertices.iter().map(|v| DVec3::new(-v.x, v.y, v.z)).collect();
        let opposite = sleeve.normals(&mirrored, -1.0);
        assert!(normals.iter().zip(&opposite).all(|(n, m)| (DVec3::new(-n.x, n.y, n.z) - *m).length() < 1e-9));
    }
}

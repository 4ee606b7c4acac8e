//! Ten ways in which hands differ, as linear displacements of skin and joints.
//!
//! A displacement follows the bones: each bone that a direction stretches moves everything beyond it. The displacements
//! of the fingers are blended with weights that are smooth across the webs.

use glam::DVec3;
use rayon::prelude::*;

use super::skeleton::{Chain, Skeleton};
use super::{Glove, ProceduralHand};

/// Names of the shape directions.
pub(super) const SHAPE_NAMES: [&str; SHAPE_COUNT] = [
    "hand-size",
    "palm-length",
    "palm-width",
    "thickness",
    "finger-girth",
    "thumb-length",
    "index-length",
    "middle-length",
    "ring-length",
    "pinky-length",
];
/// Number of shape directions.
pub(super) const SHAPE_COUNT: usize = 10;

/// A unit of `hand size`, as a part of all lengths. Adults' hands are 184 mm long, with a standard deviation of 9 mm.
const SIZE: f64 = 0.05;
/// A unit of `palm length` and of `palm width`, as parts of these: 3.0 mm and 2.4 mm of the default hand.
const PALM_LENGTH: f64 = 0.033;
const PALM_WIDTH: f64 = 0.04;
/// Units of `thickness` and `finger girth`, as parts of the distance from the bones.
const THICKNESS: f64 = 0.06;
const GIRTH: f64 = 0.05;
/// A unit of a finger's length, as a part of it: 3.5 mm of the default middle finger.
const FINGER_LENGTH: f64 = 0.036;
/// Chains in the order of the length directions: thumb, index, middle, ring, little finger.
const LENGTH_ORDER: [usize; 5] = [4, 0, 1, 2, 3];

/// A point of the hand and its share of each chain (shares sum to 1).
struct SharedPoint<'a> {
    position: DVec3,
    shares: &'a [f64],
}

/// Displacements per unit of the skin `[SHAPE_COUNT][V]` and of the joints `[SHAPE_COUNT][16]`, metres.
pub(super) struct Shapes {
    pub skin: Vec<DVec3>,
    pub joints: Vec<Vec<DVec3>>,
}

impl Shapes {
    pub(super) fn new(hand: &ProceduralHand, skeleton: &Skeleton, glove: &Glove) -> Shapes {
        // Wider borders than those of the skinning weights: a displacement may cross a web, a rotation must not.
        let shares = glove.shares(skeleton, 0.004);
        let of_skin: Vec<[DVec3; SHAPE_COUNT]> = (glove.vertices.par_iter().zip(&shares))
            .map(|(&position, shares)| displacements(hand, skeleton, &SharedPoint { position, shares }))
            .collect();
        let skin = (0..SHAPE_COUNT).flat_map(|d| of_skin.iter().map(move |all| all[d])).collect();
        let mut joints = vec![vec![DVec3::ZERO; 16]; SHAPE_COUNT];
        for (c, chain) in skeleton.chains.iter().enumerate() {
            let mut shares = [0.0; 5];
            shares[c] = 1.0;
            for k in 0..3 {
                let place = SharedPoint { position: chain.points[chain.first_point + k], shares: &shares };
                let moved = displacements(hand, skeleton, &place);
                joints.iter_mut().zip(moved).for_each(|(row, d)| row[chain.first_joint + k] = d);
            }
        }
        Shapes { skin, joints }
    }
}

fn displacements(hand: &ProceduralHand, skeleton: &Skeleton, place: &SharedPoint) -> [DVec3; SHAPE_COUNT] {
    let p = place.position;
    let mut moved = [DVec3::ZERO; SHAPE_COUNT];
    moved[0] = SIZE * p;
    let along_palm = |p: DVec3| soft_clamp((-p.y / hand.palm_length - 0.06) / 0.74, 0.08);
    // The forearm widens with the palm, but less.
    let widening = PALM_WIDTH * (0.4 + 0.6 * soft_clamp((-p.y / hand.palm_length + 0.1) / 0.7, 0.3));
    for (c, (chain, &share)) in skeleton.chains.iter().zip(place.shares).enumerate() {
        let ways = ways_along(chain, p);
        let on_bone = chain.points[0]
            + chain.points.windows(2).zip(&ways).map(|(bone, way)| (bone[1] - bone[0]) * *way).sum::<DVec3>();
        // A finger moves with its knuckle; the thumb, whose metacarpal is free, with the joint at its base.
        let thumb = c == 4;
        let carried = if thumb { along_palm(chain.points[1]) } else { along_palm(p) };
        moved[1].y -= share * carried * PALM_LENGTH * hand.palm_length;
        // From the knuckle on (point 2 of fingers and thumb) everything moves sideways together.
        let knuckle = chain.points[2];
        let radius = chain.radii[2];
        let beyond = (p - knuckle).dot((chain.points[3] - knuckle).normalize()) / radius;
        let free = soft_clamp(0.5 * beyond + 0.5, 0.5);
        moved[2].z += share * widening * (p.z + free * (knuckle.z - p.z));
        moved[3].x += share * THICKNESS * (p.x - on_bone.x);
        // Knuckles keep their girth; the change reaches its full size at the webs.
        moved[4] += share * GIRTH * soft_clamp(0.6 * beyond, 0.4) * (p - on_bone);
        let stretch: DVec3 = (chain.first_point..chain.points.len() - 1)
            .map(|k| (chain.points[k + 1] - chain.points[k]) * ways[k])
            .sum();
        moved[5 + LENGTH_ORDER.iter().position(|l| *l == c).unwrap_or(0)] +=
            share * FINGER_LENGTH * finger_stretch(hand, chain, c) * stretch;
    }
    moved
}

/// The tips do not change: the bones take up the growth of the whole finger.
fn finger_stretch(hand: &ProceduralHand, chain: &Chain, c: usize) -> f64 {
    let bones: f64 = chain.points[chain.first_point..].windows(2).map(|bone| bone[0].distance(bone[1])).sum();
    hand.finger_lengths.get(c).copied().unwrap_or(hand.thumb_length) / bones
}

/// The fraction of each bone that lies before a point, 0 to 1, smooth.
fn ways_along(chain: &Chain, p: DVec3) -> Vec<f64> {
    let way = |bone: &[DVec3]| {
        let axis = bone[1] - bone[0];
        soft_clamp((p - bone[0]).dot(axis) / axis.length_squared(), 0.2)
    };
    chain.points.windows(2).map(way).collect()
}

/// `x` clamped to 0..1 with its corners rounded over `reach` on both sides.
fn soft_clamp(x: f64, reach: f64) -> f64 {
    let ramp = |x: f64| {
        let within = (x + reach).max(0.0);
        if x < reach { within * within / (4.0 * reach) } else { x }
    };
    ramp(x) - ramp(x - 1.0)
}

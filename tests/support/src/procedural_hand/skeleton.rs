//! Bones, flesh and flat pattern of the built-in hand, laid out from its lengths.

use glam::{DVec2, DVec3};

use super::ProceduralHand;
use super::flesh::{Capsule, Flesh, Group, Row};
use ghand_hand_model::files::mano::JOINT_NAMES;

/// A row of bones from the forearm to a finger's tip, in space and on the cloth.
#[derive(Debug, Clone)]
pub(super) struct Chain {
    /// First of the chain's three joints in [`JOINT_NAMES`].
    pub first_joint: usize,
    /// Centres of the spheres that the bones join, metres, model axes.
    pub points: Vec<DVec3>,
    /// Their radii, metres.
    pub radii: Vec<f64>,
    /// Positions of the points on the cloth: x along the hand, y across it (thumb side negative), metres.
    pub flat: Vec<DVec2>,
    /// Which of `points` is the chain's first joint.
    pub first_point: usize,
}

/// The hand below the skin.
#[derive(Debug, Clone)]
pub(super) struct Skeleton {
    /// Index, middle, ring, little finger, thumb.
    pub chains: Vec<Chain>,
    /// The solid hand.
    pub flesh: Flesh,
    /// The outline of the cloth, in the plane x = 0 (see [`on_cloth`]).
    pub outline: Flesh,
}

/// The cloth covers half a finger: its half width is a quarter of the circumference.
pub(super) const CLOTH_PER_RADIUS: f64 = std::f64::consts::FRAC_PI_2;

/// A point of the hand: `along` from the wrist to the fingers, `across` away from the thumb, `height` towards the back.
fn at(along: f64, across: f64, height: f64) -> DVec3 {
    DVec3::new(height, -along, across)
}

/// A point of the cloth in the form that [`Flesh`] expects.
pub(super) fn on_cloth(p: DVec2) -> DVec3 {
    DVec3::new(0.0, p.x, p.y)
}

/// Unit vector at `degrees` from the middle of the hand, positive away from the thumb.
fn heading(degrees: f64) -> DVec2 {
    DVec2::from_angle(degrees.to_radians())
}

impl Skeleton {
    pub(super) fn new(hand: &ProceduralHand) -> Skeleton {
        let scale = hand.scale();
        let mut chains: Vec<Chain> = (0..4).map(|finger| finger_chain(hand, finger)).collect();
        chains.push(thumb_chain(hand));
        let flesh = flesh(hand, &chains, scale);
        let outline = outline(hand, &chains, scale);
        Skeleton { chains, flesh, outline }
    }

    /// Rest positions of the joints in MANO's order.
    pub(super) fn joints(&self) -> Vec<DVec3> {
        let mut joints = vec![DVec3::ZERO; JOINT_NAMES.len()];
        for chain in &self.chains {
            for k in 0..3 {
                joints[chain.first_joint + k] = chain.points[chain.first_point + k];
            }
        }
        joints
    }
}

/// Knuckles across the palm, as parts of the palm's width; index to little finger.
const KNUCKLE_ACROSS: [f64; 4] = [-0.41, -0.07, 0.26, 0.59];
/// Knuckles along the palm, as parts of its length.
const KNUCKLE_ALONG: [f64; 4] = [0.975, 1.0, 0.945, 0.835];
/// Directions of the fingers at rest, degrees.
const SPREAD: [f64; 4] = [-10.0, -2.0, 6.5, 16.0];
/// Directions of the fingers on the cloth, degrees: wide enough that the cloth of two fingers never meets.
const CLOTH_SPREAD: [f64; 4] = [-24.0, -6.0, 12.0, 31.0];
/// The cloth of the palm is wider than the palm, because it wraps around the edges.
const CLOTH_ACROSS: f64 = 1.28;

fn finger_chain(hand: &ProceduralHand, finger: usize) -> Chain {
    let length = hand.finger_lengths[finger];
    let base = 0.5 * hand.finger_widths[finger];
    let across = KNUCKLE_ACROSS[finger] * hand.palm_width;
    // The knuckles form an arch.
    let height = [-0.0005, 0.002, 0.0005, -0.0035][finger] * hand.scale();
    let knuckle = at(KNUCKLE_ALONG[finger] * hand.palm_length, across, height);
    let bones = if finger == 3 { [0.44, 0.28, 0.28] } else { [0.45, 0.29, 0.26] };
    let wrist_radius = 0.33 * hand.wrist_width;
    let stub_across = (hand.wrist_width * 0.5 - wrist_radius) * [-1.0, -0.35, 0.35, 1.0][finger];
    let stub = at(-0.030 * hand.scale(), stub_across, -0.001 * hand.scale());
    let carpal = at(0.012 * hand.scale(), 0.42 * across - 0.001 * hand.scale(), 0.0);
    let tip_radius = base * 0.75;
    let way = [0.0, bones[0], bones[0] + bones[1], 1.0 - tip_radius / length].map(|part| part * length);
    // Fingers bend slightly towards the palm, like relaxed fingers.
    let spread = heading(SPREAD[finger]);
    let bend = [0.0, 0.0, 0.0010, 0.0026].map(|v| v * hand.scale());
    let flat_knuckle = DVec2::new(-knuckle.y, CLOTH_ACROSS * across);
    let mut chain = Chain {
        first_joint: [1, 4, 10, 7][finger],
        points: vec![stub, carpal],
        radii: vec![wrist_radius, 0.29 * hand.wrist_width],
        flat: vec![DVec2::new(-stub.y, CLOTH_ACROSS * stub.z), DVec2::new(-carpal.y, CLOTH_ACROSS * carpal.z)],
        first_point: 2,
    };
    for k in 0..4 {
        chain.points.push(knuckle + at(way[k] * spread.x, way[k] * spread.y, -bend[k]));
        chain.radii.push(base * [0.97, 0.94, 0.86, 0.75][k]);
        chain.flat.push(flat_knuckle + way[k] * heading(CLOTH_SPREAD[finger]));
    }
    chain
}

fn thumb_chain(hand: &ProceduralHand) -> Chain {
    let length = hand.thumb_length;
    let scale = hand.scale();
    let tip_radius = 0.5 * hand.thumb_width * 0.82;
    let base = at(0.024 * scale, -0.020 * scale, -0.010 * scale);
    let ways = [0.43 * length, 0.31 * length, 0.26 * length - tip_radius];
    let directions = [at(0.70, -0.62, -0.36), at(0.78, -0.58, -0.24), at(0.84, -0.52, -0.16)];
    let stub_across = -(hand.wrist_width * 0.17);
    let mut chain = Chain {
        first_joint: 13,
        points: vec![at(-0.030 * scale, stub_across, -0.001 * scale), base],
        radii: vec![0.33 * hand.wrist_width, 0.0150 * scale],
        flat: vec![DVec2::new(-0.030 * scale, CLOTH_ACROSS * stub_across), DVec2::new(-base.y, 1.35 * base.z)],
        first_point: 1,
    };
    let flat_directions = [-60.0, -50.0, -45.0];
    for k in 0..3 {
        let point = chain.points[k + 1];
        let flat = chain.flat[k + 1];
        chain.points.push(point + ways[k] * directions[k].normalize());
        chain.flat.push(flat + ways[k] * heading(flat_directions[k]));
        chain.radii.push(0.5 * hand.thumb_width * [1.08, 0.96, 0.82][k]);
    }
    chain
}

fn flesh(hand: &ProceduralHand, chains: &[Chain], scale: f64) -> Flesh {
    let mut palm = Vec::new();
    let mut groups = Vec::new();
    for (finger, chain) in chains.iter().enumerate().take(4) {
        let head = hand.palm_thickness * [0.425, 0.44, 0.415, 0.37][finger];
        let stub = chain.points[0];
        let carpal = chain.points[1];
        let knuckle = chain.points[2];
        palm.push(curved_row([(stub, chain.radii[0]), (carpal, chain.radii[1]), (knuckle, head)]));
        let base = chain.radii[2];
        // The finger's root fades out in the palm, so that there is no step at the knuckle.
        let root = Capsule::new(carpal.lerp(knuckle, 0.40), 0.55 * base, knuckle, chain.radii[2]);
        let mut rows = vec![std::iter::once(root).chain((2..5).map(|k| bone(chain, k))).collect()];
        // The knuckle, the soft undersides and the pad of the tip: balls that protrude from the fillet by a millimetre.
        let mut pad = |from: usize, way: f64, height: f64, radius: f64| {
            let center = chain.points[from].lerp(chain.points[from + 1], way) + at(0.0, 0.0, height * base);
            rows.push(vec![Capsule::ball(center, radius * base)]);
        };
        pad(2, 0.0, 0.30, 0.68);
        pad(2, 0.55, -0.16, 0.72);
        pad(3, 0.0, 0.14, 0.70);
        pad(3, 0.5, -0.14, 0.62);
        pad(4, 0.65, -0.14, 0.58);
        groups.push(Group { fillet: 0.006 * scale, rows });
    }
    let thumb = &chains[4];
    let knuckle_of = |finger: usize| chains[finger].points[2];
    let in_forearm = |across: f64, height: f64| at(-0.010, across, height) * scale;
    // Pads rise gradually from the forearm; otherwise their ends would form steps at the wrist.
    let mut pad = |root: DVec3, from: DVec3, from_radius: f64, to: DVec3, to_radius: f64| {
        let (from_radius, to_radius) = (from_radius * scale, to_radius * scale);
        let rise = Capsule::new(root, 0.0125 * scale, from, from_radius);
        palm.push(vec![rise, Capsule::new(from, from_radius, to, to_radius)]);
    };
    // The ball of the thumb, the edge of the hand, and the hollow of the palm.
    let ball_end = thumb.points[1].lerp(thumb.points[2], 0.75);
    pad(in_forearm(-0.008, -0.003), at(0.032, -0.013, -0.0080) * scale, 0.0140, ball_end, 0.0122);
    let edge_end = knuckle_of(3) + at(-0.012, 0.0, -0.002) * scale;
    pad(in_forearm(0.009, -0.003), at(0.024, 0.0145, -0.0055) * scale, 0.0142, edge_end, 0.0118);
    let hollow_end = knuckle_of(1) + at(-0.020, 0.007, -0.0045) * scale;
    pad(in_forearm(0.001, -0.003), at(0.020, 0.001, -0.0055) * scale, 0.0130, hollow_end, 0.0105);
    // The pads below the fingers.
    let mut pad = |from: DVec3, from_radius: f64, to: DVec3, to_radius: f64| {
        palm.push(vec![Capsule::new(from, from_radius * scale, to, to_radius * scale)]);
    };
    let (index_side, little_side) = (at(-0.004, 0.001, -0.0035) * scale, at(-0.002, -0.002, -0.0030) * scale);
    pad(knuckle_of(0) + index_side, 0.0088, knuckle_of(3) + little_side, 0.0078);
    // The skin between thumb and index finger.
    let metacarpal = chains[0].points[1].lerp(knuckle_of(0), 0.62);
    pad(thumb.points[2].lerp(thumb.points[1], 0.35), 0.0085, metacarpal, 0.0080);
    groups.insert(0, Group { fillet: 0.012 * scale, rows: palm });
    let thumb_pad = thumb.points[3].lerp(thumb.points[4], 0.6) + at(0.0, 0.0, -0.0018 * scale);
    let rows = vec![(1..4).map(|k| bone(thumb, k)).collect(), vec![Capsule::ball(thumb_pad, 0.62 * thumb.radii[3])]];
    groups.push(Group { fillet: 0.006 * scale, rows });
    Flesh { groups, web: 0.005 * scale }
}

/// Capsules along a curve from the first ball to the last, bent towards the one between, so that there is no crease at
/// it.
fn curved_row([(from, from_radius), (middle, middle_radius), (to, to_radius)]: [(DVec3, f64); 3]) -> Row {
    const PARTS: usize = 4;
    // The parabola of these three control points touches both bones; it starts half way along each.
    let (start, end) = (from.midpoint(middle), middle.midpoint(to));
    let (start_radius, end_radius) = (0.5 * (from_radius + middle_radius), 0.5 * (middle_radius + to_radius));
    let bend = |way: f64| {
        let (a, b, c) = ((1.0 - way) * (1.0 - way), 2.0 * way * (1.0 - way), way * way);
        (a * start + b * middle + c * end, a * start_radius + b * middle_radius + c * end_radius)
    };
    let balls: Vec<(DVec3, f64)> = std::iter::once((from, from_radius))
        .chain((0..=PARTS).map(|i| bend(i as f64 / PARTS as f64)))
        .chain([(to, to_radius)])
        .collect();
    balls.windows(2).map(|pair| Capsule::new(pair[0].0, pair[0].1, pair[1].0, pair[1].1)).collect()
}

fn bone(chain: &Chain, k: usize) -> Capsule {
    Capsule::new(chain.points[k], chain.radii[k], chain.points[k + 1], chain.radii[k + 1])
}

fn outline(hand: &ProceduralHand, chains: &[Chain], scale: f64) -> Flesh {
    let flat_bone = |chain: &Chain, k: usize, to_radius: f64| {
        let (from, to) = (on_cloth(chain.flat[k]), on_cloth(chain.flat[k + 1]));
        Capsule::new(from, chain.radii[k] * CLOTH_PER_RADIUS, to, to_radius * CLOTH_PER_RADIUS)
    };
    let mut palm = Vec::new();
    let mut groups = Vec::new();
    for (finger, chain) in chains.iter().enumerate() {
        let mut row = vec![flat_bone(chain, 0, chain.radii[1])];
        if finger < 4 {
            row.push(flat_bone(chain, 1, hand.palm_thickness * 0.45));
        }
        palm.push(row);
        let last = chain.points.len() - 1;
        let bones = (chain.first_point..last).map(|k| flat_bone(chain, k, chain.radii[k + 1])).collect();
        groups.push(Group { fillet: 0.004 * scale, rows: vec![bones] });
    }
    let thumb = &chains[4];
    let skin = thumb.flat[2].lerp(thumb.flat[1], 0.35);
    let metacarpal = chains[0].flat[1].lerp(chains[0].flat[2], 0.62);
    palm.push(vec![Capsule::new(on_cloth(skin), 0.0130 * scale, on_cloth(metacarpal), 0.0130 * scale)]);
    groups.insert(0, Group { fillet: 0.012 * scale, rows: palm });
    Flesh { groups, web: 0.004 * scale }
}

//! Corrects the artefacts of linear blend skinning at bent joints, linearly in the joint's rotation.
//!
//! For each joint, sampled rotations give the skin as it should be ([`Bend::flesh`]); mapped back to rest through the
//! blended bones, its difference from the rest pose is fitted by the nine entries of `R - I` (ridge regression).

mod of_model;
mod volume;

use ghand_core::pose_response::rotation_features;
use ghand_core::rotation::rotation_from_axis_angle;
use glam::{DMat3, DVec3};
use rayon::prelude::*;

use crate::cholesky::solve;
pub use of_model::{fit_pose_directions, with_turned_skin};

/// Rotation features of a joint.
const FEATURES: usize = 9;
/// Weight of the smallest solution against the fit, as a part of a feature's mean square over the samples.
const RIDGE: f64 = 0.01;

/// Part of the flesh on the back that stays blended: if all of it were rotated, each joint would become a ball.
const BLENDED: f64 = 0.3;
/// How far along the finger, in half widths, the inner side of a bent joint takes part in the rotation.
const INNER_REACH: f64 = 1.3;
/// How far a joint bent by a right angle protrudes on the back and bulges inside and at its sides, in half widths.
const KNUCKLE: f64 = 0.03;
const FOLD: f64 = 0.12;
const SIDE: f64 = 0.02;
/// How far skin that a bent knuckle would push beyond the plane where palm and finger meet stays on its side of it: 1 is
/// on the plane; more, because the fit is smooth and skin between two fingers follows its own only in part.
const FOLDED: f64 = 1.3;
/// Largest twist of joints in the samples, degrees.
const TWIST: f64 = 10.0;
/// A share too small for a visible effect.
const NO_SHARE: f64 = 0.005;
/// Beyond this many half widths nothing bulges.
const FAR: f64 = 2.5;

/// The position of a vertex relative to a joint.
struct Flesh {
    /// From the joint to the vertex, metres.
    offset: DVec3,
    /// The part of the vertex that moves with the joint: its weights for the joint and all joints beyond, as a part of
    /// all weights except those of other fingers. The web between two fingers does not bend with either.
    moving: f64,
    /// How much of the vertex belongs to the joint's chain.
    share: f64,
}

/// A joint that bends.
struct Bend {
    /// Mean direction of the bones before and after it.
    along: DVec3,
    /// A rotation about this axis flexes.
    hinge: DVec3,
    /// The side towards which the joint flexes.
    inner: DVec3,
    /// Half the finger's width, metres.
    radius: f64,
    /// What the bend is of.
    kind: BendKind,
    /// What its skin does.
    skin: Skin,
}

/// What skin does at a bent joint.
#[derive(Clone, Copy, PartialEq)]
pub enum Skin {
    /// It turns by a part of the joint's angle, about as dual quaternions blend.
    Turned,
    /// It also bulges and folds, as that of our hands.
    Fleshy,
}

#[derive(Clone, Copy, PartialEq)]
enum BendKind {
    ThumbBase,
    ThumbKnuckle,
    Knuckle,
    /// All other joints.
    Hinge,
}

impl BendKind {
    /// Whether the palm shares the bend.
    fn is_in_palm(self) -> bool {
        self != BendKind::Hinge
    }
}

/// A rotation that is sampled.
struct Sample {
    axis_angle: DVec3,
    rotation: DMat3,
    /// The part of it about the hinge, radians.
    flexion: f64,
}

/// A finger or thumb: three joints that bend, one after the other.
pub struct BendingChain {
    /// The joints, from the palm to the tip.
    pub joints: [usize; 3],
    /// Joints beyond the last that move with it, such as one at the tip.
    pub beyond: Vec<usize>,
    /// The start of the bone before the first joint, the joints, and the tip, metres, model axes.
    pub points: [DVec3; 5],
    /// Half the finger's width at each joint, metres.
    pub radii: [f64; 3],
    /// Roughly the direction in which flexion moves the tip.
    pub closing: DVec3,
    /// Whether it is the thumb.
    pub is_thumb: bool,
}

/// Pose directions `[9 (n_b - 1)][V]`, metres, of a surface with skinning weights `[V][n_b]`. `shares` is how much of each
/// vertex belongs to each chain, `[V][chains]`.
pub fn pose_directions(
    vertices: &[DVec3],
    weights: &[f64],
    chains: &[BendingChain],
    shares: &[Vec<f64>],
    skin: Skin,
) -> Vec<DVec3> {
    let count = vertices.len();
    let joints = weights.len() / count.max(1);
    let mut directions = vec![DVec3::ZERO; (joints - 1) * FEATURES * count];
    // Joints of no chain: the wrist and the palm.
    let fixed: Vec<usize> = (0..joints).filter(|k| chains.iter().all(|chain| !chain.has(*k))).collect();
    for (c, chain) in chains.iter().enumerate() {
        for k in 0..3 {
            let bend = Bend::of(chain, k, skin);
            let fit = Fit::new(bend.samples());
            let moving = || chain.joints[k..].iter().chain(&chain.beyond);
            let fitted: Vec<[DVec3; FEATURES]> = (0..count)
                .into_par_iter()
                .map(|i| {
                    let row = &weights[i * joints..(i + 1) * joints];
                    let own: f64 = chain.joints.iter().chain(&chain.beyond).map(|&j| row[j]).sum();
                    let available = fixed.iter().map(|&j| row[j]).sum::<f64>() + own;
                    let flesh = Flesh {
                        offset: vertices[i] - chain.points[k + 1],
                        moving: moving().map(|&j| row[j]).sum::<f64>() / available.max(1e-9),
                        share: shares[i][c],
                    };
                    fit.directions(&bend, &flesh)
                })
                .collect();
            let rows = directions.chunks_exact_mut(count).skip((chain.joints[k] - 1) * FEATURES);
            for (f, row) in rows.take(FEATURES).enumerate() {
                row.iter_mut().zip(&fitted).for_each(|(d, all)| *d = all[f]);
            }
        }
    }
    directions
}

impl BendingChain {
    fn has(&self, joint: usize) -> bool {
        self.joints.contains(&joint) || self.beyond.contains(&joint)
    }
}

/// 0 up to 0, 1 from 1 on, smooth.
pub fn smooth_step(x: f64) -> f64 {
    let x = x.clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}

impl Bend {
    fn of(chain: &BendingChain, k: usize, skin: Skin) -> Bend {
        let direction = |from: usize| (chain.points[from + 1] - chain.points[from]).normalize();
        let along = (direction(k) + direction(k + 1)).normalize();
        let hinge = along.cross(chain.closing).normalize();
        let kind = match (chain.is_thumb, k) {
            (true, 0) => BendKind::ThumbBase,
            (true, 1) => BendKind::ThumbKnuckle,
            (false, 0) => BendKind::Knuckle,
            _ => BendKind::Hinge,
        };
        Bend { along, hinge, inner: hinge.cross(along), radius: chain.radii[k], kind, skin }
    }

    /// Flexion with a little of the other rotations, as far as the joint allows them.
    fn samples(&self) -> Vec<Sample> {
        let (flexions, side): (&[f64], f64) = match self.kind {
            BendKind::ThumbBase => (&[-40.0, -20.0, 0.0, 20.0, 40.0], 40.0),
            BendKind::Knuckle => (&[-30.0, 0.0, 25.0, 50.0, 75.0, 95.0], 20.0),
            BendKind::ThumbKnuckle | BendKind::Hinge => (&[-20.0, 0.0, 25.0, 50.0, 75.0, 100.0], 8.0),
        };
        // Sideways or twisted, not both.
        let others = [(0.0, 0.0), (-side, 0.0), (side, 0.0), (0.0, -TWIST), (0.0, TWIST)];
        (flexions.iter())
            .flat_map(|&flexion| others.map(|(sideways, twist)| (flexion.to_radians(), sideways, twist)))
            .map(|(flexion, sideways, twist)| {
                let others = sideways.to_radians() * self.inner + twist.to_radians() * self.along;
                let axis_angle = flexion * self.hinge + others;
                Sample { axis_angle, rotation: rotation_from_axis_angle(axis_angle), flexion }
            })
            .collect()
    }

    /// Correct position of the flesh, relative to the joint.
    fn flesh(&self, flesh: &Flesh, sample: &Sample) -> DVec3 {
        let turned = |part: f64| rotation_from_axis_angle(sample.axis_angle * part);
        let blended = |part: f64| DMat3::IDENTITY * (1.0 - part) + sample.rotation * part;
        let mixed = |part: f64, stays: f64| turned(part) * (1.0 - stays) + blended(part) * stays;
        if self.skin == Skin::Turned {
            return mixed(flesh.moving, BLENDED) * flesh.offset;
        }
        let inner = flesh.offset.dot(self.inner) / self.radius;
        let along = flesh.offset.dot(self.along) / self.radius;
        let sideways = flesh.offset.dot(self.hinge) / self.radius;
        // Rotated by a part of the angle instead of blended, so that it keeps its distance from the joint. On the inner
        // side of a finger the rotation spreads farther along the finger than the weights do, because the flesh of both
        // bones needs room between them.
        let in_palm = self.kind.is_in_palm();
        let spread = if in_palm { 0.0 } else { smooth_step(0.8 * inner + 0.2) };
        let part = flesh.moving + spread * (smooth_step(0.5 * (along / INNER_REACH + 1.0)) - flesh.moving);
        let stays_blended = if in_palm { BLENDED } else { BLENDED * smooth_step(0.5 - inner) };
        let posed = mixed(part, stays_blended);
        // Bulges caused by flexion: the knuckle on the back, the folds inside and the sides between.
        let squeeze = (1.0 - sample.flexion.max(0.0).cos()) * self.radius;
        let knuckle = -KNUCKLE * bump(along / 1.1) * smooth_step(-1.2 * inner);
        let fold = FOLD * bump(along / 1.6) * smooth_step(1.2 * inner);
        let side = SIDE * bump(along / 1.5) * sideways;
        let posed = posed * (flesh.offset + squeeze * ((knuckle + fold) * self.inner + side * self.hinge));
        if self.kind == BendKind::Knuckle { self.folded(posed, flesh.moving, sample.flexion) } else { posed }
    }

    /// A posed place, relative to the knuckle, on its own side of the plane in which palm and finger meet. A finger's
    /// base is as thick as the palm, so that without this the skin up to the web would be inside the palm.
    fn folded(&self, posed: DVec3, moving: f64, flexion: f64) -> DVec3 {
        let half = rotation_from_axis_angle(self.hinge * (flexion.max(0.0) / 2.0));
        let across = half * self.along;
        let within = half * self.inner;
        let distance = posed.dot(across);
        let of_finger = smooth_step((moving - 0.2) / 0.6);
        let allowed = of_finger * distance.max(0.0) + (1.0 - of_finger) * distance.min(0.0);
        let inside = smooth_step(2.0 * posed.dot(within) / self.radius);
        if flexion > 0.0 { posed + across * (FOLDED * inside * (allowed - distance)) } else { posed }
    }
}

/// The regression of a joint's samples.
struct Fit {
    samples: Vec<Sample>,
    /// Contribution of each sample's correction to each direction.
    solutions: Vec<[f64; FEATURES]>,
}

impl Fit {
    fn new(samples: Vec<Sample>) -> Fit {
        let features: Vec<[f64; FEATURES]> = samples.iter().map(|s| rotation_features(&s.rotation)).collect();
        let mut gram = vec![0.0; FEATURES * FEATURES];
        for row in &features {
            (0..FEATURES * FEATURES).for_each(|i| gram[i] += row[i / FEATURES] * row[i % FEATURES]);
        }
        let trace: f64 = (0..FEATURES).map(|i| gram[i * (FEATURES + 1)]).sum();
        (0..FEATURES).for_each(|i| gram[i * (FEATURES + 1)] += RIDGE * trace / FEATURES as f64);
        let solution = |row: &[f64; FEATURES]| {
            let solved = solve(gram.clone(), row);
            std::array::from_fn(|f| solved[f])
        };
        Fit { solutions: features.iter().map(solution).collect(), samples }
    }

    fn directions(&self, bend: &Bend, flesh: &Flesh) -> [DVec3; FEATURES] {
        let mut directions = [DVec3::ZERO; FEATURES];
        let whole = flesh.moving < 1e-6 || flesh.moving > 1.0 - 1e-6;
        if flesh.share < NO_SHARE || whole && flesh.offset.length() > FAR * bend.radius {
            return directions;
        }
        for (sample, solution) in self.samples.iter().zip(&self.solutions) {
            let blended = DMat3::IDENTITY * (1.0 - flesh.moving) + sample.rotation * flesh.moving;
            let correction = flesh.share * (blended.inverse() * bend.flesh(flesh, sample) - flesh.offset);
            directions.iter_mut().zip(solution).for_each(|(d, s)| *d += correction * *s);
        }
        directions
    }
}

/// 1 at 0, 0 at and beyond -1 and 1, smooth.
fn bump(x: f64) -> f64 {
    let rest = (1.0 - x * x).max(0.0);
    rest * rest
}

//! Changes of the skin with the pose: creases deepen and darken in bent joints, with bulges beside them; the folds on
//! the back of a joint stretch out; knuckles blanch and protrude in a fist, tendons in a stretched hand.

use ghand_core::Pose;
use glam::{DVec2, DVec3};

use super::Look;
use super::complexion::Complexion;
use super::curve::{cubic, distance};
use crate::hand::anatomy::{Anatomy, Finger, SkinPoint};
use crate::noise::{bump, noise, smoothstep};

/// Angle at which a joint is fully bent, radians.
const FULL_BEND: f64 = 1.4;
/// Differences below this, in colour or millimetres, are not visible.
const LEAST: f64 = 0.004;

/// Bend of the hand's joints in one pose.
pub(crate) struct Bend {
    /// For the three joints of each finger in turn, then for the palm; `[0, 1]`.
    slots: Vec<f64>,
}

impl Bend {
    pub(crate) fn of(anatomy: &Anatomy, pose: &Pose) -> Bend {
        let mut slots: Vec<f64> = (anatomy.fingers.iter())
            .flat_map(|f| (0..3).map(|k| pose.rotations[f.joints[k]].dot(f.bend_axis(k)) / FULL_BEND))
            .map(|bend| bend.clamp(0.0, 1.0))
            .collect();
        let bases: Vec<f64> = slots.iter().copied().step_by(3).collect();
        slots.push(bases.iter().sum::<f64>() / bases.len().max(1) as f64);
        Bend { slots }
    }
}

/// Effect of one joint, or of the palm, on a point: values at rest and fully bent, linear between.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Fold {
    /// Index into the slots of [`Bend`].
    slot: usize,
    /// Fraction of the crease's colour.
    crease: [f64; 2],
    /// Fraction of the pale colour.
    pale: [f64; 2],
    /// Metres.
    height: [f64; 2],
}

impl Fold {
    fn of(slot: usize) -> Fold {
        Fold { slot, crease: [0.0; 2], pale: [0.0; 2], height: [0.0; 2] }
    }

    fn add(sum: &mut [f64; 2], values: [f64; 2], part: f64) {
        sum.iter_mut().zip(values).for_each(|(sum, value)| *sum += value * part);
    }

    fn is_seen(&self) -> bool {
        let colors = self.crease.iter().chain(&self.pale).any(|v| v.abs() > LEAST);
        colors || self.height.iter().any(|v| v.abs() > LEAST * 1e-3)
    }
}

/// The skin in a pose, from its pose-independent appearance.
pub(crate) fn bent(still: &Look, folds: &[Fold], bend: &Bend, complexion: &Complexion) -> Look {
    let mut crease = 0.0;
    let mut pale = 0.0;
    let mut height = still.height;
    for fold in folds {
        let at = |[rest, full]: [f64; 2]| rest + (full - rest) * bend.slots[fold.slot];
        crease += at(fold.crease);
        pale += at(fold.pale);
        height += at(fold.height);
    }
    let color = still.color.lerp(complexion.pale, pale.clamp(0.0, 0.7));
    Look { color: color.lerp(complexion.crease, crease.clamp(0.0, 0.85)), height }
}

/// The folds of one hand.
pub(crate) struct Folds<'a> {
    anatomy: &'a Anatomy,
    seed: u64,
    /// The three great lines of the palm, as (along, across), metres.
    palm_lines: Vec<Vec<DVec2>>,
}

impl Folds<'_> {
    pub(crate) fn new(anatomy: &Anatomy, seed: u64) -> Folds<'_> {
        let line =
            |points: [(f64, f64); 4]| cubic(points.map(|(along, across)| anatomy.between_knuckles(along, across)));
        let palm_lines = vec![
            line([(0.97, 1.10), (0.86, 0.68), (0.95, 0.36), (1.17, 0.22)]),
            line([(0.85, -0.12), (0.79, 0.26), (0.71, 0.54), (0.53, 0.80)]),
            line([(0.86, -0.12), (0.79, 0.31), (0.43, 0.43), (0.17, 0.38)]),
        ];
        Folds { anatomy, seed, palm_lines }
    }

    /// The folds that touch a point.
    pub(crate) fn at(&self, point: &SkinPoint) -> Vec<Fold> {
        let palm_part = point.palm_part();
        // Most points have none or one, and there are a million points.
        let mut folds: Vec<Fold> = Some(self.palm(point, palm_part)).filter(Fold::is_seen).into_iter().collect();
        for (i, (finger, &membership)) in self.anatomy.fingers.iter().zip(point.finger_weights).enumerate() {
            let on_nail = finger.nail.as_ref().is_some_and(|nail| nail.part_of(point.position, point.normal) > 0.5);
            if membership + palm_part <= 0.2 || on_nail && membership > 0.5 {
                continue;
            }
            for k in 0..3 {
                let mut fold = Fold::of(3 * i + k);
                self.knuckle(finger, k, point, membership, &mut fold);
                if membership > 0.5 {
                    self.flexion_crease(finger, k, point, &mut fold);
                    self.back_folds(finger, k, point, &mut fold);
                }
                if k == 0 && !finger.is_thumb {
                    self.tendon(finger, point, palm_part, &mut fold);
                }
                folds.extend(Some(fold).filter(Fold::is_seen));
            }
        }
        folds
    }

    fn palm(&self, point: &SkinPoint, palm_part: f64) -> Fold {
        let s = self.anatomy.scale;
        let mut fold = Fold::of(3 * self.anatomy.fingers.len());
        let on_palm = smoothstep(0.2, 0.6, -self.anatomy.facing(point)) * palm_part;
        if on_palm > 0.0 {
            let faint = 0.7 + 0.3 * noise(point.position, 0.012 * s, self.seed + 55);
            let wobble = 0.0008 * s * noise(point.position, 0.005 * s, self.seed + 50);
            for line in &self.palm_lines {
                let d = distance(line, self.anatomy.on_palm(point.position)) + wobble;
                Fold::add(&mut fold.crease, [0.32, 0.75], on_palm * faint * bump(d, 0.0009 * s));
                Fold::add(&mut fold.height, [-0.0004, -0.0011], s * on_palm * bump(d, 0.0013 * s));
                Fold::add(&mut fold.height, [0.0, 0.0004], s * on_palm * bump(d.abs() - 0.003 * s, 0.0018 * s));
            }
        }
        fold
    }

    /// Knuckles protrude and blanch.
    fn knuckle(&self, finger: &Finger, k: usize, point: &SkinPoint, membership: f64, fold: &mut Fold) {
        let s = self.anatomy.scale;
        let size = [0.0062, 0.0048, 0.0038][k] * s;
        let offset = (point.position - finger.points[k]).reject_from(finger.dorsal);
        let above = smoothstep(0.1, 0.7, point.normal.dot(finger.dorsal)) * if k == 0 { 1.0 } else { membership };
        let near = bump(offset.length(), size) * above;
        Fold::add(&mut fold.pale, [0.0, 0.55], near);
        Fold::add(&mut fold.height, [0.0, [0.0011, 0.0007, 0.0004][k]], s * near);
    }

    /// Ridges from the wrist to each knuckle.
    fn tendon(&self, finger: &Finger, point: &SkinPoint, palm_part: f64, fold: &mut Fold) {
        let s = self.anatomy.scale;
        let on_back = smoothstep(0.35, 0.75, self.anatomy.facing(point)) * palm_part;
        if on_back > 0.0 {
            let knuckle = self.anatomy.on_palm(finger.points[0]);
            let line = [DVec2::new(0.012 * s, knuckle.y * 0.3), knuckle];
            let ridge = on_back * bump(distance(&line, self.anatomy.on_palm(point.position)), 0.0026 * s);
            Fold::add(&mut fold.height, [0.0008, 0.0002], s * ridge);
            Fold::add(&mut fold.pale, [0.18, 0.04], ridge);
        }
    }

    /// The creases across the palm's side of a finger: one at its base and its last joint, two at the middle one.
    fn flexion_crease(&self, finger: &Finger, k: usize, point: &SkinPoint, fold: &mut Fold) {
        let s = self.anatomy.scale;
        let below = smoothstep(-0.35, 0.25, -point.normal.dot(finger.dorsal));
        if below == 0.0 {
            return;
        }
        let warp = 0.0007 * s * noise(point.position, 0.004 * s, self.seed + 70);
        let faint = 0.7 + 0.3 * noise(point.position, 0.006 * s, self.seed + 75);
        let (along, _) = distances(finger, k, point);
        let lines: &[f64] = if k == 1 { &[-0.0010, 0.0012] } else { &[0.0] };
        for line in lines {
            let d = along + warp - line * s;
            Fold::add(&mut fold.crease, [0.34, 0.85], below * faint * bump(d, 0.00075 * s));
            Fold::add(&mut fold.height, [-0.0003, -0.0008], s * below * bump(d, 0.0011 * s));
        }
        let beside = bump(along.abs() - 0.0036 * s, 0.0020 * s);
        Fold::add(&mut fold.height, [0.0, 0.0004], s * below * beside);
    }

    /// Folds on the back of a joint, which curve away from its middle and stretch out when it bends.
    fn back_folds(&self, finger: &Finger, k: usize, point: &SkinPoint, fold: &mut Fold) {
        let s = self.anatomy.scale;
        let above = smoothstep(0.25, 0.7, point.normal.dot(finger.dorsal));
        if k == 0 || above == 0.0 {
            return;
        }
        let warp = 0.0007 * s * noise(point.position, 0.004 * s, self.seed + 70);
        let (along, across) = distances(finger, k, point);
        // The thumb's base is wider than its folds.
        let beside = smoothstep(1.15, 0.9, across.abs() / finger.radius);
        let reach = [0.0, 0.0042, 0.0026][k] * s;
        for i in -2..=2 {
            let center = f64::from(i) * 0.0019 * s;
            let bowed = along + warp - center * (1.0 - 0.35 * (across / (0.006 * s)).powi(2).min(2.0));
            let depth = above * beside * bump(bowed, 0.00055 * s) * bump(center, reach);
            Fold::add(&mut fold.crease, [0.45, 0.02], depth);
            Fold::add(&mut fold.height, [-0.00035, 0.0], s * depth);
        }
    }
}

/// Distances of a place from a joint's crease, along and across the finger, metres.
fn distances(finger: &Finger, k: usize, point: &SkinPoint) -> (f64, f64) {
    let axis: DVec3 =
        if k == 0 { finger.direction(0) } else { (finger.direction(k - 1) + finger.direction(k)).normalize() };
    // The crease at a finger's base is where it leaves the palm, not at the knuckle.
    let beyond = match (k, finger.is_thumb) {
        (0, true) => 0.05,
        (0, false) => 0.47,
        _ => 0.0,
    };
    let start = finger.points[k] + axis * beyond * finger.points[0].distance(finger.points[1]);
    let offset = point.position - start;
    (offset.dot(axis), offset.dot(finger.dorsal.cross(axis)))
}

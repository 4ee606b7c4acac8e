//! Positions of the parts of a hand: fingers, their tips, backs and sides, computed from the hand model alone.

use ghand_core::{HandModel, Side};
use ghand_hand_model::builtin::builtin_hand;
use ghand_hand_model::joints::names::{Finger as FingerName, finger_joints};
use ghand_hand_model::named_poses::named_pose;
use glam::{DVec2, DVec3};

use crate::skin::nails::{LastBone, NailPlate};

/// One finger: three joints in a row and a tip.
#[derive(Debug, Clone)]
pub(crate) struct Finger {
    /// Indices of its joints, base to tip.
    pub joints: [usize; 3],
    /// Rest positions of the joints and of the outermost point of the tip, metres.
    pub points: [DVec3; 4],
    /// Unit direction in which the nail faces, across the last bone.
    pub dorsal: DVec3,
    /// Half the width of the last bone, metres.
    pub radius: f64,
    /// Whether it is the thumb.
    pub is_thumb: bool,
    /// Its nail, if the mesh models it.
    pub(crate) nail: Option<NailPlate>,
}

impl Finger {
    /// Unit direction of the bone that starts at joint `k` of the finger.
    pub fn direction(&self, k: usize) -> DVec3 {
        (self.points[k + 1] - self.points[k]).normalize()
    }

    /// Unit axis about which joint `k` bends: a positive angle moves the tip towards the palm.
    pub fn bend_axis(&self, k: usize) -> DVec3 {
        self.dorsal.cross(self.direction(k)).normalize()
    }
}

/// The fingers of a right hand: fingers along -Y, back of the hand +X, thumb side -Z.
#[derive(Debug, Clone)]
pub(crate) struct Anatomy {
    /// In MANO's order: index, middle, little, ring finger, thumb.
    pub fingers: Vec<Finger>,
    /// Rest position of the wrist, metres.
    pub wrist: DVec3,
    /// Distance from the wrist to the farthest finger base relative to a usual hand's 90 mm.
    pub scale: f64,
    /// Of a hand with modelled nails, which is shaped like a person's: rotations of the thumb's joints that lay it over
    /// the fingers of a fist, axis-angle, radians.
    pub folded_thumb: Option<[DVec3; 3]>,
}

/// The order of [`Anatomy::fingers`].
const FINGERS: [FingerName; 5] =
    [FingerName::Index, FingerName::Middle, FingerName::Little, FingerName::Ring, FingerName::Thumb];

impl Anatomy {
    /// The anatomy of a model whose joint names identify the three joints of each finger.
    pub fn of(model: &HandModel) -> Anatomy {
        let fingers: Vec<Finger> =
            FINGERS.into_iter().filter_map(|name| Some(finger(model, name, finger_joints(name, model)?))).collect();
        let reach = fingers.iter().map(|f| (f.points[0] - model.joints[0]).length()).fold(0.0, f64::max);
        // Only the built-in hand's mesh has nails.
        let is_builtin = fingers.iter().any(|f| f.is_thumb && f.nail.is_some());
        let folded_thumb = if is_builtin { folded_thumb() } else { None };
        Anatomy { fingers, wrist: model.joints[0], scale: reach / 0.090, folded_thumb }
    }

    /// A position in the plane of the palm: from the wrist along the fingers, and across from the thumb's side; metres.
    pub(crate) fn on_palm(&self, position: DVec3) -> DVec2 {
        let offset = position - self.wrist;
        DVec2::new(-offset.y, offset.z)
    }

    /// A point of the palm, metres as in [`Anatomy::on_palm`], from its place between the knuckles: `along` is 0 at the
    /// wrist and 1 at the knuckles, `across` 0 at the index finger and 1 at the little finger.
    pub(crate) fn between_knuckles(&self, along: f64, across: f64) -> DVec2 {
        let knuckle = |i: usize| self.fingers.get(i).map_or(DVec2::ZERO, |f| self.on_palm(f.points[0]));
        let base = knuckle(0).lerp(knuckle(2), across);
        DVec2::new(base.x * along, base.y)
    }

    /// 1 where the skin faces away from the palm, -1 where it faces in the palm's direction.
    pub(crate) fn facing(&self, point: &SkinPoint) -> f64 {
        let mut dorsal = DVec3::X;
        for (finger, &membership) in self.fingers.iter().zip(point.finger_weights) {
            dorsal = dorsal.lerp(finger.dorsal, membership.clamp(0.0, 1.0));
        }
        point.normal.dot(dorsal.normalize())
    }

    /// How much of a vertex moves with each finger, from its row of skinning weights.
    pub fn finger_weights(&self, weights: &[f64]) -> Vec<f64> {
        self.fingers.iter().map(|f| f.joints.iter().map(|&j| weights[j]).sum()).collect()
    }
}

/// A point on the skin.
pub(crate) struct SkinPoint<'a> {
    /// At rest, metres, model axes.
    pub position: DVec3,
    /// Unit normal, outwards.
    pub normal: DVec3,
    /// How much of it belongs to each finger of the anatomy, `[0, 1]`.
    pub finger_weights: &'a [f64],
}

impl SkinPoint<'_> {
    /// How much of it does not belong to any finger, `[0, 1]`.
    pub(crate) fn palm_part(&self) -> f64 {
        1.0 - self.finger_weights.iter().sum::<f64>().clamp(0.0, 1.0)
    }
}

/// Rotations of the built-in hand's thumb in a fist, the same for its layout in MANO's joints.
fn folded_thumb() -> Option<[DVec3; 3]> {
    let hand = builtin_hand(Side::Right).ok()?;
    let fist = named_pose("fist", &hand)?;
    Some(finger_joints(FingerName::Thumb, &hand)?.map(|joint| fist.rotations[joint]))
}

fn finger(model: &HandModel, name: FingerName, joints: [usize; 3]) -> Finger {
    let [base, middle, last] = joints.map(|j| model.joints[j]);
    let along = (last - middle).normalize();
    let of_tip: Vec<DVec3> = (0..model.vertices.len())
        .filter(|&v| model.vertex_weights(v)[joints[2]] > 0.6)
        .map(|v| model.vertices[v] - last)
        .collect();
    let length = of_tip.iter().map(|p| p.dot(along)).fold(0.0, f64::max);
    let across: Vec<f64> = of_tip
        .iter()
        .filter(|p| (p.dot(along) / length - 0.4).abs() < 0.3)
        .map(|p| p.reject_from(along).length())
        .collect();
    let radius = across.iter().sum::<f64>() / across.len().max(1) as f64;
    let is_thumb = name == FingerName::Thumb;
    // The thumb is rotated relative to the fingers: its nail faces away from the palm and to its own side.
    let facing = if is_thumb { DVec3::new(0.75, 0.0, -0.65) } else { DVec3::X };
    let dorsal = facing.reject_from(along).normalize();
    let tip = last + along * length;
    let nail = NailPlate::of(model, &LastBone { joint: joints[2], along, tip, length, dorsal });
    let dorsal = match &nail {
        Some(nail) if is_thumb => nail.normal.reject_from(along).normalize(),
        _ => dorsal,
    };
    Finger { joints, points: [base, middle, last, tip], dorsal, radius, is_thumb, nail }
}

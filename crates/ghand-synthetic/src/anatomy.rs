//! Positions of the parts of a hand: fingers, their tips, backs and sides, computed from the hand model alone.

use ghand_core::HandModel;
use glam::{DVec2, DVec3};

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
    /// In the order of the model's joints.
    pub fingers: Vec<Finger>,
    /// Distance from the wrist to the farthest finger base relative to a usual hand's 90 mm.
    pub scale: f64,
}

impl Anatomy {
    /// The anatomy of a model whose fingers are chains of three joints below the root.
    pub fn of(model: &HandModel) -> Anatomy {
        let child_of = |parent: usize| (0..model.joint_count()).find(|&k| model.parents[k] == Some(parent));
        let fingers: Vec<Finger> = (0..model.joint_count())
            .filter(|&k| model.parents[k] == Some(0))
            .filter_map(|base| {
                let middle = child_of(base)?;
                Some(finger(model, [base, middle, child_of(middle)?]))
            })
            .collect();
        let reach = fingers.iter().map(|f| (f.points[0] - model.joints[0]).length()).fold(0.0, f64::max);
        Anatomy { fingers, scale: reach / 0.090 }
    }

    /// 1 where the skin faces away from the palm, -1 where it faces in the palm's direction.
    pub(super) fn facing(&self, point: &SkinPoint) -> f64 {
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
pub(super) struct SkinPoint<'a> {
    /// At rest, metres, model axes.
    pub position: DVec3,
    /// Unit normal, outwards.
    pub normal: DVec3,
    /// How much of it belongs to each finger of the anatomy, `[0, 1]`.
    pub finger_weights: &'a [f64],
}

impl SkinPoint<'_> {
    /// How much of it does not belong to any finger, `[0, 1]`.
    pub(super) fn palm_part(&self) -> f64 {
        1.0 - self.finger_weights.iter().sum::<f64>().clamp(0.0, 1.0)
    }

    /// Its position in the plane of the palm: from the wrist along the fingers, and across from the thumb's side;
    /// metres.
    pub(super) fn on_palm(&self) -> DVec2 {
        DVec2::new(-self.position.y, self.position.z)
    }
}

fn finger(model: &HandModel, joints: [usize; 3]) -> Finger {
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
    let is_thumb = model.joint_names[joints[0]].contains("thumb");
    // The thumb is rotated relative to the fingers: its nail faces away from the palm and to its own side.
    let facing = if is_thumb { DVec3::new(0.75, 0.0, -0.65) } else { DVec3::X };
    Finger {
        joints,
        points: [base, middle, last, last + along * length],
        dorsal: facing.reject_from(along).normalize(),
        radius,
        is_thumb,
    }
}

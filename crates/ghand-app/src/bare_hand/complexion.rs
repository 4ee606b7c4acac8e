//! The colours of a hand without an avatar: skin by the side that it is on, rosier tips and knuckles, nails.

use ghand_core::HandModel;
use ghand_hand_model::joints::axes::{RestBones, fingertips};
use ghand_hand_model::joints::names::{Finger, JointRole};
use glam::{DMat3, DVec2, DVec3};

/// Colours, display values.
pub(super) const BACK: DVec3 = DVec3::new(0.87, 0.66, 0.55);
const PALM: DVec3 = DVec3::new(0.94, 0.76, 0.67);
/// Where more blood shows.
const BLOOD: DVec3 = DVec3::new(0.87, 0.49, 0.43);
pub(super) const NAIL: DVec3 = DVec3::new(0.95, 0.73, 0.67);
/// The nail's free edge and lunula.
const NAIL_EDGE: DVec3 = DVec3::new(0.96, 0.90, 0.85);
/// The skin around a nail.
const NAIL_FOLD: DVec3 = DVec3::new(0.72, 0.46, 0.38);

/// Half width of a fingertip whose skin cannot be measured, metres.
const USUAL_RADIUS: f64 = 0.008;

/// The parts of a hand that have their own colour.
pub(super) struct Complexion {
    /// The direction that the back faces, for each joint; none if the joints' names are unknown.
    backs: Vec<DVec3>,
    fingers: Vec<FingerParts>,
}

struct FingerParts {
    /// Joints, base to tip, and the way that the back of the finger faces there.
    knuckles: [(DVec3, DVec3); 3],
    last_joint: usize,
    tip: DVec3,
    /// Axes of the last bone: to the right, out of the nail, towards the joint.
    frame: DMat3,
    /// Half the width of the last bone, metres.
    radius: f64,
}

impl Complexion {
    pub(super) fn of(model: &HandModel) -> Complexion {
        Complexion::by_roles(model).unwrap_or(Complexion { backs: vec![], fingers: vec![] })
    }

    fn by_roles(model: &HandModel) -> Option<Complexion> {
        let roles = JointRole::of_joints(&model.joint_names);
        let tips = fingertips(model, &roles);
        let bones = RestBones { side: model.side, roles: &roles, joints: &model.joints, tips: &tips };
        let frames = bones.frames()?;
        let finger = |(finger, tip): (Finger, &DVec3)| {
            let joint = |k| roles.iter().position(|role| *role == Some(JointRole::Bend(finger, k)));
            let last_joint = joint(3)?;
            let knuckle = |k| joint(k).map(|k| (model.joints[k], frames[k].y_axis));
            let frame = frames[last_joint];
            let radius = radius(model, last_joint, *tip, &frame);
            Some(FingerParts {
                knuckles: [knuckle(1)?, knuckle(2)?, knuckle(3)?],
                last_joint,
                tip: *tip,
                frame,
                radius,
            })
        };
        let fingers: Option<Vec<FingerParts>> = Finger::ALL.into_iter().zip(&tips).map(finger).collect();
        Some(Complexion { backs: frames.iter().map(|frame| frame.y_axis).collect(), fingers: fingers? })
    }

    /// The colour of a point of the rest surface, from its position, its unit normal and its skinning weights.
    pub(super) fn color<'a>(&self, p: DVec3, normal: DVec3, weights: impl Iterator<Item = &'a f64> + Clone) -> DVec3 {
        if self.backs.is_empty() {
            return BACK;
        }
        let back: DVec3 = self.backs.iter().zip(weights.clone()).map(|(back, weight)| *back * *weight).sum();
        let mut color = PALM.lerp(BACK, smooth_step(0.5 + 0.9 * normal.dot(back.normalize_or_zero())));
        for finger in &self.fingers {
            let own = weights.clone().nth(finger.last_joint).copied().unwrap_or_default();
            color = finger.redden(color, p, normal, own);
            if own > 0.5 {
                color = finger.paint_nail(color, p, normal);
            }
        }
        color
    }
}

impl FingerParts {
    /// Knuckles and the tip are rosier.
    fn redden(&self, color: DVec3, p: DVec3, normal: DVec3, own: f64) -> DVec3 {
        let mut color = color;
        for ((joint, back), size) in self.knuckles.into_iter().zip([1.25, 1.0, 0.7]) {
            let above = smooth_step(normal.dot(back));
            let near = bump((p - joint).reject_from(back).length() / (size * self.radius));
            color = color.lerp(BLOOD, 0.30 * near * above);
        }
        color.lerp(BLOOD, 0.30 * own * bump(p.distance(self.tip) / (1.7 * self.radius)))
    }

    fn paint_nail(&self, color: DVec3, p: DVec3, normal: DVec3) -> DVec3 {
        let (across, up, along) = (self.frame.x_axis, self.frame.y_axis, -self.frame.z_axis);
        let offset = p - self.tip;
        let up = smooth_step((normal.dot(up) - 0.05) / 0.3);
        let (half_length, half_width) = (0.78 * self.radius, 0.80 * self.radius);
        // In half lengths from the nail's middle, and in half widths.
        let along = (offset.dot(along) + 0.24 * self.radius + half_length) / half_length;
        let across = offset.dot(across) / half_width;
        // 1 on the outline, which is between an ellipse and a rectangle.
        let outline = (along.abs().powf(3.5) + across.abs().powf(3.0)).powf(0.3);
        let fold = up * bump((outline - 1.08) / 0.10) * smooth_step((0.9 - along) / 0.6);
        let lunula = smooth_step((0.38 - DVec2::new(along + 0.95, 0.8 * across).length()) / 0.14);
        let nail = NAIL.lerp(NAIL_EDGE, smooth_step((along - 0.74) / 0.12)).lerp(NAIL_EDGE, 0.5 * lunula);
        color.lerp(NAIL_FOLD, 0.45 * fold).lerp(nail, up * smooth_step((1.04 - outline) / 0.09))
    }
}

/// Half the width of a finger's last bone, metres: mean distance of its skin from the bone.
fn radius(model: &HandModel, joint: usize, tip: DVec3, frame: &DMat3) -> f64 {
    let length = tip.distance(model.joints[joint]);
    let own = (0..model.vertices.len()).filter(|&v| model.vertex_weights(v)[joint] > 0.6);
    let offsets = own.map(|v| model.vertices[v] - model.joints[joint]);
    let around: Vec<f64> = offsets
        .filter(|offset| (-offset.dot(frame.z_axis) / length - 0.4).abs() < 0.3)
        .map(|offset| offset.reject_from(frame.z_axis).length())
        .collect();
    if around.is_empty() { USUAL_RADIUS } else { around.iter().sum::<f64>() / around.len() as f64 }
}

/// 0 up to 0, 1 from 1 on, smooth.
fn smooth_step(x: f64) -> f64 {
    let x = x.clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}

/// 1 at 0, 0 at and beyond -1 and 1, smooth.
fn bump(x: f64) -> f64 {
    let rest = (1.0 - x * x).max(0.0);
    rest * rest
}

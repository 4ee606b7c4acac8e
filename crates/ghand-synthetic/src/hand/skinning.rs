//! Skinning of the true hand: mostly by dual quaternions, which preserve a joint's volume where linear blending loses
//! it.

use ghand_core::skeleton::{Affine, pose_skeleton};
use ghand_core::{HandModel, Pose};
use glam::{DQuat, DVec3, DVec4};
use rayon::prelude::*;

/// Fraction of the dual quaternion result; the rest is linear. Pure dual quaternions bulge at joints more than flesh
/// does.
const DUAL_QUATERNION_PART: f64 = 0.75;

/// A rigid motion as a unit dual quaternion: `real` rotates, `dual` = 0.5 translation x real.
#[derive(Clone, Copy)]
struct DualQuaternion {
    real: DVec4,
    dual: DVec4,
}

impl DualQuaternion {
    fn of(motion: &Affine) -> DualQuaternion {
        let real = DQuat::from_mat3(&motion.linear).normalize();
        let t = motion.translation * 0.5;
        let dual = DQuat::from_xyzw(t.x, t.y, t.z, 0.0) * real;
        DualQuaternion { real: DVec4::from(real), dual: DVec4::from(dual) }
    }

    fn apply(self, p: DVec3) -> DVec3 {
        let length = self.real.length();
        let real = DQuat::from_vec4(self.real / length);
        let dual = DQuat::from_vec4(self.dual / length);
        let translation = 2.0 * (dual * real.conjugate()).xyz();
        real * p + translation
    }
}

/// World positions of rest points that follow the model's joints by its vertices' weights, metres.
pub(crate) fn pose_vertices(model: &HandModel, rest: &[DVec3], pose: &Pose) -> Vec<DVec3> {
    let motions = pose_skeleton(&model.parents, &model.joints, &pose.rotations).posed_from_rest;
    let duals: Vec<DualQuaternion> = motions.iter().map(DualQuaternion::of).collect();
    (rest.par_iter().enumerate())
        .map(|(v, &p)| {
            let weights = model.vertex_weights(v);
            let strongest = (0..weights.len()).max_by(|&a, &b| weights[a].total_cmp(&weights[b])).unwrap_or(0);
            let mut blend = DualQuaternion { real: DVec4::ZERO, dual: DVec4::ZERO };
            let mut linear = DVec3::ZERO;
            for (k, &w) in weights.iter().enumerate().filter(|(_, w)| **w > 0.0) {
                // q and -q are the same motion; they must not cancel.
                let sign = if duals[k].real.dot(duals[strongest].real) < 0.0 { -w } else { w };
                blend.real += duals[k].real * sign;
                blend.dual += duals[k].dual * sign;
                linear += motions[k].apply(p) * w;
            }
            linear.lerp(blend.apply(p), DUAL_QUATERNION_PART) + pose.translation
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use ghand_test_support::procedural_hand::ProceduralHand;

    use super::*;

    #[test]
    fn a_rigid_motion_is_kept_and_a_bent_joint_follows_its_bone() {
        let model = ProceduralHand { detail: 1, ..Default::default() }.build().unwrap();
        let mut pose = Pose::rest(model.joint_count());
        pose.rotations[0] = DVec3::new(0.4, -0.3, 0.9);
        pose.rotations[2] = DVec3::new(0.1, 0.2, -1.0);
        pose.translation = DVec3::new(0.1, 0.2, 0.3);
        let posed = pose_vertices(&model, &model.vertices, &pose);
        let motions = pose_skeleton(&model.parents, &model.joints, &pose.rotations).posed_from_rest;
        let mut rigid = 0;
        for (v, p) in posed.iter().enumerate() {
            let weights = model.vertex_weights(v);
            if let Some(k) = weights.iter().position(|w| *w > 1.0 - 1e-12) {
                rigid += 1;
                assert!((*p - motions[k].apply(model.vertices[v]) - pose.translation).length() < 1e-12);
            }
        }
        assert!(rigid > 100);
    }
}

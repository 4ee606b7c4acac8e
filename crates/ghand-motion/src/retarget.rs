//! Transfers poses of one skeleton to another.
//!
//! Joints are matched by the roles that their names identify ([`JointRole`]). Let `G_k` be the rotation of joint k in
//! space, the product of the rotations from the root on, and `F_k` its rest frame ([`RestSkeleton`]), so that `G_k F_k`
//! is the bone's frame in space. The other skeleton's bone gets the same frame: `G'_k F'_k = G_k F_k`, so
//! `G'_k = G_k C_k` with the constant `C_k = F_k F'_k^T`, and `R'_k = G'_parent^T G'_k`. So corresponding bones point
//! in the same direction for any two rest poses; each skeleton keeps its own lengths. Joints that the source lacks
//! (WebXR's metacarpals and tips, for MANO) keep their rest angle to their parent. The wrist gets the same position.
//!
//! A transfer and back is the identity for all joints that both skeletons have, if joints that only one has are at
//! rest; otherwise bones still point in the same directions.
//!
//! The mirror image in x of a pose is a pose of the mirrored hand: `M R M` with `M = diag(-1, 1, 1)` turns the
//! axis-angle vector (x, y, z) into (x, -y, -z). Mirroring takes place before matching.

use ghand_core::Pose;
use ghand_core::rotation::{axis_angle_from_rotation, rotation_from_axis_angle};
use ghand_hand_model::joints::names::JointRole;
use glam::{DMat3, DVec3};

use crate::rest_skeleton::RestSkeleton;

/// A transfer from one skeleton to another.
#[derive(Debug, Clone)]
pub struct Retarget {
    source_parents: Vec<Option<usize>>,
    target_parents: Vec<Option<usize>>,
    /// For each joint of the target, the joint of the source and `C_k`.
    matches: Vec<Option<(usize, DMat3)>>,
    /// Rest positions of the wrists.
    source_wrist: DVec3,
    target_wrist: DVec3,
    mirror: bool,
}

impl Retarget {
    /// The transfer from `source` to `target`. Hands of the other side are mirrored.
    pub fn new(source: &RestSkeleton, target: &RestSkeleton) -> Retarget {
        let mirror = source.side != target.side;
        let matched = |joint: usize| {
            let role = target.roles.get(joint).copied().flatten()?;
            let from = source.joint(role)?;
            let source_frame = *source.frames.get(from)?;
            // The mirrored bone has -Z and +Y mirrored; its X is chosen so that they are a rotation again.
            let flip = DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0));
            let source_frame = if mirror { flip * source_frame * flip } else { source_frame };
            Some((from, source_frame * target.frames.get(joint)?.transpose()))
        };
        let wrist = |rig: &RestSkeleton| rig.joint_position(JointRole::Wrist).unwrap_or_default();
        Retarget {
            source_parents: source.parents.clone(),
            target_parents: target.parents.clone(),
            matches: (0..target.joints.len()).map(matched).collect(),
            source_wrist: if mirror { mirrored_point(wrist(source)) } else { wrist(source) },
            target_wrist: wrist(target),
            mirror,
        }
    }

    /// The pose of the target that corresponds to a pose of the source. Joints without a rotation are at rest.
    pub fn pose(&self, pose: &Pose) -> Pose {
        let pose = if self.mirror { pose.mirrored() } else { pose.clone() };
        let mut source: Vec<DMat3> = Vec::with_capacity(self.source_parents.len());
        for (joint, parent) in self.source_parents.iter().enumerate() {
            let own = rotation_from_axis_angle(pose.rotations.get(joint).copied().unwrap_or_default());
            source.push(parent.and_then(|p| source.get(p).copied()).unwrap_or(DMat3::IDENTITY) * own);
        }
        let mut target: Vec<DMat3> = Vec::with_capacity(self.target_parents.len());
        let mut rotations = Vec::with_capacity(self.target_parents.len());
        for (matched, parent) in self.matches.iter().zip(&self.target_parents) {
            let above = parent.and_then(|p| target.get(p).copied()).unwrap_or(DMat3::IDENTITY);
            let here = match matched {
                Some((from, offset)) => source.get(*from).copied().unwrap_or(DMat3::IDENTITY) * *offset,
                None => above,
            };
            rotations.push(axis_angle_from_rotation(&(above.transpose() * here)));
            target.push(here);
        }
        Pose { rotations, translation: self.source_wrist + pose.translation - self.target_wrist }
    }
}

/// A point mirrored in x.
pub fn mirrored_point(point: DVec3) -> DVec3 {
    DVec3::new(-point.x, point.y, point.z)
}

#[cfg(test)]
mod tests;

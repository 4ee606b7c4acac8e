//! The rigid kinematic chain (paper eq. 3 and 10) and its derivative.

use glam::{DMat3, DVec3};

use crate::rotation::{rotation_from_axis_angle, rotation_from_axis_angle_vjp};

/// A rigid or affine map `x -> linear * x + translation`, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Affine {
    /// The linear part.
    pub linear: DMat3,
    /// The translation, metres.
    pub translation: DVec3,
}

impl Affine {
    /// The map that is zero everywhere: the start of sums and gradients.
    pub const ZERO: Affine = Affine { linear: DMat3::ZERO, translation: DVec3::ZERO };

    /// The image of a point.
    pub fn apply(&self, x: DVec3) -> DVec3 {
        self.linear * x + self.translation
    }

    /// `self + weight * other`, entry by entry.
    pub fn add_scaled(&self, weight: f64, other: &Affine) -> Affine {
        Affine {
            linear: self.linear + other.linear * weight,
            translation: self.translation + other.translation * weight,
        }
    }
}

/// A posed kinematic chain: `G_0 = [R_0 | J_0]`, `G_k = G_parent [R_k | J_k - J_parent]`, `B_k = G_k T(-J_k)`.
#[derive(Debug, Clone, PartialEq)]
pub struct Chain {
    /// Local rotations `R_k`.
    pub local: Vec<DMat3>,
    /// `world_from_joint`: `G_k`, without the hand's global translation.
    pub world: Vec<Affine>,
    /// `posed_from_rest`: `B_k`, without the hand's global translation.
    pub posed_from_rest: Vec<Affine>,
}

/// Poses a skeleton: parents (a parent precedes its children), `n_b` rest joints (metres), `n_b` axis-angle rotations
/// (radians). The three must have the same length.
pub fn pose_skeleton(parents: &[Option<usize>], joints: &[DVec3], rotations: &[DVec3]) -> Chain {
    let local: Vec<DMat3> = rotations.iter().map(|&v| rotation_from_axis_angle(v)).collect();
    let mut world: Vec<Affine> = Vec::with_capacity(joints.len());
    for (k, parent) in parents.iter().enumerate() {
        world.push(match parent {
            None => Affine { linear: local[k], translation: joints[k] },
            Some(p) => {
                let g = world[*p];
                Affine { linear: g.linear * local[k], translation: g.apply(joints[k] - joints[*p]) }
            }
        });
    }
    let posed_from_rest = world
        .iter()
        .zip(joints)
        .map(|(g, j)| Affine { linear: g.linear, translation: g.translation - g.linear * *j })
        .collect();
    Chain { local, world, posed_from_rest }
}

/// Gradients of [`pose_skeleton`].
#[derive(Debug, Clone, PartialEq)]
pub struct ChainGradients {
    /// dL/dJ, one per joint.
    pub joints: Vec<DVec3>,
    /// dL/dR_k, one per joint. Gradients of `R_k` from elsewhere may be added before [`rotations_vjp`].
    pub local: Vec<DMat3>,
}

/// dL/dJ and dL/dR_k from dL/dB_k. The gradient flows from the leaves to the root.
pub fn pose_skeleton_vjp(
    parents: &[Option<usize>],
    joints: &[DVec3],
    chain: &Chain,
    d_posed_from_rest: &[Affine],
) -> ChainGradients {
    let n = joints.len();
    let mut d_joints = vec![DVec3::ZERO; n];
    let mut d_local = vec![DMat3::ZERO; n];
    let mut d_world = vec![Affine::ZERO; n];
    // B_k = [G_k.linear | G_k.translation - G_k.linear J_k]
    for (k, d) in d_posed_from_rest.iter().enumerate() {
        d_world[k].linear = d.linear - outer(d.translation, joints[k]);
        d_world[k].translation = d.translation;
        d_joints[k] -= chain.world[k].linear.transpose() * d.translation;
    }
    for k in (0..n).rev() {
        let d = d_world[k];
        match parents[k] {
            None => {
                d_local[k] = d.linear;
                d_joints[k] += d.translation;
            }
            Some(p) => {
                let parent_rotation = chain.world[p].linear;
                let bone = joints[k] - joints[p];
                d_local[k] = parent_rotation.transpose() * d.linear;
                d_world[p].linear += d.linear * chain.local[k].transpose() + outer(d.translation, bone);
                d_world[p].translation += d.translation;
                let d_bone = parent_rotation.transpose() * d.translation;
                d_joints[k] += d_bone;
                d_joints[p] -= d_bone;
            }
        }
    }
    ChainGradients { joints: d_joints, local: d_local }
}

/// dL/d(axis-angle) of every joint from dL/dR_k.
pub fn rotations_vjp(rotations: &[DVec3], d_local: &[DMat3]) -> Vec<DVec3> {
    rotations.iter().zip(d_local).map(|(v, d)| rotation_from_axis_angle_vjp(*v, d)).collect()
}

/// `a b^T`.
pub(crate) fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}

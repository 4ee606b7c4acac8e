//! Poses a hand model in any shape (paper eq. 2 to 4): shape and pose blend shapes, joints that follow the shape,
//! kinematic chain, linear blend skinning.

use glam::DVec3;

use crate::bound_joints::BoundJoints;
use crate::pose_response::rotation_features;
use crate::skeleton::{Affine, Chain, pose_skeleton};
use crate::{HandModel, InvalidHandModel, Pose};

/// A hand at rest in some shape.
#[derive(Debug, Clone, PartialEq)]
pub struct ShapedHand {
    /// Vertices before pose blend shapes, metres, model axes, `V`.
    pub vertices: Vec<DVec3>,
    /// Joints, metres, model axes, `n_b`.
    pub joints: Vec<DVec3>,
}

/// A hand in a pose, with the intermediate results.
#[derive(Debug, Clone, PartialEq)]
pub struct PosedModel {
    /// The hand at rest in its shape.
    pub shaped: ShapedHand,
    /// The vertices at rest after shape and pose blend shapes, metres, `V`.
    pub corrected: Vec<DVec3>,
    /// The posed skeleton, without the translation.
    pub chain: Chain,
    /// Posed vertices, metres, `V`.
    pub vertices: Vec<DVec3>,
    /// Posed joints, metres, `n_b`.
    pub joints: Vec<DVec3>,
}

/// Applies shape parameters: `v = v_template + sum_i shape_i S_i`, and `J = J_regressor v` or, of a model with joint
/// directions, `J = J_template + sum_i shape_i D_i`.
///
/// `shape` may be shorter than the model's `n_s`; missing parameters are 0.
///
/// # Errors
/// [`InvalidHandModel`] if `shape` is longer than `n_s` or not finite.
pub fn shape_hand(model: &HandModel, shape: &[f64]) -> Result<ShapedHand, InvalidHandModel> {
    if shape.len() > model.shape_count() || shape.iter().any(|s| !s.is_finite()) {
        let problem = match shape.iter().find(|s| !s.is_finite()) {
            Some(bad) => format!("has {bad}; it must be finite"),
            None => {
                format!("has {} numbers, the model takes {}; remove the others", shape.len(), model.shape_count())
            }
        };
        return Err(invalid(model, "shape", problem));
    }
    let mut vertices = model.vertices.clone();
    add_directions(&mut vertices, shape, &model.shape_directions);
    let joints = if model.joint_regressor.is_empty() {
        let mut joints = model.joints.clone();
        add_directions(&mut joints, shape, &model.joint_directions);
        joints
    } else {
        regress_joints(&model.joint_regressor, &vertices)
    };
    Ok(ShapedHand { vertices, joints })
}

/// Adds `weights[i]` times the `i`th direction, each with one vector per point.
fn add_directions(points: &mut [DVec3], weights: &[f64], directions: &[DVec3]) {
    for (weight, direction) in weights.iter().zip(directions.chunks_exact(points.len().max(1))) {
        points.iter_mut().zip(direction).for_each(|(point, d)| *point += *d * *weight);
    }
}

/// Joints (metres, `n_b`) as weighted sums of vertices.
pub fn regress_joints(regressor: &[Vec<(u32, f64)>], vertices: &[DVec3]) -> Vec<DVec3> {
    regressor.iter().map(|row| row.iter().map(|&(i, w)| vertices[i as usize] * w).sum()).collect()
}

/// Poses a hand: shape and pose blend shapes, chain, linear blend skinning, translation.
///
/// # Errors
/// [`InvalidHandModel`] as for [`shape_hand`], and if the pose does not have one rotation per joint.
pub fn pose_hand(model: &HandModel, shape: &[f64], pose: &Pose) -> Result<PosedModel, InvalidHandModel> {
    posed(model, &BoundJoints::of(model), shape_hand(model, shape)?, pose, |chain, corrected| {
        let directions = model.pose_directions.chunks_exact(corrected.len().max(1));
        for (weight, directions) in pose_features(chain).zip(directions) {
            // In most poses, most joints have no rotation.
            if weight != 0.0 {
                corrected.iter_mut().zip(directions).for_each(|(v, d)| *v += *d * weight);
            }
        }
    })
}

/// Poses a hand in the shape of its template by [`pose_hand`]'s steps, with pose correctives of the caller's in place of
/// the model's: `correct` gets the chain in the pose, and adds them to the vertices at rest (metres, model axes, `V`).
/// `bound` are the model's.
///
/// # Errors
/// [`InvalidHandModel`] if the pose does not have one rotation per joint.
pub fn pose_hand_corrected_by(
    model: &HandModel,
    bound: &BoundJoints,
    pose: &Pose,
    correct: impl FnOnce(&Chain, &mut [DVec3]),
) -> Result<PosedModel, InvalidHandModel> {
    posed(model, bound, shape_hand(model, &[])?, pose, correct)
}

fn posed(
    model: &HandModel,
    bound: &BoundJoints,
    shaped: ShapedHand,
    pose: &Pose,
    correct: impl FnOnce(&Chain, &mut [DVec3]),
) -> Result<PosedModel, InvalidHandModel> {
    let rows = pose.rotations.len();
    let joints = model.joint_count();
    if rows != joints {
        return Err(invalid(model, "pose", format!("has {rows} rotations, but the model has {joints} joints")));
    }
    let chain = pose_skeleton(&model.parents, &shaped.joints, &pose.rotations);
    let mut corrected = shaped.vertices.clone();
    correct(&chain, &mut corrected);
    let skinned = |(v, rest): (usize, &DVec3)| {
        let bones = bound.of_vertex(v).iter().map(|(joint, weight)| (&chain.posed_from_rest[*joint], *weight));
        bones.fold(Affine::ZERO, |map, (bone, weight)| map.add_scaled(weight, bone)).apply(*rest) + pose.translation
    };
    let vertices = corrected.iter().enumerate().map(skinned).collect();
    let joints = chain.world.iter().map(|g| g.translation + pose.translation).collect();
    Ok(PosedModel { shaped, corrected, chain, vertices, joints })
}

/// `vec(R_k - I)` of all joints except the root, concatenated.
fn pose_features(chain: &Chain) -> impl Iterator<Item = f64> {
    chain.local.iter().skip(1).flat_map(rotation_features)
}

fn invalid(model: &HandModel, field: &str, problem: String) -> InvalidHandModel {
    InvalidHandModel { origin: model.name.clone(), field: field.into(), problem }
}

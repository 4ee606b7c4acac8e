//! Poses a hand model in any shape (paper eq. 2 to 4), with its derivative: shape and pose blend shapes, joints that
//! follow the shape, kinematic chain, linear blend skinning.

use glam::DVec3;

use crate::pose_response::{rotation_features, rotation_features_vjp};
use crate::skeleton::{Chain, pose_skeleton, pose_skeleton_vjp, rotations_vjp};
use crate::skinning::{ResidualWeights, Skinning, skin, skin_vjp};
use crate::{HandModel, InvalidHandModel, Pose};

/// A hand at rest in some shape.
#[derive(Debug, Clone, PartialEq)]
pub struct ShapedHand {
    /// Vertices before pose blend shapes, metres, model axes, `V`.
    pub vertices: Vec<DVec3>,
    /// Joints, metres, model axes, `n_b`.
    pub joints: Vec<DVec3>,
}

/// A hand in a pose, with the intermediate results that its derivative needs.
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

/// Gradients of [`pose_hand`].
#[derive(Debug, Clone, PartialEq)]
pub struct PosingGradients {
    /// dL/d(joint rotations), `n_b`.
    pub rotations: Vec<DVec3>,
    /// dL/d(translation).
    pub translation: DVec3,
    /// dL/d(shape), `n_s`.
    pub shape: Vec<f64>,
    /// dL/d(`HandModel::vertices`), `V`; includes the part through the joints, if they are regressed.
    pub vertices: Vec<DVec3>,
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

/// dL/d(shape) (`n_s`) and dL/d(`HandModel::vertices`) (`V`), in that order, from the gradient of the result of
/// [`shape_hand`].
pub fn shape_hand_vjp(model: &HandModel, d_shaped: &ShapedHand) -> (Vec<f64>, Vec<DVec3>) {
    let mut d_vertices = d_shaped.vertices.clone();
    for (row, d_joint) in model.joint_regressor.iter().zip(&d_shaped.joints) {
        for &(i, w) in row {
            d_vertices[i as usize] += *d_joint * w;
        }
    }
    let mut d_shape = along_directions(&model.shape_directions, &d_vertices);
    let through_joints = along_directions(&model.joint_directions, &d_shaped.joints);
    d_shape.iter_mut().zip(through_joints).for_each(|(sum, d)| *sum += d);
    (d_shape, d_vertices)
}

/// Gradient of the weights of [`add_directions`] from that of the points.
fn along_directions(directions: &[DVec3], d_points: &[DVec3]) -> Vec<f64> {
    let directions = directions.chunks_exact(d_points.len().max(1));
    directions.map(|direction| direction.iter().zip(d_points).map(|(d, g)| d.dot(*g)).sum()).collect()
}

/// Whether the model's pose correctives are part of a posed hand.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PoseCorrectives {
    /// Applied before skinning, as the hand model intends (paper eq. 2).
    Applied,
    /// Omitted: plain linear blend skinning of the shaped hand.
    Ignored,
}

/// Poses a hand: shape and pose blend shapes, chain, linear blend skinning, translation.
///
/// # Errors
/// [`InvalidHandModel`] as for [`shape_hand`], and if the pose does not have one rotation per joint.
pub fn pose_hand(model: &HandModel, shape: &[f64], pose: &Pose) -> Result<PosedModel, InvalidHandModel> {
    pose_hand_with(model, shape, pose, PoseCorrectives::Applied)
}

/// Like [`pose_hand`], with or without the pose correctives. [`pose_hand_vjp`] is the derivative with them.
///
/// # Errors
/// As for [`pose_hand`].
pub fn pose_hand_with(
    model: &HandModel,
    shape: &[f64],
    pose: &Pose,
    correctives: PoseCorrectives,
) -> Result<PosedModel, InvalidHandModel> {
    let directions = match correctives {
        PoseCorrectives::Applied => &model.pose_directions[..],
        PoseCorrectives::Ignored => &[],
    };
    posed(model, shape_hand(model, shape)?, pose, |chain, corrected| {
        for (weight, directions) in pose_features(chain).zip(directions.chunks_exact(corrected.len().max(1))) {
            // In most poses, most joints have no rotation.
            if weight != 0.0 {
                corrected.iter_mut().zip(directions).for_each(|(v, d)| *v += *d * weight);
            }
        }
    })
}

/// Poses a hand in the shape of its template by [`pose_hand`]'s steps, with pose correctives of the caller's in place of
/// the model's: `correct` gets the chain in the pose, and adds them to the vertices at rest (metres, model axes, `V`).
///
/// # Errors
/// [`InvalidHandModel`] if the pose does not have one rotation per joint.
pub fn pose_hand_corrected_by(
    model: &HandModel,
    pose: &Pose,
    correct: impl FnOnce(&Chain, &mut [DVec3]),
) -> Result<PosedModel, InvalidHandModel> {
    posed(model, shape_hand(model, &[])?, pose, correct)
}

fn posed(
    model: &HandModel,
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
    let weights = joint_major_weights(model);
    let vertices = skin(&skinning(&corrected, &weights, &chain, pose));
    let joints = chain.world.iter().map(|g| g.translation + pose.translation).collect();
    Ok(PosedModel { shaped, corrected, chain, vertices, joints })
}

/// Gradients from dL/d(posed vertices) (`V`) and dL/d(posed joints) (`n_b`); `posed` is [`pose_hand`]'s result.
pub fn pose_hand_vjp(
    model: &HandModel,
    pose: &Pose,
    posed: &PosedModel,
    d_vertices: &[DVec3],
    d_joints: &[DVec3],
) -> PosingGradients {
    let weights = joint_major_weights(model);
    let d_skin = skin_vjp(&skinning(&posed.corrected, &weights, &posed.chain, pose), d_vertices);
    let joints = &posed.shaped.joints;
    let mut d_chain = pose_skeleton_vjp(&model.parents, joints, &posed.chain, &d_skin.bones, d_joints);
    if !model.pose_directions.is_empty() {
        let mut directions = model.pose_directions.chunks_exact(model.vertices.len());
        for d_local in d_chain.local.iter_mut().skip(1) {
            let d_features = std::array::from_fn(|_| {
                let row = directions.next().unwrap_or(&[]);
                row.iter().zip(&d_skin.rest).map(|(d, g)| d.dot(*g)).sum()
            });
            *d_local += rotation_features_vjp(&d_features);
        }
    }
    let d_shaped = ShapedHand { vertices: d_skin.rest, joints: d_chain.joints };
    let (shape, vertices) = shape_hand_vjp(model, &d_shaped);
    PosingGradients {
        rotations: rotations_vjp(&pose.rotations, &d_chain.local),
        translation: d_skin.translation + d_joints.iter().sum::<DVec3>(),
        shape,
        vertices,
    }
}

/// `vec(R_k - I)` of all joints except the root, concatenated.
fn pose_features(chain: &Chain) -> impl Iterator<Item = f64> {
    chain.local.iter().skip(1).flat_map(rotation_features)
}

fn skinning<'a>(corrected: &'a [DVec3], weights: &'a [f64], chain: &'a Chain, pose: &Pose) -> Skinning<'a> {
    Skinning {
        rest: corrected,
        weights,
        residual_weights: &[],
        bones: &chain.posed_from_rest,
        residual_bones: &[],
        translation: pose.translation,
        mode: ResidualWeights::Paper,
    }
}

/// The model's weights in the layout of skinning, `[n_b][V]`.
fn joint_major_weights(model: &HandModel) -> Vec<f64> {
    let joints = model.joint_count();
    let vertices = model.vertices.len();
    let mut weights = vec![0.0; joints * vertices];
    for (v, row) in model.weights.chunks_exact(joints.max(1)).enumerate() {
        for (k, weight) in row.iter().enumerate() {
            weights[k * vertices + v] = *weight;
        }
    }
    weights
}

fn invalid(model: &HandModel, field: &str, problem: String) -> InvalidHandModel {
    InvalidHandModel { origin: model.name.clone(), field: field.into(), problem }
}

//! The template's shape: the hand model's own shape directions, and for any rig the length and the thickness of each bone.

use std::sync::Arc;

use ghand_core::bound_joints::BoundJoints;
use ghand_core::posing::{PosedModel, pose_hand_corrected_by, shape_hand};
use ghand_core::{HandModel, InvalidHandModel, Pose};
use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::correctives::VertexCorrectives;

/// Standard deviation of the logarithm of a bone's length or thickness.
pub const BONE_DEVIATION: f64 = 0.03;
/// Standard deviation of the model's own shape parameters.
pub const SHAPE_DEVIATION: f64 = 1.0;

/// A template that can change its shape.
pub struct Proportions {
    /// Without its pose directions, which are in `correctives`.
    model: HandModel,
    /// The same without shape directions, too; copied for each shape.
    bare: HandModel,
    /// Direction of the bone that a joint carries; none for a joint with several children.
    bones: Vec<Option<DVec3>>,
    correctives: Arc<VertexCorrectives>,
    bound: Arc<BoundJoints>,
}

/// A shape and its derivatives.
pub struct Shaped {
    /// The model with rest vertices and joints in that shape, without shape and pose directions.
    pub model: HandModel,
    /// Derivatives of the rest vertices, metres per unit, `[V][parameters]`.
    pub d_vertices: Vec<DVec3>,
    /// Derivatives of the rest joints, `[parameters][n_b]`.
    pub d_joints: Vec<Vec<DVec3>>,
    /// The model's pose correctives, metres; no shape changes them.
    pub correctives: Arc<VertexCorrectives>,
    /// The model's.
    pub bound: Arc<BoundJoints>,
}

impl Shaped {
    /// The same shape, if it is known: without derivatives.
    pub fn known(self) -> Shaped {
        Shaped { d_vertices: vec![], d_joints: vec![], ..self }
    }

    /// The hand in a pose.
    ///
    /// # Errors
    /// [`InvalidHandModel`] if the pose does not fit the model.
    pub fn pose(&self, pose: &Pose) -> Result<PosedModel, InvalidHandModel> {
        pose_hand_corrected_by(&self.model, &self.bound, pose, |chain, vertices| self.correctives.add(chain, vertices))
    }
}

impl Proportions {
    pub fn new(mut model: HandModel) -> Proportions {
        let bone = |k: usize| {
            let mut children = (0..model.joint_count()).filter(|child| model.parents[*child] == Some(k));
            let direction = match (children.next(), children.next(), model.parents[k]) {
                (Some(child), None, _) => model.joints[child] - model.joints[k],
                (None, _, Some(parent)) => model.joints[k] - model.joints[parent],
                _ => return None,
            };
            direction.try_normalize()
        };
        let bones = (0..model.joint_count()).map(bone).collect();
        let correctives = Arc::new(VertexCorrectives::new(&model));
        let bound = Arc::new(BoundJoints::of(&model));
        model.pose_directions = vec![];
        let shape_directions = std::mem::take(&mut model.shape_directions);
        let bare =
            HandModel { shape_names: vec![], joint_directions: vec![], joint_regressor: vec![], ..model.clone() };
        model.shape_directions = shape_directions;
        Proportions { model, bare, bones, correctives, bound }
    }

    /// The template as it came, its shape being known.
    pub fn as_given(&self) -> Shaped {
        Shaped {
            model: self.bare.clone(),
            d_vertices: vec![],
            d_joints: vec![],
            correctives: self.correctives.clone(),
            bound: self.bound.clone(),
        }
    }

    /// The template as it came, without pose directions.
    pub fn template(&self) -> &HandModel {
        &self.model
    }

    /// Number of parameters: the model's own, then logarithms of length and thickness of each joint's bone.
    pub fn parameter_count(&self) -> usize {
        self.model.shape_count() + 2 * self.model.joint_count()
    }

    /// Standard deviation of a parameter before any image is seen.
    pub fn deviation(&self, parameter: usize) -> f64 {
        if parameter < self.model.shape_count() { SHAPE_DEVIATION } else { BONE_DEVIATION }
    }

    /// The template in a shape; without parameters of the bones, they are as the model's own leave them.
    ///
    /// # Errors
    /// [`InvalidHandModel`] if a parameter is not finite.
    pub fn shaped(&self, parameters: &[f64]) -> Result<Shaped, InvalidHandModel> {
        let (own, bones) = parameters.split_at(self.model.shape_count());
        let bone = |parameter: usize| bones.get(parameter).map_or(1.0, |logarithm| logarithm.exp());
        let model = &self.model;
        let hand = shape_hand(model, own)?;
        // How each bone stretches: by its length along it, by its thickness across.
        let stretch: Vec<DMat3> = (0..model.joint_count())
            .map(|k| {
                let [length, thickness] = [bone(2 * k), bone(2 * k + 1)];
                match self.bones[k] {
                    Some(along) => DMat3::from_diagonal(DVec3::splat(thickness)) + outer(along) * (length - thickness),
                    None => DMat3::from_diagonal(DVec3::splat(length)),
                }
            })
            .collect();
        // Joints as the bones carry them, and a vertex that was displaced relative to them.
        let moved = |joints: &[DVec3], from: &[DVec3]| {
            let mut moved = from.to_vec();
            for (k, parent) in model.parents.iter().enumerate() {
                if let Some(p) = *parent {
                    moved[k] = moved[p] + stretch[p] * (joints[k] - joints[p]);
                }
            }
            moved
        };
        // How the bones carry the model's origin, and from there a vertex of joints with these weights.
        let carried = |joints: &[DVec3], moved: &[DVec3]| -> Vec<DVec3> {
            moved.iter().zip(joints).zip(&stretch).map(|((moved, joint), stretch)| *moved - *stretch * *joint).collect()
        };
        let stretched =
            |bound: &[(usize, f64)]| -> DMat3 { bound.iter().map(|(k, weight)| stretch[*k] * *weight).sum() };
        let at = |bound: &[(usize, f64)], stretched: &DMat3, vertex: DVec3, carried: &[DVec3]| -> DVec3 {
            *stretched * vertex + bound.iter().map(|(k, weight)| *weight * carried[*k]).sum::<DVec3>()
        };
        let joints = moved(&hand.joints, &hand.joints);
        let origins = carried(&hand.joints, &joints);
        let placed = |v: usize| {
            let bound = self.bound.of_vertex(v);
            at(bound, &stretched(bound), hand.vertices[v], &origins)
        };
        let vertices: Vec<DVec3> = (0..hand.vertices.len()).map(placed).collect();
        let none = shape_hand(model, &[])?;
        let by_own = |k: usize| -> Result<OwnDerivative, InvalidHandModel> {
            let mut unit = vec![0.0; own.len()];
            unit[k] = 1.0;
            let one = shape_hand(model, &unit)?;
            let d_own = one.vertices.iter().zip(&none.vertices).map(|(a, b)| *a - *b).collect();
            let d_rest: Vec<DVec3> = one.joints.iter().zip(&none.joints).map(|(a, b)| *a - *b).collect();
            let moved = moved(&d_rest, &d_rest);
            Ok(OwnDerivative { vertices: d_own, carried: carried(&d_rest, &moved), moved })
        };
        let of_own: Vec<OwnDerivative> = (0..own.len()).into_par_iter().map(by_own).collect::<Result<_, _>>()?;
        let by_bone = |(parameter, logarithm): (usize, &f64)| -> BoneDerivative {
            let k = parameter / 2;
            let size = logarithm.exp();
            let d_stretch = match (self.bones[k], parameter % 2) {
                (Some(along), 0) => outer(along) * size,
                (Some(along), _) => (DMat3::IDENTITY - outer(along)) * size,
                (None, 0) => DMat3::IDENTITY * size,
                (None, _) => DMat3::ZERO,
            };
            let mut d_joints = vec![DVec3::ZERO; model.joint_count()];
            for (child, parent) in model.parents.iter().enumerate() {
                if let Some(p) = *parent {
                    let own = if p == k { d_stretch * (hand.joints[child] - hand.joints[k]) } else { DVec3::ZERO };
                    d_joints[child] = d_joints[p] + own;
                }
            }
            BoneDerivative { d_stretch, d_joints }
        };
        let of_bones: Vec<BoneDerivative> = bones.iter().enumerate().map(by_bone).collect();
        let of_vertex = |v: usize| {
            let bound = self.bound.of_vertex(v);
            let stretched = stretched(bound);
            let by_own = of_own.iter().map(|d| at(bound, &stretched, d.vertices[v], &d.carried));
            let by_bone = of_bones.iter().enumerate().map(|(parameter, d)| {
                let k = parameter / 2;
                let carried: DVec3 = bound.iter().map(|(joint, weight)| *weight * d.d_joints[*joint]).sum();
                carried + model.vertex_weights(v)[k] * (d.d_stretch * (hand.vertices[v] - hand.joints[k]))
            });
            by_own.chain(by_bone).collect::<Vec<DVec3>>()
        };
        let d_vertices: Vec<Vec<DVec3>> = (0..vertices.len()).into_par_iter().map(of_vertex).collect();
        let d_joints = of_own.into_iter().map(|d| d.moved).chain(of_bones.into_iter().map(|d| d.d_joints)).collect();
        let shaped = HandModel { vertices, joints, ..self.bare.clone() };
        let (correctives, bound) = (self.correctives.clone(), self.bound.clone());
        Ok(Shaped { model: shaped, d_vertices: d_vertices.concat(), d_joints, correctives, bound })
    }
}

/// Derivatives by a parameter of the model's own shape: of vertices at rest, and of where bones carry joints and the origin.
struct OwnDerivative {
    vertices: Vec<DVec3>,
    moved: Vec<DVec3>,
    carried: Vec<DVec3>,
}

/// Derivatives by a bone's length or thickness.
struct BoneDerivative {
    d_stretch: DMat3,
    d_joints: Vec<DVec3>,
}

/// The projection onto a unit vector.
fn outer(u: DVec3) -> DMat3 {
    DMat3::from_cols(u * u.x, u * u.y, u * u.z)
}

#[cfg(test)]
mod tests {
    use ghand_core::Side;
    use ghand_hand_model::builtin::builtin_hand;

    use super::*;

    #[test]
    fn derivatives_are_those_of_the_shape() {
        let model = builtin_hand(Side::Right).unwrap();
        let proportions = Proportions::new(model.clone());
        let parameters: Vec<f64> =
            (0..proportions.parameter_count()).map(|k| 0.5 * proportions.deviation(k) * (k as f64).sin()).collect();
        let shaped = proportions.shaped(&parameters).unwrap();
        let step = 1e-5;
        for parameter in 0..parameters.len() {
            let at = |by: f64| {
                let mut moved = parameters.clone();
                moved[parameter] += by;
                proportions.shaped(&moved).unwrap().model
            };
            let (low, high) = (at(-step), at(step));
            let worst = |high: &[DVec3], low: &[DVec3], found: &[DVec3]| {
                let differences = high.iter().zip(low).map(|(a, b)| (*a - *b) / (2.0 * step));
                differences.zip(found).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max)
            };
            let d_vertices: Vec<DVec3> =
                shaped.d_vertices.iter().skip(parameter).step_by(parameters.len()).copied().collect();
            assert!(worst(&high.vertices, &low.vertices, &d_vertices) < 1e-8, "{parameter}");
            assert!(worst(&high.joints, &low.joints, &shaped.d_joints[parameter]) < 1e-8, "{parameter}");
        }
        let none = proportions.shaped(&vec![0.0; parameters.len()]).unwrap();
        let off = none.model.vertices.iter().zip(&model.vertices).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
        assert!(off < 1e-12 && none.d_joints.len() == parameters.len());
    }
}

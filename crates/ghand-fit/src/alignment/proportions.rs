//! The template's shape: the hand model's own shape directions, and for any rig the length and the thickness of each bone.

use std::sync::Arc;

use ghand_core::posing::shape_hand;
use ghand_core::{HandModel, InvalidHandModel};
use glam::{DMat3, DVec3};

/// Standard deviation of the logarithm of a bone's length or thickness.
pub const BONE_DEVIATION: f64 = 0.03;
/// Standard deviation of the model's own shape parameters.
pub const SHAPE_DEVIATION: f64 = 1.0;

/// A template that can change its shape.
pub struct Proportions {
    model: HandModel,
    /// Direction of the bone that a joint carries; none for a joint with several children.
    bones: Vec<Option<DVec3>>,
    correctives: Arc<VertexCorrectives>,
}

/// Entries of a joint's rotation, on which its correctives depend.
pub const FEATURES: usize = 9;

/// A model's pose correctives by vertex; most joints have none for most vertices.
pub struct VertexCorrectives(Vec<Vec<(usize, [DVec3; FEATURES])>>);

impl VertexCorrectives {
    fn new(model: &HandModel) -> VertexCorrectives {
        let count = model.vertices.len();
        let mut by_vertex = vec![vec![]; count];
        for (k, directions) in model.pose_directions.chunks_exact((FEATURES * count).max(1)).enumerate() {
            for (vertex, own) in by_vertex.iter_mut().enumerate() {
                let own_directions = std::array::from_fn(|feature| directions[feature * count + vertex]);
                if own_directions != [DVec3::ZERO; FEATURES] {
                    own.push((k + 1, own_directions));
                }
            }
        }
        VertexCorrectives(by_vertex)
    }

    /// How a vertex at rest moves with each entry of a joint's rotation, row by row; none if it does not.
    pub fn get(&self, vertex: usize, joint: usize) -> Option<&[DVec3; FEATURES]> {
        self.0[vertex].iter().find(|(own, _)| *own == joint).map(|(_, directions)| directions)
    }
}

/// A shape and its derivatives.
pub struct Shaped {
    /// The model with rest vertices and joints in that shape, without shape directions.
    pub model: HandModel,
    /// Derivatives of the rest vertices, metres per unit, `[parameters][V]`.
    pub d_vertices: Vec<Vec<DVec3>>,
    /// Derivatives of the rest joints, `[parameters][n_b]`.
    pub d_joints: Vec<Vec<DVec3>>,
    /// The model's pose correctives, metres; no shape changes them.
    pub correctives: Arc<VertexCorrectives>,
}

impl Shaped {
    /// A template whose shape is known.
    pub fn fixed(template: &HandModel) -> Shaped {
        let correctives = Arc::new(VertexCorrectives::new(template));
        Shaped { model: template.clone(), d_vertices: vec![], d_joints: vec![], correctives }
    }
}

impl Proportions {
    pub fn new(model: HandModel) -> Proportions {
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
        Proportions { model, bones, correctives }
    }

    /// The template as it came.
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
        let place = |vertices: &[DVec3], joints: &[DVec3], from: &[DVec3]| {
            // `from` moves with the joints; vertices and joints are displaced relative to it.
            let mut moved = from.to_vec();
            for (k, parent) in model.parents.iter().enumerate() {
                if let Some(p) = *parent {
                    moved[k] = moved[p] + stretch[p] * (joints[k] - joints[p]);
                }
            }
            let vertex = |v: usize| {
                let weights = model.vertex_weights(v).iter().enumerate().filter(|(_, weight)| **weight > 0.0);
                weights.map(|(k, weight)| *weight * (moved[k] + stretch[k] * (vertices[v] - joints[k]))).sum()
            };
            ((0..vertices.len()).map(vertex).collect::<Vec<DVec3>>(), moved)
        };
        let (vertices, joints) = place(&hand.vertices, &hand.joints, &hand.joints);
        let (mut d_vertices, mut d_joints) = (vec![], vec![]);
        let none = shape_hand(model, &[])?;
        for k in 0..own.len() {
            let mut unit = vec![0.0; own.len()];
            unit[k] = 1.0;
            let one = shape_hand(model, &unit)?;
            let d_own: Vec<DVec3> = one.vertices.iter().zip(&none.vertices).map(|(a, b)| *a - *b).collect();
            let d_rest: Vec<DVec3> = one.joints.iter().zip(&none.joints).map(|(a, b)| *a - *b).collect();
            let (d_vertex, d_joint) = place(&d_own, &d_rest, &d_rest);
            d_vertices.push(d_vertex);
            d_joints.push(d_joint);
        }
        for (parameter, logarithm) in bones.iter().enumerate() {
            let k = parameter / 2;
            let size = logarithm.exp();
            let d_stretch = match (self.bones[k], parameter % 2) {
                (Some(along), 0) => outer(along) * size,
                (Some(along), _) => (DMat3::IDENTITY - outer(along)) * size,
                (None, 0) => DMat3::IDENTITY * size,
                (None, _) => DMat3::ZERO,
            };
            let mut d_joint = vec![DVec3::ZERO; model.joint_count()];
            for (child, parent) in model.parents.iter().enumerate() {
                if let Some(p) = *parent {
                    let own = if p == k { d_stretch * (hand.joints[child] - hand.joints[k]) } else { DVec3::ZERO };
                    d_joint[child] = d_joint[p] + own;
                }
            }
            let vertex = |v: usize| {
                let weights = model.vertex_weights(v);
                let carried: DVec3 = weights.iter().zip(&d_joint).map(|(weight, d)| *weight * *d).sum();
                carried + weights[k] * (d_stretch * (hand.vertices[v] - hand.joints[k]))
            };
            d_vertices.push((0..hand.vertices.len()).map(vertex).collect());
            d_joints.push(d_joint);
        }
        let mut shaped = HandModel { vertices, joints, ..model.clone() };
        shaped.shape_directions.clear();
        shaped.shape_names.clear();
        shaped.joint_directions.clear();
        shaped.joint_regressor.clear();
        Ok(Shaped { model: shaped, d_vertices, d_joints, correctives: self.correctives.clone() })
    }
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
            assert!(worst(&high.vertices, &low.vertices, &shaped.d_vertices[parameter]) < 1e-8, "{parameter}");
            assert!(worst(&high.joints, &low.joints, &shaped.d_joints[parameter]) < 1e-8, "{parameter}");
        }
        let none = proportions.shaped(&vec![0.0; parameters.len()]).unwrap();
        let off = none.model.vertices.iter().zip(&model.vertices).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
        assert!(off < 1e-12 && none.d_joints.len() == parameters.len());
    }
}

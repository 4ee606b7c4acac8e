//! Joints as weighted sums of the skin around them.

use glam::DVec3;

use super::shapes::Shapes;
use super::skeleton::Skeleton;
use ghand_hand_model::joints::regressor::{Conditions, Row};

/// Rows `[16]` of `(vertex, weight)`: the smallest weights on the skin around each joint that sum to 1, give the
/// joint, and follow it in every shape direction.
pub(super) fn joint_regressor(skeleton: &Skeleton, vertices: &[DVec3], shapes: &Shapes) -> Vec<Row> {
    let joints = skeleton.joints();
    let mut reaches = vec![0.0; joints.len()];
    for chain in &skeleton.chains {
        // As far along the finger as it is wide, in both directions.
        reaches[0] = 1.8 * chain.radii[0];
        (0..3).for_each(|k| reaches[chain.first_joint + k] = 2.2 * chain.radii[chain.first_point + k]);
    }
    (0..joints.len()).map(|j| row(j, joints[j], reaches[j], vertices, shapes)).collect()
}

fn row(j: usize, joint: DVec3, reach: f64, vertices: &[DVec3], shapes: &Shapes) -> Row {
    let count = 4 + 3 * shapes.joints.len();
    let mut conditions = Conditions { candidates: vec![], count, columns: vec![] };
    for (i, v) in vertices.iter().enumerate() {
        let fade = 1.0 - v.distance_squared(joint) / (reach * reach);
        if fade <= 0.0 {
            continue;
        }
        conditions.candidates.push((i as u32, fade * fade));
        // In units that make them comparable: the offset from the joint as a part of `reach`, and each direction's
        // error as a part of a tenth of it.
        let offset = (*v - joint) / reach;
        let errors = shapes
            .joints
            .iter()
            .enumerate()
            .flat_map(|(d, moved)| ((shapes.skin[d * vertices.len() + i] - moved[j]) * (10.0 / reach)).to_array());
        conditions.columns.extend(std::iter::once(1.0).chain(offset.to_array()).chain(errors));
    }
    // Directions that do not move the joint, or move it like another direction, give dependent conditions. Sum and
    // position hold exactly.
    conditions.smallest_weights(4)
}

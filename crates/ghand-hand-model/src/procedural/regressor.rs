//! Joints as weighted sums of the skin around them.

use glam::DVec3;

use super::shapes::Shapes;
use super::skeleton::Skeleton;
use crate::cholesky::solve;

/// Rows `[16]` of `(vertex, weight)`: the smallest weights on the skin around each joint that sum to 1, give the
/// joint, and follow it in every shape direction.
pub(super) fn joint_regressor(skeleton: &Skeleton, vertices: &[DVec3], shapes: &Shapes) -> Vec<Vec<(u32, f64)>> {
    let joints = skeleton.joints();
    let mut reaches = vec![0.0; joints.len()];
    for chain in &skeleton.chains {
        // As far along the finger as it is wide, in both directions.
        reaches[0] = 1.8 * chain.radii[0];
        (0..3).for_each(|k| reaches[chain.first_joint + k] = 2.2 * chain.radii[chain.first_point + k]);
    }
    (0..joints.len()).map(|j| row(j, joints[j], reaches[j], vertices, shapes)).collect()
}

fn row(j: usize, joint: DVec3, reach: f64, vertices: &[DVec3], shapes: &Shapes) -> Vec<(u32, f64)> {
    let near: Vec<(usize, f64)> = (vertices.iter().enumerate())
        .filter_map(|(i, v)| {
            let fade = 1.0 - v.distance_squared(joint) / (reach * reach);
            (fade > 0.0).then_some((i, fade * fade))
        })
        .collect();
    // Conditions `sum_i weight_i column_i = 0`, in units that make them comparable: the offset from the joint as a part
    // of `reach`, and each direction's error as a part of a tenth of it. Only the sum has another right-hand side.
    let columns: Vec<Vec<f64>> = (near.iter())
        .map(|&(i, _)| {
            let offset = (vertices[i] - joint) / reach;
            let errors =
                shapes.joints.iter().enumerate().flat_map(|(d, moved)| {
                    ((shapes.skin[d * vertices.len() + i] - moved[j]) * (10.0 / reach)).to_array()
                });
            std::iter::once(1.0).chain(offset.to_array()).chain(errors).collect()
        })
        .collect();
    let mut weights = vec![0.0; near.len()];
    // Directions that do not move the joint, or move it like another direction, give dependent conditions. So the
    // smallest weights that nearly satisfy all conditions are found first, and then corrected for sum and position,
    // which must hold exactly.
    let conditions = 4 + 3 * shapes.joints.len();
    for (count, ridge) in [(conditions, 1e-6), (4, 0.0), (4, 0.0)] {
        let mut gram = vec![0.0; count * count];
        let mut missing = vec![0.0; count];
        missing[0] = 1.0;
        for ((column, &(_, fade)), weight) in columns.iter().zip(&near).zip(&weights) {
            for a in 0..count {
                missing[a] -= weight * column[a];
                (0..=a).for_each(|b| gram[a * count + b] += fade * column[a] * column[b]);
            }
        }
        let trace: f64 = near.iter().map(|(_, fade)| fade).sum();
        (0..count).for_each(|a| gram[a * count + a] += ridge * trace);
        let multipliers = solve(gram, &missing);
        for ((column, &(_, fade)), weight) in columns.iter().zip(&near).zip(&mut weights) {
            *weight += fade * column.iter().zip(&multipliers).map(|(c, m)| c * m).sum::<f64>();
        }
    }
    near.iter().zip(weights).map(|(&(i, _), weight)| (i as u32, weight)).collect()
}

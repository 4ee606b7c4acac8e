//! Morph targets whose weights are not negative.
//!
//! Many programs keep weights between 0 and 1: Unity, and Blender unless a motion begins beyond. A target that poses have with
//! both signs becomes two. Between two frames the difference of their weights is what the one weight would be.

use ghand_avatar::textured_hand::Correctives;

/// Splits targets `[K][V]` by the signs of their weights, which are from -1 to 1. Weights are then from 0 to 1.
pub fn one_sided(correctives: &Correctives) -> Correctives {
    let Correctives { targets, weights } = correctives;
    let count = weights.first().map_or(0, Vec::len);
    let mut found = Correctives { targets: vec![], weights: vec![vec![]; weights.len()] };
    for (k, target) in targets.chunks(targets.len().max(1) / count.max(1)).enumerate() {
        for sign in [1.0, -1.0] {
            let of_sign: Vec<f64> = weights.iter().map(|weights| (sign * weights[k]).max(0.0)).collect();
            if of_sign.iter().any(|weight| *weight > 0.0) {
                found.targets.extend(target.iter().map(|displacement| *displacement * sign));
                found.weights.iter_mut().zip(of_sign).for_each(|(all, weight)| all.push(weight));
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    #[test]
    fn targets_of_both_signs_become_two_and_move_vertices_as_before() {
        let targets: Vec<DVec3> = (0..6).map(|k| DVec3::new(f64::from(k), 1.0, -0.5)).collect();
        let weights = vec![vec![1.0, 0.5, -0.2], vec![-0.7, 0.0, -1.0], vec![0.0, 1.0, 0.0]];
        let moved = |correctives: &Correctives, pose: usize, vertex: usize| -> DVec3 {
            let of_pose = correctives.weights[pose].iter().enumerate();
            of_pose.map(|(k, weight)| correctives.targets[2 * k + vertex] * *weight).sum()
        };
        let both = Correctives { targets, weights };
        let found = one_sided(&both);
        // The first has both signs, the second is positive, the third negative.
        assert_eq!((found.targets.len(), found.weights[0].len()), (4 * 2, 4));
        assert!(found.weights.iter().flatten().all(|weight| (0.0..=1.0).contains(weight)));
        for (pose, vertex) in [(0, 0), (0, 1), (1, 0), (1, 1), (2, 0), (2, 1)] {
            assert!(moved(&found, pose, vertex).distance(moved(&both, pose, vertex)) < 1e-12);
        }
        assert_eq!(one_sided(&Correctives::default()), Correctives::default());
    }
}

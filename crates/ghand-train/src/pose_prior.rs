//! A prior on poses, fitted to the capture's own poses: most joints rotate about fewer than three axes.
//!
//! Over the frames of a capture, a joint's axis-angle vectors vary widely along the axes it really rotates about, and
//! along the others only by the noise of the pose estimate. With the smallest variance as the noise, the best linear
//! estimate of the true rotation shrinks each principal component towards the mean by (variance - noise) / variance.

use ghand_core::Pose;
use glam::{DMat3, DVec3};
use nalgebra::{Matrix3, SymmetricEigen};

/// With fewer frames, the statistics of a joint's motion are not reliable.
const MIN_FRAMES: usize = 8;
/// A joint whose smallest standard deviation is above this fraction of its largest rotates freely about all axes: its
/// smallest deviation is motion, not noise.
const FREE_RATIO: f64 = 0.3;

/// Shrinks every joint's rotations towards their mean along the axes about which it hardly rotates. The frames are the
/// samples. With few frames, and for joints that rotate freely, nothing changes.
pub fn shrink(poses: &mut [Pose]) {
    let frames = poses.len();
    let joints = poses.iter().map(|p| p.rotations.len()).min().unwrap_or(0);
    if frames < MIN_FRAMES {
        return;
    }
    for k in 0..joints {
        let mean = poses.iter().map(|p| p.rotations[k]).sum::<DVec3>() / frames as f64;
        let mut covariance = DMat3::ZERO;
        for pose in poses.iter() {
            let d = pose.rotations[k] - mean;
            covariance += DMat3::from_cols(d * d.x, d * d.y, d * d.z) * (1.0 / (frames - 1) as f64);
        }
        let eigen = SymmetricEigen::new(Matrix3::from_column_slice(&covariance.to_cols_array()));
        let spread = DVec3::from_slice(eigen.eigenvalues.as_slice());
        let axes = DMat3::from_cols_slice(eigen.eigenvectors.as_slice());
        let noise = spread.min_element();
        let largest = spread.max_element();
        if !(largest > 0.0 && noise.max(0.0).sqrt() < FREE_RATIO * largest.sqrt()) {
            continue;
        }
        let keep = spread.map(|s| if s > noise { (s - noise) / s } else { 0.0 });
        let gain = axes * DMat3::from_diagonal(keep) * axes.transpose();
        for pose in poses.iter_mut() {
            pose.rotations[k] = mean + gain * (pose.rotations[k] - mean);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};

    #[test]
    fn noise_across_a_hinge_is_reduced_and_a_free_joint_is_unchanged() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(1);
        let axis = DVec3::new(0.6, 0.0, 0.8);
        let mut noise = |size: f64| DVec3::from_array(std::array::from_fn(|_| rng.random_range(-size..size)));
        let truth: Vec<[DVec3; 2]> = (0..40).map(|i| [axis * (0.02 * f64::from(i)), noise(0.5)]).collect();
        let mut poses: Vec<Pose> = truth
            .iter()
            .map(|t| Pose { rotations: vec![t[0] + noise(0.1), t[1] + noise(0.1)], translation: DVec3::ZERO })
            .collect();
        let given = poses.clone();
        shrink(&mut poses);
        let error =
            |poses: &[Pose]| poses.iter().zip(&truth).map(|(p, t)| (p.rotations[0] - t[0]).length()).sum::<f64>();
        assert!(error(&poses) < 0.7 * error(&given), "{} against {}", error(&poses), error(&given));
        assert!(poses.iter().zip(&given).all(|(a, b)| a.rotations[1] == b.rotations[1]));
        let mut few = given[..5].to_vec();
        shrink(&mut few);
        assert_eq!(few, given[..5]);
    }
}

//! Cameras all around a posed hand.

use ghand_avatar::framing::{Upright, middle, posed_vertices};
use ghand_core::sphere::spiral_direction;
use ghand_core::{Camera, HandModel, Pose};
use glam::{DMat3, DVec2, DVec3};

/// Resolution and distance of cameras.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Footprint {
    /// Pixels for each metre across, at the middle of the hand.
    pub pixels_per_metre: f64,
    /// From the camera to the middle of the hand, metres.
    pub distance: f64,
}

/// Direction number `k` of `count` evenly around a hand, in its own axes: towards its back, towards the side that is on
/// the right when fingers point up and the palm is seen, and towards the fingertips. None is parallel to the fingers.
pub fn direction_around(k: usize, count: usize) -> DVec3 {
    spiral_direction(k, count)
}

/// Cameras all around a hand, `[pose][view]`, fingers up, from [`direction_around`]. All pictures are squares of one size
/// that just holds the hand in any of them. A distance below three times the hand's reach is raised to that, with the
/// same resolution.
pub fn all_around(model: &HandModel, poses: &[&Pose], views: usize, footprint: Footprint) -> Vec<Vec<Camera>> {
    /// Space around the hand's mesh for Gaussians that reach beyond it, pixels.
    const BORDER: f64 = 8.0;
    let mut cameras: Vec<Vec<Camera>> = vec![];
    let mut half_side = 1.0f64;
    for pose in poses {
        let points = posed_vertices(model, pose);
        let middle = middle(&points);
        let reach = points.iter().map(|p| p.distance(middle)).fold(0.0, f64::max);
        let distance = footprint.distance.max(3.0 * reach).max(f64::MIN_POSITIVE);
        let Upright { up, back } = Upright::posed(model, pose);
        let axes = DMat3::from_cols(back, up.cross(back), up);
        let view = |k: usize| {
            let eye = middle + axes * direction_around(k, views) * distance;
            let focal = DVec2::splat(footprint.pixels_per_metre * distance);
            Camera { focal, ..Camera::look_at(eye, middle, up, 1.0, 2, 2) }
        };
        let ring: Vec<Camera> = (0..views).map(view).collect();
        for camera in &ring {
            let offsets = points.iter().map(|p| (camera.project(*p).0 - camera.principal).abs().max_element());
            half_side = offsets.fold(half_side, f64::max);
        }
        cameras.push(ring);
    }
    let half_side = (half_side + BORDER).ceil();
    for camera in cameras.iter_mut().flatten() {
        camera.principal = DVec2::splat(half_side);
        [camera.width, camera.height] = [2 * half_side as u32; 2];
    }
    cameras
}

#[cfg(test)]
mod tests {
    use ghand_hand_model::named_poses::named_pose;
    use ghand_test_support::procedural_hand::ProceduralHand;

    use super::*;

    #[test]
    fn cameras_all_around_hold_the_hand_at_the_resolution_asked_for() {
        let model = ProceduralHand { detail: 1, ..Default::default() }.build().unwrap();
        let mut turned = named_pose("fist", &model).unwrap();
        (turned.rotations[0], turned.translation) = (DVec3::new(1.0, -2.0, 0.5), DVec3::new(0.1, 0.2, 0.3));
        let poses = [Pose::rest(model.joint_count()), turned];
        let cameras = all_around(&model, &poses.each_ref(), 24, Footprint { pixels_per_metre: 1000.0, distance: 0.6 });
        assert_eq!((cameras.len(), cameras[0].len()), (2, 24));
        let side = cameras[0][0].width;
        let mut most = 0.0f64;
        for (pose, views) in poses.iter().zip(&cameras) {
            let points = posed_vertices(&model, pose);
            let middle = middle(&points);
            for (k, camera) in views.iter().enumerate() {
                assert_eq!([camera.width, camera.height], [side; 2]);
                assert!((camera.center().distance(middle) - 0.6).abs() < 1e-9);
                let across = camera.rotation.transpose() * DVec3::new(0.01, 0.0, 0.0);
                let pixels = camera.project(middle + across).0.distance(camera.project(middle).0);
                assert!((pixels - 10.0).abs() < 1e-6, "{pixels} pixels for a centimetre");
                let Upright { up, back } = Upright::posed(&model, pose);
                let towards = (camera.center() - middle) / 0.6;
                let wanted = direction_around(k, 24);
                assert!((towards.dot(up) - wanted.z).abs() < 1e-6 && (towards.dot(back) - wanted.x).abs() < 1e-6);
                let edge = |p: &DVec3| (camera.project(*p).0 - f64::from(side) / 2.0).abs().max_element();
                most = most.max(points.iter().map(edge).fold(0.0, f64::max));
            }
        }
        assert!((7.0..10.0).contains(&(f64::from(side) / 2.0 - most)), "{side} pixels for {most}");
        let near = all_around(&model, &[&poses[0]], 1, Footprint { pixels_per_metre: 1000.0, distance: 0.01 });
        assert!(near[0][0].width < 2 * side, "the camera is inside the hand");
    }
}

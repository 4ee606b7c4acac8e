//! Where cameras are, roughly: each camera's tracker guesses the hand in space, and the same hand seen by two cameras
//! tells how these stand to one another. Single guesses are 10 to 20 degrees off; hundreds agree on a few.

use ghand_core::Camera;
use glam::{DMat3, DQuat, DVec2, DVec3};
use nalgebra::Matrix3;

use super::{LANDMARKS, Moment, View};

/// Focal length of a camera of which nothing is known, relative to the longer side of its sensor. Phones have 0.8 to 1.0 for
/// videos, webcams 0.65 to 1.0, cropped images more.
pub const USUAL_FOCAL: f64 = 0.9;
/// Fewer common frames than this do not place a camera.
const LEAST_COMMON: usize = 5;
/// Steps of robust means.
const ROBUST_STEPS: usize = 20;

/// No sensor is narrower than this, its longer side by its shorter one: images that are were cropped at their sides.
const LEAST_ASPECT: f64 = 4.0 / 3.0;

/// A camera whose lens is unknown, at the world's origin.
pub fn unknown_camera(id: &str, width: u32, height: u32) -> Camera {
    let size = DVec2::new(f64::from(width), f64::from(height));
    let longer = size.max_element().max(LEAST_ASPECT * size.min_element());
    Camera {
        id: id.into(),
        width,
        height,
        focal: DVec2::splat(USUAL_FOCAL * longer),
        principal: size / 2.0,
        rotation: DMat3::IDENTITY,
        translation: DVec3::ZERO,
    }
}

/// The points of a hand in a camera's axes, metres: the tracker's guess of its shape, moved to where it covers its pixels.
/// `None` if the pixels are at one place.
pub fn points_in_camera(view: &View, camera: &Camera) -> Option<[DVec3; LANDMARKS]> {
    let rays = view.pixels.map(|pixel| (pixel - camera.principal) / camera.focal);
    // Least squares of x (z + t_z) = X + t_x, which is linear in the translation t.
    let mut matrix = Matrix3::zeros();
    let mut vector = nalgebra::Vector3::zeros();
    for (ray, point) in rays.iter().zip(&view.world) {
        for (ray, row, target) in [
            (ray.x, [1.0, 0.0, -ray.x], ray.x * point.z - point.x),
            (ray.y, [0.0, 1.0, -ray.y], ray.y * point.z - point.y),
        ] {
            debug_assert!(ray.is_finite());
            let row = nalgebra::RowVector3::from(row);
            matrix += row.transpose() * row;
            vector += row.transpose() * target;
        }
    }
    let translation = matrix.cholesky()?.solve(&vector);
    let translation = DVec3::new(translation.x, translation.y, translation.z);
    (translation.is_finite() && translation.z > 0.0).then(|| view.world.map(|point| point + translation))
}

/// Places cameras relative to one another, the first one at its own place. Cameras must have their focal lengths.
///
/// # Errors
/// The number of a camera that has too few frames in common with the others.
pub fn place_cameras(cameras: &mut [Camera], moments: &[Moment]) -> Result<(), usize> {
    let count = cameras.len();
    let points: Vec<Vec<Option<[DVec3; LANDMARKS]>>> = (moments.iter())
        .map(|moment| {
            let seen = moment.iter().zip(cameras.iter());
            seen.map(|(view, camera)| view.as_ref().and_then(|view| points_in_camera(view, camera))).collect()
        })
        .collect();
    let common = |a: usize, b: usize| points.iter().filter(|at| at[a].is_some() && at[b].is_some()).count();
    let mut placed = vec![0];
    while placed.len() < count {
        let open = (0..count).filter(|camera| !placed.contains(camera));
        let pairs = open.flat_map(|camera| placed.iter().map(move |known| (common(*known, camera), *known, camera)));
        let Some((frames, known, camera)) = pairs.max_by_key(|(frames, ..)| *frames) else { break };
        if frames < LEAST_COMMON {
            return Err(camera);
        }
        let pairs: Vec<_> = points.iter().filter_map(|at| Some((at[known]?, at[camera]?))).collect();
        let (rotation, translation) = relative(&pairs);
        let from = cameras[known].clone();
        cameras[camera].rotation = rotation * from.rotation;
        cameras[camera].translation = rotation * from.translation + translation;
        placed.push(camera);
    }
    Ok(())
}

/// Rotation and translation from the axes of a first camera to those of a second one, from points in both.
fn relative(pairs: &[([DVec3; LANDMARKS], [DVec3; LANDMARKS])]) -> (DMat3, DVec3) {
    let rotations: Vec<DQuat> = pairs.iter().map(|(a, b)| DQuat::from_mat3(&rotation_between(a, b))).collect();
    let rotation = DMat3::from_quat(robust_mean(&rotations));
    let shifts: Vec<DVec3> = pairs.iter().map(|(a, b)| mean(b) - rotation * mean(a)).collect();
    let middle = |of: fn(&DVec3) -> f64| {
        let mut values: Vec<f64> = shifts.iter().map(of).collect();
        values.sort_by(f64::total_cmp);
        values.get(values.len() / 2).copied().unwrap_or(0.0)
    };
    (rotation, DVec3::new(middle(|v| v.x), middle(|v| v.y), middle(|v| v.z)))
}

fn mean(points: &[DVec3; LANDMARKS]) -> DVec3 {
    points.iter().sum::<DVec3>() / LANDMARKS as f64
}

/// The rotation that takes `from` to `to` best, about their means (Kabsch).
pub(crate) fn rotation_between(from: &[DVec3; LANDMARKS], to: &[DVec3; LANDMARKS]) -> DMat3 {
    let (a, b) = (mean(from), mean(to));
    let mut covariance = Matrix3::zeros();
    for (p, q) in from.iter().zip(to) {
        let (p, q) = ((*p - a).to_array(), (*q - b).to_array());
        covariance += Matrix3::from_fn(|i, j| q[i] * p[j]);
    }
    let svd = covariance.svd(true, true);
    let (Some(u), Some(v)) = (svd.u, svd.v_t) else { return DMat3::IDENTITY };
    let mut sign = Matrix3::identity();
    sign[(2, 2)] = (u * v).determinant().signum();
    let rotation = u * sign * v;
    DMat3::from_cols_array_2d(&std::array::from_fn(|c| std::array::from_fn(|r| rotation[(r, c)])))
}

/// The rotation with the least sum of angles to all others.
fn robust_mean(rotations: &[DQuat]) -> DQuat {
    let angles = |from: DQuat| rotations.iter().map(move |to| from.angle_between(*to));
    let best = rotations.iter().min_by(|a, b| angles(**a).sum::<f64>().total_cmp(&angles(**b).sum::<f64>()));
    let mut mean = best.copied().unwrap_or(DQuat::IDENTITY);
    for _ in 0..ROBUST_STEPS {
        let mut sum = DVec3::ZERO;
        let mut weights = 0.0;
        for rotation in rotations {
            let mut off = *rotation * mean.inverse();
            if off.w < 0.0 {
                off = -off;
            }
            let turn = off.to_scaled_axis();
            let weight = 1.0 / turn.length().max(0.02);
            sum += turn * weight;
            weights += weight;
        }
        if weights > 0.0 {
            mean = (DQuat::from_scaled_axis(sum / weights) * mean).normalize();
        }
    }
    mean
}

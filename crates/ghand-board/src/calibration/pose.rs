//! Where the board is, from one image of it.

use ghand_capture::cameras::rigid::Rigid;
use ghand_core::rotation::rotation_from_axis_angle;
use glam::{DMat3, DQuat, DVec2, DVec3};
use nalgebra::{Matrix3, Matrix6, SMatrix, Vector6};

use super::homography::homography;

/// Steps of the refinement.
const STEPS: usize = 12;

/// A pose turned about the origin's axes and moved by a step of six numbers.
pub(super) fn moved(pose: &Rigid, by: &[f64]) -> Rigid {
    let rotation = rotation_from_axis_angle(DVec3::from_slice(by)) * pose.rotation;
    Rigid { rotation, translation: pose.translation + DVec3::from_slice(&by[3..]) }
}

/// The pose `camera_from_board` in which places of the board's plane are seen along rays (x/z, y/z), with the median
/// distance of rays; `None` if the places do not tell.
///
/// Two poses may look nearly alike, tilted to opposite sides; both are tried.
pub(super) fn board_pose(places: &[DVec3], rays: &[DVec2]) -> Option<(Rigid, f64)> {
    let plane: Vec<DVec2> = places.iter().map(|place| place.truncate()).collect();
    let first = from_homography(&homography(&plane, rays)?)?;
    let middle = places.iter().sum::<DVec3>() / places.len() as f64;
    let towards = first.apply(middle).normalize_or_zero();
    let normal = first.rotation.z_axis;
    let mirrored = 2.0 * normal.dot(towards) * towards - normal;
    let rotation = DMat3::from_quat(DQuat::from_rotation_arc(normal, mirrored)) * first.rotation;
    let second = Rigid { rotation, translation: first.apply(middle) - rotation * middle };
    let refined = [first, second].into_iter().filter_map(|pose| refined(pose, places, rays));
    let best = refined.min_by(|a, b| a.1.total_cmp(&b.1))?.0;
    let mut errors: Vec<f64> =
        places.iter().zip(rays).map(|(place, ray)| seen(best.apply(*place)).distance(*ray)).collect();
    errors.sort_by(f64::total_cmp);
    Some((best, errors[errors.len() / 2]))
}

fn seen(at: DVec3) -> DVec2 {
    at.truncate() / at.z
}

/// The pose whose first two columns and translation are the homography's, up to its scale.
fn from_homography(map: &DMat3) -> Option<Rigid> {
    let scale = 2.0 / (map.x_axis.length() + map.y_axis.length());
    let scale = if map.z_axis.z < 0.0 { -scale } else { scale };
    let [x, y, translation] = [map.x_axis, map.y_axis, map.z_axis].map(|axis| axis * scale);
    let z = x.cross(y);
    let svd =
        Matrix3::from_column_slice(&[x.x, x.y, x.z, y.x, y.y, y.z, z.x, z.y, z.z]).try_svd(true, true, 1e-14, 200)?;
    let near = svd.u? * svd.v_t?;
    let rotation = DMat3::from_cols_slice(near.as_slice());
    let is_sound =
        rotation.is_finite() && translation.is_finite() && rotation.determinant() > 0.0 && translation.z > 0.0;
    is_sound.then_some(Rigid { rotation, translation })
}

/// Gauss and Newton's method on the rays; the pose and the sum of squares.
fn refined(mut pose: Rigid, places: &[DVec3], rays: &[DVec2]) -> Option<(Rigid, f64)> {
    let cost = |pose: &Rigid| -> f64 {
        let squares = places.iter().zip(rays).map(|(place, ray)| {
            let at = pose.apply(*place);
            if at.z > 0.0 { seen(at).distance_squared(*ray) } else { f64::INFINITY }
        });
        squares.sum()
    };
    let mut best = cost(&pose);
    let mut damping = 1e-6;
    for _ in 0..STEPS {
        let mut matrix = Matrix6::zeros();
        let mut gradient = Vector6::zeros();
        for (place, ray) in places.iter().zip(rays) {
            let turned = pose.rotation * *place;
            let at = turned + pose.translation;
            let error = seen(at) - *ray;
            let by_point = [DVec3::new(1.0, 0.0, -at.x / at.z) / at.z, DVec3::new(0.0, 1.0, -at.y / at.z) / at.z];
            for (by, error) in by_point.into_iter().zip(error.to_array()) {
                let turn = turned.cross(by);
                let row = SMatrix::<f64, 6, 1>::from([turn.x, turn.y, turn.z, by.x, by.y, by.z]);
                matrix += row * row.transpose();
                gradient += row * error;
            }
        }
        for k in 0..6 {
            matrix[(k, k)] *= 1.0 + damping;
        }
        let step = -(matrix.cholesky()?.solve(&gradient));
        let moved = moved(&pose, step.as_slice());
        let found = cost(&moved);
        if found < best {
            let is_settled = best - found < 1e-9 * best;
            (pose, best) = (moved, found);
            damping = (damping * 0.1f64).max(1e-9);
            if is_settled {
                break;
            }
        } else {
            damping *= 30.0;
        }
    }
    best.is_finite().then_some((pose, best))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tilted_boards_pose_is_found_from_its_rays() {
        let places: Vec<DVec3> =
            (0..35).map(|k| DVec3::new(f64::from(k % 7) * 0.03, f64::from(k / 7) * 0.03, 0.0)).collect();
        for turn in [DVec3::new(0.4, -0.5, 0.3), DVec3::new(-0.8, 0.1, 2.5), DVec3::new(0.02, 0.01, -1.0)] {
            let pose = Rigid { rotation: rotation_from_axis_angle(turn), translation: DVec3::new(-0.1, 0.05, 0.7) };
            let rays: Vec<DVec2> = places.iter().map(|place| seen(pose.apply(*place))).collect();
            let (found, error) = board_pose(&places, &rays).unwrap();
            assert!(found.angle(&pose) < 1e-6 && found.translation.distance(pose.translation) < 1e-7, "{found:?}");
            assert!(error < 1e-9);
        }
        let line: Vec<DVec3> = places[..7].to_vec();
        let rays: Vec<DVec2> = line.iter().map(|place| seen(*place + DVec3::Z)).collect();
        assert!(board_pose(&line, &rays).is_none());
    }
}

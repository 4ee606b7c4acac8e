//! The map of one plane to another that a few pairs of points tell.

use glam::{DMat3, DVec2, DVec3};
use nalgebra::{SMatrix, SVector};

/// Pairs that tell a map at least.
const LEAST: usize = 6;
/// Points that are nearer to a line than this, relative to their spread, do not tell.
const FLATTEST: f64 = 0.02;

/// The homography that takes each point `from` nearest to its point `to`, up to its scale, by the direct linear transform
/// in coordinates of unit spread; `None` if there are too few points, or all are nearly on a line.
pub(crate) fn homography(from: &[DVec2], to: &[DVec2]) -> Option<DMat3> {
    if from.len() < LEAST || from.len() != to.len() {
        return None;
    }
    let [unit_from, unit_to] = [unit(from)?, unit(to)?];
    let mut sum = SMatrix::<f64, 9, 9>::zeros();
    for (from, to) in from.iter().zip(to) {
        let (p, q) = (unit_from * from.extend(1.0), unit_to * to.extend(1.0));
        let rows = [
            [p.x, p.y, 1.0, 0.0, 0.0, 0.0, -q.x * p.x, -q.x * p.y, -q.x],
            [0.0, 0.0, 0.0, p.x, p.y, 1.0, -q.y * p.x, -q.y * p.y, -q.y],
        ];
        for row in rows {
            let row = SVector::<f64, 9>::from(row);
            sum += row * row.transpose();
        }
    }
    let eigen = sum.symmetric_eigen();
    let least = eigen.eigenvalues.imin();
    let h = eigen.eigenvectors.column(least);
    let map =
        DMat3::from_cols(DVec3::new(h[0], h[3], h[6]), DVec3::new(h[1], h[4], h[7]), DVec3::new(h[2], h[5], h[8]));
    let map = unit_to.inverse() * map * unit_from;
    map.is_finite().then_some(map)
}

/// What moves points to the origin and scales their spread to 1; `None` if they are nearly on a line.
fn unit(points: &[DVec2]) -> Option<DMat3> {
    let count = points.len() as f64;
    let middle = points.iter().sum::<DVec2>() / count;
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    for point in points {
        let off = *point - middle;
        xx += off.x * off.x / count;
        xy += off.x * off.y / count;
        yy += off.y * off.y / count;
    }
    let mean = 0.5 * (xx + yy);
    let flat = mean - (0.25 * (xx - yy).powi(2) + xy * xy).sqrt();
    if !(mean > 0.0 && flat > FLATTEST * FLATTEST * mean) {
        return None;
    }
    let scale = mean.sqrt().recip();
    Some(DMat3::from_cols(DVec3::X * scale, DVec3::Y * scale, (-middle * scale).extend(1.0)))
}

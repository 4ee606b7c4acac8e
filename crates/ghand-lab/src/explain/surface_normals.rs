//! Normals of a surface of points that has moved.

use ghand_avatar::Template;
use ghand_avatar::neighbors::{MOST_NEIGHBORS, neighbors};
use glam::DVec3;

/// Normals of the moved points, unit length, N: those at rest, tilted by how the heights of the neighbours change along the
/// surface (least squares). Points with too few neighbours keep their normals.
pub fn moved_normals(template: &Template, normals: &[DVec3], moved: &[DVec3]) -> Vec<DVec3> {
    let count = moved.len();
    let table = neighbors(template);
    let tilted = |(p, normal): (usize, &DVec3)| {
        let (u, v) = normal.any_orthonormal_pair();
        // Sums of the normal equations: uu, uv, vv, uh, vh.
        let mut sums = [0.0; 5];
        for k in 0..MOST_NEIGHBORS {
            let apart = moved[table[k * count + p] as usize] - moved[p];
            let (a, b, h) = (apart.dot(u), apart.dot(v), apart.dot(*normal));
            let products = [a * a, a * b, b * b, a * h, b * h];
            sums.iter_mut().zip(products).for_each(|(sum, product)| *sum += product);
        }
        let [uu, uv, vv, uh, vh] = sums;
        let determinant = uu * vv - uv * uv;
        if determinant <= 1e-3 * (uu + vv).powi(2) {
            return *normal;
        }
        let (along_u, along_v) = ((vv * uh - uv * vh) / determinant, (uu * vh - uv * uh) / determinant);
        (*normal - along_u * u - along_v * v).normalize_or(*normal)
    };
    normals.iter().enumerate().map(tilted).collect()
}

#[cfg(test)]
mod tests {
    use ghand_core::Side;
    use ghand_hand_model::builtin::builtin_hand;
    use ghand_hand_model::surface::sample_surface;

    use super::*;

    #[test]
    fn a_rotated_surface_has_rotated_normals() {
        let model = builtin_hand(Side::Right).unwrap();
        let template = Template::sample(&model, 96).unwrap();
        let samples = sample_surface(&model, 96).unwrap();
        let turn = glam::DQuat::from_rotation_z(0.3);
        let turned: Vec<DVec3> = samples.positions.iter().map(|p| turn * *p).collect();
        let before = moved_normals(&template, &samples.normals, &samples.positions);
        let after = moved_normals(&template, &samples.normals, &turned);
        let mut angles: Vec<f64> = before.iter().zip(&after).map(|(a, b)| (turn * *a).angle_between(*b)).collect();
        angles.sort_unstable_by(f64::total_cmp);
        // Each is a fit in a plane of another normal: equal where the surface is smooth.
        assert!(angles[angles.len() * 9 / 10] < 0.06, "{}", angles[angles.len() * 9 / 10]);
        let off: Vec<f64> = before.iter().zip(&samples.normals).map(|(a, b)| a.angle_between(*b)).collect();
        assert!(off.iter().sum::<f64>() / (off.len() as f64) < 0.2);
    }
}

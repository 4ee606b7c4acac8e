//! How deep a posed hand is inside itself.

use glam::DVec3;
use rayon::prelude::*;

/// Skin this near at rest, metres, is a vertex's own: in a crease it presses against the vertex, as flesh does, and does
/// not count.
const OWN_SKIN: f64 = 0.012;

/// Depth of each vertex of a closed surface in other parts of it, metres, `V`; 0 where a vertex is in none. `rest` and
/// `posed` are the vertices, `V`, metres.
///
/// A vertex is inside another part if the skin that is not its own ([`OWN_SKIN`]) winds more than once around it
/// (generalised winding number, Jacobson and others 2013): around a point of a plain surface that part winds once less
/// what the vertex's own skin covers, about half. The depth is the distance to the nearest of that skin, or in a crease
/// to skin that faces the vertex's.
pub fn self_penetration(faces: &[[u32; 3]], rest: &[DVec3], posed: &[DVec3]) -> Vec<f64> {
    let corners = |points: &[DVec3], face: &[u32; 3]| face.map(|i| points[i as usize]);
    let middles: Vec<DVec3> = faces.iter().map(|face| corners(rest, face).iter().sum::<DVec3>() / 3.0).collect();
    let areas: Vec<DVec3> = faces.iter().map(|face| area(corners(posed, face))).collect();
    let mut normals = vec![DVec3::ZERO; posed.len()];
    for (face, area) in faces.iter().zip(&areas) {
        face.iter().for_each(|&i| normals[i as usize] += *area);
    }
    let depth = |vertex: usize| {
        let at = posed[vertex];
        let is_other = |face: usize| middles[face].distance_squared(rest[vertex]) > OWN_SKIN * OWN_SKIN;
        let others = (0..faces.len()).filter(|face| is_other(*face));
        let turns: f64 = others.map(|face| solid_angle(at, corners(posed, &faces[face]))).sum();
        if turns <= 4.0 * std::f64::consts::PI {
            return 0.0;
        }
        let is_outside = |face: &usize| is_other(*face) || areas[*face].dot(normals[vertex]) < 0.0;
        let outside = (0..faces.len()).filter(is_outside);
        outside.map(|face| triangle_distance(at, corners(posed, &faces[face]))).fold(f64::INFINITY, f64::min)
    };
    (0..posed.len()).into_par_iter().map(depth).collect()
}

/// The largest of [`self_penetration`], metres.
pub fn deepest_penetration(faces: &[[u32; 3]], rest: &[DVec3], posed: &[DVec3]) -> f64 {
    self_penetration(faces, rest, posed).into_iter().fold(0.0, f64::max)
}

/// Twice the area of a triangle, along its normal.
fn area([a, b, c]: [DVec3; 3]) -> DVec3 {
    (b - a).cross(c - a)
}

/// Solid angle of a triangle seen from a point, positive from behind (van Oosterom and Strackee 1983).
fn solid_angle(from: DVec3, corners: [DVec3; 3]) -> f64 {
    let [a, b, c] = corners.map(|corner| corner - from);
    let [la, lb, lc] = [a, b, c].map(DVec3::length);
    2.0 * a.dot(b.cross(c)).atan2(la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb)
}

/// Distance of a point from a triangle.
pub fn triangle_distance(from: DVec3, [a, b, c]: [DVec3; 3]) -> f64 {
    let normal = area([a, b, c]);
    let beside = |p: DVec3, q: DVec3| (q - p).cross(from - p).dot(normal) < 0.0;
    let edge = |p: DVec3, q: DVec3| {
        let along = q - p;
        let t = ((from - p).dot(along) / along.length_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        from.distance(p + along * t)
    };
    if normal == DVec3::ZERO || beside(a, b) || beside(b, c) || beside(c, a) {
        edge(a, b).min(edge(b, c)).min(edge(c, a))
    } else {
        (from - a).dot(normal).abs() / normal.length()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A closed tube along z with round ends, 80 mm long and 9 mm in radius: a finger.
    fn finger(middle: DVec3, faces: &mut Vec<[u32; 3]>, vertices: &mut Vec<DVec3>) {
        const ROUND: u32 = 24;
        const RINGS: u32 = 40;
        let start = vertices.len() as u32;
        for ring in 0..=RINGS {
            // 0 at one end, pi at the other; the straight part is between.
            let polar = std::f64::consts::PI * f64::from(ring) / f64::from(RINGS);
            let z = 0.009 * polar.cos() + 0.031 * (2.0 * polar.cos()).clamp(-1.0, 1.0);
            for k in 0..ROUND {
                let turn = std::f64::consts::TAU * f64::from(k) / f64::from(ROUND);
                let radius = 0.009 * polar.sin();
                vertices.push(middle + DVec3::new(radius * turn.cos(), radius * turn.sin(), z));
            }
        }
        for (ring, k) in (0..RINGS).flat_map(|ring| (0..ROUND).map(move |k| (ring, k))) {
            let at = |ring: u32, k: u32| start + ring * ROUND + k % ROUND;
            let [a, b, c, d] = [at(ring, k), at(ring + 1, k), at(ring + 1, k + 1), at(ring, k + 1)];
            faces.extend([[a, b, c], [a, c, d]]);
        }
    }

    /// Two fingers whose axes are this far apart at rest and posed.
    fn deepest(rest: f64, posed: f64) -> f64 {
        let [mut faces, mut ignored] = [vec![], vec![]];
        let pair = |gap: f64, faces: &mut Vec<[u32; 3]>| {
            let mut vertices = vec![];
            finger(DVec3::ZERO, faces, &mut vertices);
            finger(DVec3::X * gap, faces, &mut vertices);
            vertices
        };
        let rest = pair(rest, &mut faces);
        let posed = pair(posed, &mut ignored);
        deepest_penetration(&faces, &rest, &posed)
    }

    #[test]
    fn fingers_pushed_into_each_other_are_as_deep_as_they_were_pushed() {
        for pushed in [0.0, 0.001, 0.002, 0.004, 0.008] {
            let depth = deepest(0.04, 0.018 - pushed);
            // The tube has 24 sides, whose middles are 0.08 mm nearer to its axis than its edges.
            assert!((depth - pushed).abs() < 0.0002, "{pushed} m: {depth} m");
        }
        assert_eq!(deepest(0.04, 0.0185), 0.0);
    }

    #[test]
    fn skin_that_is_near_at_rest_may_overlap() {
        assert!(deepest(0.0181, 0.016) < 0.0001);
    }

    #[test]
    fn a_triangle_is_as_far_as_its_nearest_point() {
        let corners = [DVec3::ZERO, DVec3::X, DVec3::Y];
        for (from, expected) in [
            (DVec3::new(0.2, 0.2, -3.0), 3.0),
            (DVec3::new(0.5, -2.0, 0.0), 2.0),
            (DVec3::new(-3.0, -4.0, 0.0), 5.0),
            (DVec3::new(1.0, 1.0, 0.0), 0.5f64.sqrt()),
        ] {
            assert!((triangle_distance(from, corners) - expected).abs() < 1e-12, "{from}");
        }
    }
}

//! The thickness of a hand below each point of its surface.

use ghand_core::HandModel;
use ghand_hand_model::SurfaceSamples;
use glam::DVec3;
use rayon::prelude::*;

/// Depth below the surface at which a ray starts, metres, so that it does not hit the faces around its vertex.
const START: f64 = 1e-5;

/// Distance at which the ray from `origin` along `direction` (a unit vector) exits through the triangle, metres.
fn exit_distance(origin: DVec3, direction: DVec3, [a, b, c]: [DVec3; 3]) -> Option<f64> {
    let (ab, ac) = (b - a, c - a);
    let normal = ab.cross(ac);
    let facing = normal.dot(direction);
    // Faces point outwards: a ray from inside exits through the back of a face.
    if facing <= 0.0 {
        return None;
    }
    let distance = normal.dot(a - origin) / facing;
    let point = origin + direction * distance - a;
    let (u, v) = (point.cross(ac).dot(normal), ab.cross(point).dot(normal));
    let square = normal.length_squared();
    (distance > 0.0 && u >= 0.0 && v >= 0.0 && u + v <= square).then_some(distance)
}

/// Thickness of the hand at each vertex of its mesh, metres: the distance straight inwards to the opposite surface.
/// Infinite where the ray hits no surface, as at an open wrist.
fn at_vertices(model: &HandModel) -> Vec<f64> {
    let triangles: Vec<[DVec3; 3]> = model.faces.iter().map(|face| face.map(|v| model.vertices[v as usize])).collect();
    let mut normals = vec![DVec3::ZERO; model.vertices.len()];
    for (face, [a, b, c]) in model.faces.iter().zip(&triangles) {
        let normal = (*b - *a).cross(*c - *a);
        face.iter().for_each(|v| normals[*v as usize] += normal);
    }
    // Balls around the triangles: a ray past a ball needs no further look.
    let ball = |[a, b, c]: &[DVec3; 3]| {
        let center = (*a + *b + *c) / 3.0;
        let square = [a, b, c].map(|corner| corner.distance_squared(center)).into_iter().fold(0.0, f64::max);
        (center, square * (1.0 + 1e-9))
    };
    let balls: Vec<(DVec3, f64)> = triangles.iter().map(ball).collect();
    let thickness = |(vertex, normal): (&DVec3, &DVec3)| {
        let inwards = -normal.normalize_or_zero();
        let origin = *vertex + inwards * START;
        let passes = |(center, square): &(DVec3, f64)| (*center - origin).cross(inwards).length_squared() <= *square;
        let near = triangles.iter().zip(&balls).filter(|(_, ball)| passes(ball));
        near.filter_map(|(t, _)| exit_distance(origin, inwards, *t)).fold(f64::INFINITY, f64::min)
    };
    model.vertices.par_iter().zip(&normals).map(thickness).collect()
}

/// Thickness of the hand below each sample, metres: the minimum over its triangle's corners.
pub fn local_thickness(model: &HandModel, samples: &SurfaceSamples) -> Vec<f64> {
    let at_vertices = at_vertices(model);
    let least = |face: &u32| {
        model.faces[*face as usize].map(|v| at_vertices[v as usize]).into_iter().fold(f64::INFINITY, f64::min)
    };
    samples.faces.iter().map(least).collect()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

    use ghand_hand_model::surface::sample_surface;
    use ghand_test_support::procedural_hand::ProceduralHand;

    use super::*;

    #[test]
    fn a_ray_exits_only_through_the_back_of_a_face() {
        let face = [DVec3::ZERO, DVec3::X, DVec3::Y];
        let inside = DVec3::new(0.2, 0.2, -3.0);
        assert_eq!(exit_distance(inside, DVec3::Z, face), Some(3.0));
        assert_eq!(exit_distance(inside, -DVec3::Z, face), None);
        assert_eq!(exit_distance(DVec3::new(0.2, 0.2, 3.0), -DVec3::Z, face), None, "from outside");
        assert_eq!(exit_distance(DVec3::new(0.8, 0.8, -3.0), DVec3::Z, face), None, "next to the face");
    }

    #[test]
    fn fingers_have_a_plausible_thickness() {
        let model = ProceduralHand::default().build().unwrap();
        let samples = sample_surface(&model, 64).unwrap();
        let thickness = local_thickness(&model, &samples);
        let tip = model.joint_names.iter().position(|name| name.contains("index") && name.contains('3')).unwrap();
        let at_tip: Vec<f64> = (0..samples.len())
            .filter(|p| samples.weights[tip * samples.len() + p] > 0.9)
            .map(|p| thickness[p])
            .filter(|t| t.is_finite())
            .collect();
        let mean = at_tip.iter().sum::<f64>() / at_tip.len() as f64;
        assert!(at_tip.len() > 20 && (0.005..0.025).contains(&mean), "{} samples, {mean} m", at_tip.len());
    }
}

//! Finds the nails that a hand's mesh models: plates with creases around them.

use std::collections::{HashMap, HashSet};

use ghand_core::HandModel;
use glam::{DVec2, DVec3};

use crate::noise::smoothstep;

/// Faces that meet at more than this, radians, do not belong to one plate: the free edge, or the groove around it.
const CREASE: f64 = 35.0 * std::f64::consts::PI / 180.0;
/// Faces lower than this, metres, are the walls of the groove.
const LEAST_HEIGHT: f64 = 0.001;
/// No nail reaches farther from its fingertip, metres.
const REACH: f64 = 0.022;

/// The last bone of a finger.
pub(crate) struct LastBone {
    /// Index of its joint.
    pub joint: usize,
    /// Unit direction of the bone.
    pub along: DVec3,
    /// The outermost point of the tip, metres.
    pub tip: DVec3,
    /// Length from the joint to the tip, metres.
    pub length: f64,
    /// About where the nail faces; unit vector across the bone.
    pub dorsal: DVec3,
}

/// A nail's plate.
#[derive(Debug, Clone)]
pub(crate) struct NailPlate {
    /// Unit normal, the mean over the plate.
    pub normal: DVec3,
    center: DVec3,
    /// Vectors from the centre to the free edge and to a side.
    half_axes: [DVec3; 2],
}

impl NailPlate {
    /// The plate of a finger, if the mesh has one.
    pub(crate) fn of(model: &HandModel, bone: &LastBone) -> Option<NailPlate> {
        let shapes: Vec<FaceShape> = model.faces.iter().map(|face| FaceShape::of(model, face)).collect();
        let seed = seed(model, &shapes, bone)?;
        let plate = plate_faces(model, &shapes, seed, bone.tip)?;
        let weighted = |f: &usize| shapes[*f].normal * shapes[*f].area;
        let normal = plate.iter().map(weighted).sum::<DVec3>().try_normalize()?;
        Some(NailPlate::with_axes(&outline(model, &shapes, &plate, normal), normal, bone.along))
    }

    fn with_axes(points: &[DVec3], normal: DVec3, along: DVec3) -> NailPlate {
        let axes = [along.reject_from(normal).normalize_or_zero(), normal.cross(along).normalize_or_zero()];
        let mut center = normal * points.iter().map(|p| p.dot(normal)).sum::<f64>() / points.len().max(1) as f64;
        let half_axes = axes.map(|axis| {
            let low = points.iter().map(|p| p.dot(axis)).fold(f64::INFINITY, f64::min);
            let high = points.iter().map(|p| p.dot(axis)).fold(f64::NEG_INFINITY, f64::max);
            center += axis * (low + high) * 0.5;
            axis * (high - low) * 0.5
        });
        NailPlate { normal, center, half_axes }
    }

    /// Where a point is on the plate: along from -1 at its root to 1 at its free edge, and across from -1 to 1.
    pub(crate) fn coordinates(&self, point: DVec3) -> DVec2 {
        let [along, across] = self.half_axes.map(|half| (point - self.center).dot(half) / half.length_squared());
        DVec2::new(along, across)
    }

    /// How far out a point is: 0 in the middle, 1 at the border, which is round at the root and square at the free edge.
    pub(crate) fn eccentricity(&self, point: DVec3) -> f64 {
        let at = self.coordinates(point);
        let roundness = if at.x < 0.0 { 2.6 } else { 5.0 };
        (at.x.abs().powf(roundness) + at.y.abs().powi(3)).cbrt()
    }

    /// How much a point of the skin belongs to the plate, `[0, 1]`; its border is soft.
    pub(crate) fn part_of(&self, point: DVec3, normal: DVec3) -> f64 {
        smoothstep(0.05, 0.3, normal.dot(self.normal)) * smoothstep(1.03, 0.95, self.eccentricity(point))
    }
}

/// Middle, unit normal, area and least height of a face.
struct FaceShape {
    middle: DVec3,
    normal: DVec3,
    area: f64,
    height: f64,
}

impl FaceShape {
    fn of(model: &HandModel, face: &[u32; 3]) -> FaceShape {
        let [a, b, c] = face.map(|v| model.vertices[v as usize]);
        let double = (b - a).cross(c - a);
        let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
        FaceShape {
            middle: (a + b + c) / 3.0,
            normal: double.normalize_or_zero(),
            area: 0.5 * double.length(),
            height: double.length() / longest.max(f64::MIN_POSITIVE),
        }
    }
}

/// The face in the middle of the nail: nearest to a line out of the back of the last bone, a quarter of it behind the
/// tip.
fn seed(model: &HandModel, shapes: &[FaceShape], bone: &LastBone) -> Option<usize> {
    let foot = bone.tip - bone.along * (0.25 * bone.length);
    let on_bone = |f: usize| model.faces[f].iter().all(|&v| model.vertex_weights(v as usize)[bone.joint] > 0.5);
    let faces_up = |f: usize| {
        (shapes[f].middle - foot).dot(bone.dorsal) > 0.0 && shapes[f].normal.dot(bone.dorsal) > 0.5 && on_bone(f)
    };
    let away = |f: usize| (shapes[f].middle - foot).reject_from(bone.dorsal).length();
    (0..shapes.len()).filter(|&f| faces_up(f)).min_by(|&a, &b| away(a).total_cmp(&away(b)))
}

/// The faces that are reached from the seed without crossing a crease; `None` if they lead around or down the finger,
/// or if less than a third of what encloses them are walls of a groove: any coarse mesh has sharp edges.
fn plate_faces(model: &HandModel, shapes: &[FaceShape], seed: usize, tip: DVec3) -> Option<Vec<usize>> {
    let neighbours = neighbours(&model.faces);
    let mut plate = vec![seed];
    let mut next = 0;
    let mut walls = 0;
    let mut edges = 0;
    while let Some(&face) = plate.get(next) {
        next += 1;
        for &other in &neighbours[face] {
            let bend = shapes[face].normal.dot(shapes[other].normal).clamp(-1.0, 1.0).acos();
            let is_wall = shapes[other].height <= LEAST_HEIGHT;
            if plate.contains(&other) {
                continue;
            }
            if is_wall || bend >= CREASE {
                (walls, edges) = (walls + usize::from(is_wall), edges + usize::from(!is_wall));
                continue;
            }
            let faces_up = shapes[other].normal.dot(shapes[seed].normal) > 0.3;
            if !faces_up || shapes[other].middle.distance(tip) > REACH {
                return None;
            }
            plate.push(other);
        }
    }
    if 2 * walls < edges {
        return None;
    }
    Some(plate)
}

/// The corners of the plate and of the faces that touch it and face up: the rims of its groove and of its free edge.
fn outline(model: &HandModel, shapes: &[FaceShape], plate: &[usize], normal: DVec3) -> Vec<DVec3> {
    let corners: HashSet<u32> = plate.iter().flat_map(|&f| model.faces[f]).collect();
    let touches = |f: usize| model.faces[f].iter().any(|v| corners.contains(v));
    let is_rim = |f: usize| shapes[f].height <= LEAST_HEIGHT && shapes[f].normal.dot(normal) > 0.7 && touches(f);
    let rim = (0..shapes.len()).filter(|&f| is_rim(f)).flat_map(|f| model.faces[f]);
    corners.iter().copied().chain(rim).map(|v| model.vertices[v as usize]).collect()
}

/// The faces beside each face.
fn neighbours(faces: &[[u32; 3]]) -> Vec<Vec<usize>> {
    let mut of_edge: HashMap<[u32; 2], Vec<usize>> = HashMap::new();
    let edges = |[a, b, c]: [u32; 3]| [(a, b), (b, c), (c, a)].map(|(a, b)| [a.min(b), a.max(b)]);
    for (i, face) in faces.iter().enumerate() {
        edges(*face).into_iter().for_each(|edge| of_edge.entry(edge).or_default().push(i));
    }
    let beside =
        |i: usize| edges(faces[i]).into_iter().flat_map(|edge| of_edge[&edge].clone()).filter(|j| *j != i).collect();
    (0..faces.len()).map(beside).collect()
}

#[cfg(test)]
mod tests {
    use ghand_core::Side;
    use ghand_hand_model::builtin::builtin_hand;
    use ghand_test_support::procedural_hand::ProceduralHand;

    use crate::hand::anatomy::Anatomy;

    #[test]
    fn every_finger_of_the_built_in_hand_has_a_nail_of_usual_size() {
        let model = builtin_hand(Side::Right).unwrap();
        let anatomy = Anatomy::of(&model);
        assert_eq!(anatomy.fingers.len(), 5);
        for finger in &anatomy.fingers {
            let plate = finger.nail.as_ref().unwrap();
            let [length, width] = plate.half_axes.map(|half| 2.0 * half.length());
            assert!((0.005..0.017).contains(&length), "{length} m long");
            assert!((0.007..0.015).contains(&width), "{width} m wide");
            assert!(plate.normal.dot(finger.dorsal) > 0.9, "it faces {}", plate.normal);
            let [tip, joint] = [3, 2].map(|k| plate.coordinates(finger.points[k]).x);
            assert!(tip > 0.5 && joint < -1.5, "the tip is at {tip}, the joint at {joint}");
        }
    }

    #[test]
    fn a_mesh_without_modelled_nails_has_none() {
        let anatomy = Anatomy::of(&ProceduralHand { detail: 1, ..Default::default() }.build().unwrap());
        assert!(anatomy.fingers.len() == 5 && anatomy.fingers.iter().all(|finger| finger.nail.is_none()));
    }
}

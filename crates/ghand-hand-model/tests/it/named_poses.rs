//! Named poses on the built-in hand: what touches, and what must not be inside anything else.

use ghand_core::posing::pose_hand;
use ghand_core::{HandModel, Side};
use ghand_hand_model::builtin::builtin_hand;
use ghand_hand_model::joints::axes::{JointAxes, fingertips};
use ghand_hand_model::joints::names::{Finger, JointRole};
use ghand_hand_model::named_poses::{POSE_NAMES, named_pose};
use ghand_test_support::self_penetration::{deepest_penetration, triangle_distance};
use glam::DVec3;

/// Flesh that presses against flesh may be this deep, metres.
const DEEPEST: f64 = 0.002;

/// The built-in hand in a pose.
struct Posed {
    model: HandModel,
    vertices: Vec<DVec3>,
    normals: Vec<DVec3>,
}

impl Posed {
    fn new(name: &str, side: Side) -> Posed {
        let model = builtin_hand(side).unwrap();
        let vertices = pose_hand(&model, &[], &named_pose(name, &model).unwrap()).unwrap().vertices;
        let normals = model.vertex_normals(&vertices);
        Posed { model, vertices, normals }
    }

    fn joint(&self, finger: Finger, k: u8) -> usize {
        let roles = JointRole::of_joints(&self.model.joint_names);
        roles.iter().position(|role| *role == Some(JointRole::Bend(finger, k))).unwrap()
    }

    /// The vertices that follow a joint more than any other.
    fn skin(&self, finger: Finger, k: u8) -> Vec<usize> {
        let joint = self.joint(finger, k);
        let is_of_it = |i: &usize| {
            let weights = self.model.vertex_weights(*i);
            weights.iter().all(|weight| *weight <= weights[joint])
        };
        (0..self.model.vertices.len()).filter(is_of_it).collect()
    }

    /// The skin of a finger's last bone that faces away from its nail.
    fn pad(&self, finger: Finger) -> Vec<usize> {
        let model = &self.model;
        let joint = self.joint(finger, 3);
        let tip = fingertips(model, &JointRole::of_joints(&model.joint_names))[finger as usize];
        let inner = JointAxes::of_joints(model).unwrap()[joint].flexion.cross(tip - model.joints[joint]).normalize();
        let normals = model.vertex_normals(&model.vertices);
        let mut pad = self.skin(finger, 3);
        pad.retain(|i| normals[*i].dot(inner) > 0.3);
        pad
    }

    /// The least distance between two parts of the skin, metres, from the vertices of one to the triangles of the
    /// other, and the cosine between the normals there.
    fn gap(&self, from: &[usize], to: &[usize]) -> (f64, f64) {
        let faces = self.model.faces.iter().filter(|face| face.iter().any(|i| to.contains(&(*i as usize))));
        let pairs = faces.flat_map(|face| from.iter().map(move |i| (face, *i)));
        let distance = |(face, i): (&[u32; 3], usize)| {
            let normal: DVec3 = face.iter().map(|k| self.normals[*k as usize]).sum();
            let corners = face.map(|k| self.vertices[k as usize]);
            (triangle_distance(self.vertices[i], corners), normal.normalize().dot(self.normals[i]))
        };
        pairs.map(distance).min_by(|a, b| a.0.total_cmp(&b.0)).unwrap()
    }
}

#[test]
fn no_named_pose_is_inside_itself() {
    for side in [Side::Right, Side::Left] {
        for name in POSE_NAMES {
            let posed = Posed::new(name, side);
            let depth = deepest_penetration(&posed.model.faces, &posed.model.vertices, &posed.vertices);
            println!("{}, {name}: {:.2} mm", posed.model.name, depth * 1e3);
            assert!(depth < DEEPEST, "{}, {name}: {depth} m", posed.model.name);
        }
    }
}

#[test]
fn thumb_and_index_finger_touch_pad_on_pad() {
    for name in ["pinch", "ok"] {
        let posed = Posed::new(name, Side::Right);
        let (gap, facing) = posed.gap(&posed.pad(Finger::Thumb), &posed.pad(Finger::Index));
        println!("{name}: {:.2} mm, cosine {facing:.2}", gap * 1e3);
        assert!(gap < 0.001 && facing < -0.7, "{name}: {gap} m, cosine {facing}");
    }
}

#[test]
fn the_thumb_lies_on_the_folded_fingers() {
    use Finger::{Index, Little, Middle, Ring};
    let folded: [(&str, &[(Finger, u8)]); 4] = [
        ("fist", &[(Index, 2), (Middle, 2)]),
        ("point", &[(Middle, 2)]),
        ("victory", &[(Ring, 2)]),
        ("three", &[(Little, 3)]),
    ];
    for (name, bones) in folded {
        let posed = Posed::new(name, Side::Right);
        let thumb = [posed.skin(Finger::Thumb, 2), posed.skin(Finger::Thumb, 3)].concat();
        for &(finger, bone) in bones {
            let (gap, _) = posed.gap(&thumb, &posed.skin(finger, bone));
            println!("{name}, {finger:?}: {:.2} mm", gap * 1e3);
            assert!(gap < 0.002, "{name}, {finger:?}: {gap} m");
        }
    }
}

/// What the measure is for: a hand with its fingertips in its palm must not pass.
#[test]
fn a_fist_closed_too_far_is_inside_itself() {
    let model = builtin_hand(Side::Right).unwrap();
    let mut pose = named_pose("fist", &model).unwrap();
    let fist = Posed::new("fist", Side::Right);
    for k in [1, 2] {
        pose.rotations[fist.joint(Finger::Ring, k)] *= 1.2;
    }
    let vertices = pose_hand(&model, &[], &pose).unwrap().vertices;
    assert!(deepest_penetration(&model.faces, &model.vertices, &vertices) > 2.0 * DEEPEST);
}

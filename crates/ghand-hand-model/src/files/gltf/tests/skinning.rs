//! A rig with any node tree poses as the glTF standard says.
//!
//! The standard moves a vertex by the sum of `weight * world_from_joint * inverse_bind_matrix`, with the node tree's
//! world transforms; the mesh node's own transform has no effect. With the rest frame `A_k` of a joint in the mesh's
//! axes (the inverse of its inverse bind matrix), a rotation `R_k` in these axes is the node's rotation multiplied from
//! the right by `A_k^-1 R_k A_k`. The model's axes are the world's, turned from the mesh's; its origin is the mesh's.

use ghand_core::pose::Pose;
use ghand_core::posing::pose_hand;
use ghand_core::rotation::rotation_from_axis_angle;
use glam::{DMat4, DQuat};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::json;

use super::*;

/// A node's local transform.
#[derive(Clone, Copy)]
struct Transform {
    translation: DVec3,
    rotation: DQuat,
    scale: f64,
}

impl Transform {
    fn random(random: &mut ChaCha8Rng, scale: f64) -> Transform {
        let axis_angle = vector(random) * 2.0;
        // With the precision of the file: the rest pose of the tree and the bind matrices must agree.
        Transform {
            translation: vector(random).as_vec3().as_dvec3(),
            rotation: DQuat::from_scaled_axis(axis_angle).as_quat().as_dquat(),
            scale,
        }
    }

    fn matrix(&self) -> DMat4 {
        DMat4::from_scale_rotation_translation(DVec3::splat(self.scale), self.rotation.normalize(), self.translation)
    }

    fn json(&self) -> serde_json::Value {
        let rotation = self.rotation.as_quat().to_array();
        let scale = [self.scale; 3];
        json!({"translation": self.translation.to_array(), "rotation": rotation, "scale": scale})
    }
}

fn vector(random: &mut ChaCha8Rng) -> DVec3 {
    DVec3::from_array(std::array::from_fn(|_| random.random_range(-1.0..1.0)))
}

/// Node 0 is the mesh's, 1 the armature's, 3 is between two joints.
const PARENTS: [Option<usize>; 7] = [None, None, Some(1), Some(2), Some(3), Some(4), Some(2)];
const NAMES: [&str; 7] = ["mesh", "armature", "wrist", "twist", "finger", "fingertip", "thumb"];
/// The nodes of the skin's joints, not in the order of the tree.
const JOINTS: [usize; 4] = [5, 2, 6, 4];
const VERTICES: usize = 30;

fn world(locals: &[DMat4]) -> Vec<DMat4> {
    let mut world: Vec<DMat4> = vec![];
    for (local, parent) in locals.iter().zip(PARENTS) {
        world.push(parent.map_or(*local, |p| world[p] * *local));
    }
    world
}

struct TreeRig {
    locals: Vec<Transform>,
    positions: Vec<DVec3>,
    /// Joint of the skin and weight, eight per vertex; the weights sum to 1.
    bindings: Vec<[(usize, f64); 8]>,
    inverse_binds: Vec<DMat4>,
    /// Transform of the mesh when it was bound.
    world_from_mesh: DMat4,
    glb: Vec<u8>,
}

impl TreeRig {
    fn new(seed: u64) -> TreeRig {
        let random = &mut ChaCha8Rng::seed_from_u64(seed);
        let scales = [3.0, 0.01, 100.0, 0.5, 1.5, 2.0, 1.0];
        let locals: Vec<Transform> = scales.iter().map(|&scale| Transform::random(random, scale)).collect();
        let rest = world(&locals.iter().map(Transform::matrix).collect::<Vec<_>>());
        let world_from_mesh = Transform::random(random, 0.7).matrix();
        let inverse_binds: Vec<DMat4> =
            JOINTS.iter().map(|&n| (rest[n].inverse() * world_from_mesh).as_mat4().as_dmat4()).collect();
        let positions: Vec<DVec3> = (0..VERTICES).map(|_| vector(random).as_vec3().as_dvec3()).collect();
        // One byte per number in the first set, two in the second.
        let joints: Vec<[u8; 8]> =
            (0..VERTICES).map(|_| std::array::from_fn(|_| random.random_range(0..JOINTS.len() as u8))).collect();
        let first: Vec<[u8; 4]> = (0..VERTICES).map(|_| std::array::from_fn(|_| random.random())).collect();
        let second: Vec<[u16; 4]> = (0..VERTICES).map(|_| std::array::from_fn(|_| random.random())).collect();
        let bind = |k: usize| {
            let weights: [f64; 8] = std::array::from_fn(|i| match i {
                0..4 => f64::from(first[k][i]) / 255.0,
                _ => f64::from(second[k][i - 4]) / 65535.0,
            });
            let sum: f64 = weights.iter().sum();
            std::array::from_fn(|i| (usize::from(joints[k][i]), weights[i] / sum))
        };
        let mut file = Parts::default();
        file.add(
            positions.iter().flat_map(|p| p.as_vec3().to_array()).flat_map(f32::to_le_bytes),
            5126,
            "VEC3",
            VERTICES,
        );
        file.add((0..VERTICES).flat_map(|k| [k as f32 / 64.0, 0.5]).flat_map(f32::to_le_bytes), 5126, "VEC2", VERTICES);
        file.add(joints.iter().flat_map(|j| j[..4].to_vec()), 5121, "VEC4", VERTICES);
        file.add(first.iter().flatten().copied(), 5121, "VEC4", VERTICES);
        file.add(
            joints.iter().flat_map(|j| j[4..].to_vec()).flat_map(|j| u16::from(j).to_le_bytes()),
            5123,
            "VEC4",
            VERTICES,
        );
        file.add(second.iter().flatten().flat_map(|w| w.to_le_bytes()), 5123, "VEC4", VERTICES);
        let binds = inverse_binds.iter().flat_map(|m| m.as_mat4().to_cols_array()).flat_map(f32::to_le_bytes);
        file.add(binds, 5126, "MAT4", JOINTS.len());
        for k in [3, 5] {
            file.accessors[k]["normalized"] = true.into();
        }
        file.accessors[0]["min"] = json!([-1, -1, -1]);
        file.accessors[0]["max"] = json!([1, 1, 1]);
        let node = |k: usize| {
            let mut node = locals[k].json();
            node["name"] = NAMES[k].into();
            let children: Vec<usize> = (0..PARENTS.len()).filter(|&c| PARENTS[c] == Some(k)).collect();
            if !children.is_empty() {
                node["children"] = children.into();
            }
            if k == 0 {
                (node["mesh"], node["skin"]) = (0.into(), 0.into());
            }
            node
        };
        let json = json!({
            "asset": {"version": "2.0"},
            "nodes": (0..PARENTS.len()).map(node).collect::<Vec<_>>(),
            "skins": [{"joints": JOINTS, "inverseBindMatrices": 6}],
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1, "JOINTS_0": 2, "WEIGHTS_0": 3,
                "JOINTS_1": 4, "WEIGHTS_1": 5}}]}],
            "buffers": [{"byteLength": file.bytes.len()}],
            "bufferViews": file.views,
            "accessors": file.accessors,
        });
        TreeRig {
            bindings: (0..VERTICES).map(bind).collect(),
            locals,
            positions,
            inverse_binds,
            world_from_mesh,
            glb: SmallHand { json: json.to_string(), bytes: file.bytes }.glb(),
        }
    }

    /// A rotation in the model's axes.
    fn in_model(&self, rotation: DVec3) -> DVec3 {
        let (_, turn, _) = self.world_from_mesh.to_scale_rotation_translation();
        turn * rotation
    }

    /// How far the model's origin is from the world's.
    fn origin(&self) -> DVec3 {
        self.world_from_mesh.w_axis.truncate()
    }

    /// The vertices in the world as the standard defines them, from rotations of the skin's joints in the mesh's axes.
    fn skinned(&self, rotations: &[DVec3]) -> Vec<DVec3> {
        let mut locals: Vec<DMat4> = self.locals.iter().map(Transform::matrix).collect();
        for ((&node, bind), rotation) in JOINTS.iter().zip(&self.inverse_binds).zip(rotations) {
            let (_, rest, _) = bind.inverse().to_scale_rotation_translation();
            let turn = DQuat::from_scaled_axis(*rotation);
            locals[node] *= DMat4::from_quat(rest.inverse() * turn * rest);
        }
        let world = world(&locals);
        let moved = |(p, bindings): (&DVec3, &[(usize, f64); 8])| -> DVec3 {
            let of = |&(joint, weight): &(usize, f64)| {
                (world[JOINTS[joint]] * self.inverse_binds[joint]).transform_point3(*p) * weight
            };
            bindings.iter().map(of).sum()
        };
        self.positions.iter().zip(&self.bindings).map(moved).collect()
    }
}

/// Accessors with one buffer view each.
#[derive(Default)]
struct Parts {
    bytes: Vec<u8>,
    views: Vec<serde_json::Value>,
    accessors: Vec<serde_json::Value>,
}

impl Parts {
    fn add(&mut self, bytes: impl IntoIterator<Item = u8>, component: u32, kind: &str, count: usize) {
        let start = self.bytes.len();
        self.bytes.extend(bytes);
        self.views.push(json!({"buffer": 0, "byteOffset": start, "byteLength": self.bytes.len() - start}));
        self.accessors.push(json!({"bufferView": self.views.len() - 1, "componentType": component, "count": count,
            "type": kind}));
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
    }
}

#[test]
fn a_tree_of_rotated_and_scaled_nodes_poses_as_the_standard_says() {
    for seed in 0..5 {
        let rig = TreeRig::new(seed);
        let model = read_bytes(&rig.glb).unwrap();
        assert_eq!(model.joint_names, ["wrist", "thumb", "finger", "fingertip"]);
        assert_eq!(model.parents, [None, Some(0), Some(0), Some(2)]);
        let random = &mut ChaCha8Rng::seed_from_u64(100 + seed);
        let mut worst: f64 = 0.0;
        for _ in 0..10 {
            let rotations: Vec<DVec3> = JOINTS.iter().map(|_| vector(random) * 2.0).collect();
            let mut pose = Pose::rest(JOINTS.len());
            for (node, rotation) in JOINTS.iter().zip(&rotations) {
                pose.rotations[model.joint_index(NAMES[*node]).unwrap()] = rig.in_model(*rotation);
            }
            let posed = pose_hand(&model, &[], &pose).unwrap().vertices;
            for (ours, standard) in posed.iter().zip(rig.skinned(&rotations)) {
                let distance = (*ours + rig.origin()).distance(standard);
                // The file's bind matrices and vertices are f32.
                assert!(distance < 1e-6, "{distance}");
                worst = worst.max(distance);
            }
        }
        println!("rig {seed}: worst distance {worst:.1e}");
    }
}

#[test]
fn rotations_are_about_the_axes_of_the_world() {
    // The wrist's rotation moves everything rigidly: about its rest position, in the world's axes.
    let rig = TreeRig::new(9);
    let model = read_bytes(&rig.glb).unwrap();
    let turn = DVec3::new(0.3, -1.1, 0.4);
    let standard = rig.skinned(&[DVec3::ZERO, turn, DVec3::ZERO, DVec3::ZERO]);
    let centre = model.joints[0];
    let turn = rotation_from_axis_angle(rig.in_model(turn));
    for (p, standard) in rig.positions.iter().zip(standard) {
        let rest = rig.world_from_mesh.transform_vector3(*p);
        let turned = turn * (rest - centre) + centre;
        assert!((turned + rig.origin()).distance(standard) < 1e-6);
    }
}

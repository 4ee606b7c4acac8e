use std::collections::BTreeMap;
use std::sync::OnceLock;

use ghand_core::Pose;
use ghand_core::posing::pose_hand;
use glam::{DVec2, DVec3};

use super::*;

/// Hands of several proportions, built once.
fn hands() -> &'static [HandModel] {
    static HANDS: OnceLock<Vec<HandModel>> = OnceLock::new();
    HANDS.get_or_init(build_hands)
}

fn build_hands() -> Vec<HandModel> {
    let default = ProceduralHand::default;
    let broad = ProceduralHand {
        palm_width: 0.068,
        palm_thickness: 0.031,
        wrist_width: 0.062,
        finger_lengths: [0.080, 0.088, 0.082, 0.066],
        finger_widths: [0.0225, 0.0230, 0.0215, 0.0190],
        thumb_width: 0.025,
        ..default()
    };
    let slim = ProceduralHand { finger_lengths: [0.095, 0.106, 0.1, 0.082], palm_thickness: 0.023, ..default() };
    let child = ProceduralHand {
        palm_length: 0.055,
        palm_width: 0.039,
        palm_thickness: 0.018,
        wrist_width: 0.036,
        finger_lengths: [0.052, 0.058, 0.054, 0.044],
        finger_widths: [0.013, 0.0134, 0.0126, 0.011],
        thumb_length: 0.065,
        thumb_width: 0.0145,
        ..default()
    };
    let options = [
        default(),
        ProceduralHand { detail: 1, ..default() },
        child,
        ProceduralHand { left: true, detail: 1, ..default() },
        broad,
        slim,
        ProceduralHand { detail: 3, ..default() },
    ];
    options[..crate::cases(4, options.len())].iter().map(|hand| hand.build().unwrap()).collect()
}

#[test]
fn the_skin_is_one_closed_oriented_sphere() {
    for model in hands() {
        let mut directions: BTreeMap<(u32, u32), usize> = BTreeMap::new();
        for &[a, b, c] in &model.faces {
            for edge in [(a, b), (b, c), (c, a)] {
                *directions.entry(edge).or_default() += 1;
            }
        }
        for (&(a, b), &count) in &directions {
            assert_eq!((count, directions.get(&(b, a))), (1, Some(&1)), "edge {a}-{b}");
        }
        let (v, e, f) = (model.vertices.len(), directions.len() / 2, model.faces.len());
        assert_eq!(v + f - e, 2, "Euler characteristic");
    }
}

#[test]
fn the_skin_encloses_the_volume_of_a_hand() {
    let volume = |model: &HandModel| -> f64 {
        let p = |i: u32| model.vertices[i as usize];
        model.faces.iter().map(|&[a, b, c]| p(a).dot(p(b).cross(p(c))) / 6.0).sum()
    };
    // An adult hand with 5 cm of forearm has about half a litre.
    let default = volume(&ProceduralHand::default().build().unwrap());
    assert!((4e-4..6e-4).contains(&default), "{default}");
    let left = volume(&ProceduralHand { left: true, ..Default::default() }.build().unwrap());
    assert!((default - left).abs() < 1e-12);
}

#[test]
fn triangles_are_well_shaped_and_face_outwards() {
    for model in hands() {
        let normals = model.vertex_normals(&model.vertices);
        let mut worst = f64::INFINITY;
        for face in &model.faces {
            let [a, b, c] = face.map(|i| model.vertices[i as usize]);
            let normal = (b - a).cross(c - a);
            // 1 for an equilateral triangle, 0 for a sliver.
            let edges = a.distance_squared(b) + b.distance_squared(c) + c.distance_squared(a);
            worst = worst.min(2.0 * 3f64.sqrt() * normal.length() / edges);
            let around: DVec3 = face.iter().map(|&i| normals[i as usize]).sum();
            assert!(normal.dot(around) > 0.0, "a folded triangle at {a}");
        }
        println!("{} vertices: worst triangle {worst:.2}", model.vertices.len());
        assert!(worst > 0.15, "{worst}");
    }
}

#[test]
fn default_hand_has_an_adults_size_and_the_documented_frame() {
    let model = ProceduralHand::default().build().unwrap();
    assert!(model.joints[0].length() < 1e-15);
    let top = model.vertices.iter().map(|v| -v.y).fold(0.0, f64::max);
    assert!((top - 0.190).abs() < 0.002, "{top}");
    assert!((3000..5500).contains(&model.vertices.len()), "{}", model.vertices.len());
    let joint = |name: &str| model.joints[model.joint_index(name).unwrap()];
    assert!(joint("index1").z < joint("middle1").z && joint("ring1").z < joint("pinky1").z);
    assert!(joint("thumb3").z < joint("index1").z - 0.02 && joint("thumb2").x < 0.0);
    assert_eq!(model.parents, PARENTS);
}

#[test]
fn every_joint_is_inside_the_skin() {
    let model = ProceduralHand::default().build().unwrap();
    for (name, joint) in model.joint_names.iter().zip(&model.joints) {
        // The solid angle of a closed surface is 4 pi from inside and 0 from outside (Van Oosterom and Strackee).
        let angle: f64 = model
            .faces
            .iter()
            .map(|face| {
                let [a, b, c] = face.map(|i| model.vertices[i as usize] - *joint);
                let (la, lb, lc) = (a.length(), b.length(), c.length());
                let bottom = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
                2.0 * a.dot(b.cross(c)).atan2(bottom)
            })
            .sum();
        assert!((angle / (4.0 * std::f64::consts::PI) - 1.0).abs() < 1e-9, "{name}");
    }
}

#[test]
fn at_most_four_joints_move_a_vertex_and_neighbouring_fingers_do_not() {
    let model = ProceduralHand::default().build().unwrap();
    for (i, v) in model.vertices.iter().enumerate() {
        let row = model.vertex_weights(i);
        assert!(row.iter().filter(|w| **w > 0.0).count() <= 4);
        // Beyond the webs (the second joints and on) a vertex belongs to one finger alone.
        for (second, third) in [(2, 3), (5, 6), (8, 9), (11, 12), (14, 15)] {
            if row[second] + row[third] > 0.9 {
                let others: f64 = (1..16).filter(|k| !(second - 1..=third).contains(k)).map(|k| row[k]).sum();
                // A small remainder is allowed just beyond the webs.
                assert!(others < 0.005, "vertex {i} at {v} of joint {second}: {row:?}");
            }
        }
    }
}

#[test]
fn weights_change_gradually_along_the_skin() {
    let model = ProceduralHand::default().build().unwrap();
    for &[a, b, _] in &model.faces {
        let (p, q) = (model.vertex_weights(a as usize), model.vertex_weights(b as usize));
        // A joint's weight rises over about a finger's width, four to six edges, steepest (1.5 times) in the middle.
        assert!(p.iter().zip(q).all(|(p, q)| (p - q).abs() < 0.4), "{p:?} {q:?}");
    }
}

#[test]
fn a_finger_bent_by_a_right_angle_keeps_its_thickness_and_points_to_the_palm() {
    let model = ProceduralHand::default().build().unwrap();
    let mut pose = Pose::rest(16);
    pose.rotations[model.joint_index("middle2").unwrap()] = DVec3::NEG_Z * std::f64::consts::FRAC_PI_2;
    let bent = pose_hand(&model, &[], &pose).unwrap().vertices;
    let volume = |positions: &[DVec3]| -> f64 {
        let p = |i: u32| positions[i as usize];
        model.faces.iter().map(|&[a, b, c]| p(a).dot(p(b).cross(p(c))) / 6.0).sum()
    };
    let loss = volume(&model.vertices) - volume(&bent);
    // The cross-section there is about 3 cm^2: less than one millimetre of the finger's length is lost.
    assert!(loss.abs() < 0.3e-6, "{loss}");
    // The tip moved towards the palm.
    let tip = (0..bent.len()).min_by(|&a, &b| model.vertices[a].y.total_cmp(&model.vertices[b].y)).unwrap();
    assert!(bent[tip].x < -0.03);
}

#[test]
fn both_uv_pieces_keep_their_orientation_and_stay_in_the_square() {
    for model in hands() {
        let sign = if model.side == Side::Right { -1.0 } else { 1.0 };
        for t in &model.face_uvs {
            let [a, b, c] = t.map(|i| model.uvs[i as usize]);
            assert!(sign * (b - a).perp_dot(c - a) > 0.0);
        }
        assert!(model.uvs.iter().all(|uv| uv.cmpge(DVec2::splat(0.005)).all() && uv.cmple(DVec2::splat(0.995)).all()));
    }
}

#[test]
fn the_same_lengths_give_the_same_bits() {
    let hand = ProceduralHand::default();
    assert_eq!(hand.make().unwrap(), hand.make().unwrap());
    assert_eq!(hand.build().unwrap(), hand.build().unwrap());
}

#[test]
fn the_left_hand_is_the_mirror_image_of_the_right() {
    let right = ProceduralHand::default().build().unwrap();
    let left = ProceduralHand { left: true, ..Default::default() }.build().unwrap();
    assert_eq!((left.side, &left.weights, &left.uvs), (Side::Left, &right.weights, &right.uvs));
    let pairs = right.vertices.iter().zip(&left.vertices).chain(right.joints.iter().zip(&left.joints));
    for (r, l) in pairs {
        assert_eq!(*l, DVec3::new(-r.x, r.y, r.z));
    }
}

#[test]
fn unusable_lengths_are_named() {
    let default = ProceduralHand::default;
    let cases = [
        (ProceduralHand { palm_length: f64::NAN, ..default() }, "palm_length"),
        (ProceduralHand { palm_width: -0.06, ..default() }, "palm_width"),
        (ProceduralHand { palm_width: 61.0, ..default() }, "metres"),
        (ProceduralHand { thumb_length: 0.01, ..default() }, "thumb_length"),
        (ProceduralHand { finger_widths: [0.02, 0.05, 0.02, 0.02], ..default() }, "finger_widths"),
        (ProceduralHand { finger_lengths: [0.0; 4], ..default() }, "finger_lengths"),
        (ProceduralHand { detail: 0, ..default() }, "detail"),
        (ProceduralHand { detail: 7, ..default() }, "detail"),
    ];
    for (hand, field) in cases {
        let message = hand.build().unwrap_err().to_string();
        assert!(message.contains(field), "wanted {field}, got {message}");
    }
}

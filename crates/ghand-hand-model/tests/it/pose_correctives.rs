//! Pose correctives fitted to rigs that have none.

use ghand_core::posing::pose_hand;
use ghand_core::{HandModel, Pose};
use ghand_hand_model::files::gltf::read_gltf;
use ghand_hand_model::joints::names::{Finger, finger_joints};
use ghand_hand_model::named_poses::{POSE_NAMES, named_pose};
use ghand_hand_model::pose_correctives::{fit_pose_directions, with_turned_skin};
use ghand_test_support::procedural_hand::ProceduralHand;
use ghand_test_support::shared;
use glam::DVec3;

/// Rigs without correctives and with fitted ones.
fn hands() -> Vec<[HandModel; 2]> {
    let mut plain = vec![HandModel { pose_directions: vec![], ..ProceduralHand::default().build().unwrap() }];
    for file in ["assets/human-hand/right.glb", "assets/human-hand/left.glb", "assets/generic-hand/right.glb"] {
        plain.extend(shared(file).map(|path| read_gltf(&path, None).unwrap().model));
    }
    let fitted =
        |model: &HandModel| HandModel { pose_directions: fit_pose_directions(model).unwrap(), ..model.clone() };
    plain.into_iter().map(|model| [fitted(&model), model]).map(|[fitted, model]| [model, fitted]).collect()
}

fn volume(model: &HandModel, pose: &Pose) -> f64 {
    let posed = pose_hand(model, &[], pose).unwrap().vertices;
    let p = |i: u32| posed[i as usize];
    model.faces.iter().map(|&[a, b, c]| p(a).dot(p(b).cross(p(c))) / 6.0).sum()
}

/// Triangles that face against the skin around them.
fn inverted(model: &HandModel, pose: &Pose) -> usize {
    let posed = pose_hand(model, &[], pose).unwrap().vertices;
    let normals = model.vertex_normals(&posed);
    let is_inverted = |face: &&[u32; 3]| {
        let [a, b, c] = face.map(|i| posed[i as usize]);
        (b - a).cross(c - a).dot(face.iter().map(|&i| normals[i as usize]).sum()) <= 0.0
    };
    model.faces.iter().filter(is_inverted).count()
}

/// One joint bent by a right angle as in a fist.
fn bent(model: &HandModel, joint: usize) -> Pose {
    let fist = named_pose("fist", model).unwrap();
    let mut pose = Pose::rest(model.joint_count());
    pose.rotations[joint] = fist.rotations[joint].normalize() * std::f64::consts::FRAC_PI_2;
    pose
}

#[test]
fn bent_fingers_keep_their_volume() {
    for [plain, fitted] in hands() {
        let rest = volume(&plain, &Pose::rest(plain.joint_count()));
        println!("{}: {:.0} cm^3", plain.name, rest * 1e6);
        for finger in Finger::ALL {
            for (k, joint) in finger_joints(finger, &plain).unwrap().into_iter().enumerate() {
                let pose = bent(&plain, joint);
                let [before, after] = [&plain, &fitted].map(|model| (rest - volume(model, &pose)) * 1e6);
                println!(
                    "  {}: {before:.2} cm^3 lost by blending, {after:.2} with correctives",
                    plain.joint_names[joint]
                );
                if k > 0 && finger != Finger::Thumb {
                    assert!(after.abs() < 0.5 * before.abs(), "{}", plain.joint_names[joint]);
                }
            }
        }
    }
}

#[test]
fn no_more_triangles_turn_over_than_by_blending() {
    for [plain, fitted] in hands() {
        for name in POSE_NAMES {
            let pose = named_pose(name, &plain).unwrap();
            let [before, after] = [&plain, &fitted].map(|model| inverted(model, &pose));
            println!("{} {name}: {before} by blending, {after} with correctives", plain.name);
            assert!(after <= before + 2, "{} {name}: {after}, {before} by blending", plain.name);
        }
    }
}

#[test]
fn the_rest_pose_has_no_correctives_and_those_of_a_joint_stay_near_it() {
    for [plain, fitted] in hands() {
        let posed = pose_hand(&fitted, &[], &Pose::rest(plain.joint_count())).unwrap();
        assert_eq!(posed.corrected, plain.vertices);
        for (feature, directions) in fitted.pose_directions.chunks_exact(plain.vertices.len()).enumerate() {
            let at = plain.joints[1 + feature / 9];
            for (v, d) in plain.vertices.iter().zip(directions) {
                assert!(*d == DVec3::ZERO || v.distance(at) < 0.07, "{} at {v}", plain.joint_names[1 + feature / 9]);
                // At the folds of the knuckles up to 11.4 mm per entry of R - I.
                assert!(d.length() < 0.012, "{d}");
            }
        }
    }
}

/// How far from a finger's middle joint the skin stays that follows both of its bones, bent by a right angle: parts of the
/// distance at rest.
fn distance_kept(model: &HandModel, joints: [usize; 3]) -> f64 {
    let posed = pose_hand(model, &[], &bent(model, joints[1])).unwrap();
    let follows_both = |v: &usize| [joints[0], joints[1]].iter().all(|k| model.vertex_weights(*v)[*k] > 0.3);
    let skin: Vec<usize> = (0..model.vertices.len()).filter(follows_both).collect();
    let away = |vertices: &[DVec3], joint: DVec3| skin.iter().map(|v| vertices[*v].distance(joint)).sum::<f64>();
    away(&posed.vertices, posed.joints[joints[1]]) / away(&model.vertices, model.joints[joints[1]])
}

#[test]
fn straight_hands_of_known_joints_without_correctives_get_turned_skin() {
    for [plain, fitted] in hands() {
        let turned = with_turned_skin(&plain);
        let joints = finger_joints(Finger::Index, &plain).unwrap();
        let [blended, turned] = [&plain, &turned].map(|model| distance_kept(model, joints));
        println!("{}: {blended:.3} of the distance kept by blending, {turned:.3} by turning", plain.name);
        assert!((1.0 - turned).abs() < 0.6 * (1.0 - blended), "{}", plain.name);

        assert_eq!(with_turned_skin(&fitted), fitted);
        let names = (0..plain.joint_count()).map(|k| format!("bone{k}")).collect();
        let renamed = HandModel { joint_names: names, ..plain.clone() };
        assert_eq!(with_turned_skin(&renamed), renamed);
        let fist = pose_hand(&plain, &[], &named_pose("fist", &plain).unwrap()).unwrap();
        let closed = HandModel { vertices: fist.vertices, joints: fist.joints, ..plain };
        assert_eq!(with_turned_skin(&closed), closed, "at rest a fist");
    }
}

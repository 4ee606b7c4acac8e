//! What a file means: names of arrays, degrees, sides, axes.

use ghand_core::skeleton::pose_skeleton;

use super::hands::webxr;
use super::*;

fn warned(sequence: &PoseSequence, text: &str) -> bool {
    sequence.warnings.iter().any(|w| w.contains(text))
}

fn refused(file: &Json, parts: &[&str]) {
    let error = read(file, right()).expect_err(&file.to_string()[..80]).to_string();
    assert!(parts.iter().all(|part| error.contains(part)), "{error}");
}

#[test]
fn arrays_named_for_something_else_are_no_hands() {
    let numbers = |width: usize| vec![vec![0.1; width]; 4];
    for name in
        ["body_pose", "pose_body", "shape_params", "expression", "jaw_pose", "bodyPose", "leye_pose", "smpl_joints"]
    {
        for width in [45, 48, 63] {
            for file in [json!({name: numbers(width)}), json!({name: numbers(width), "fps": 30, "trans": numbers(3)})] {
                let error = read(&file, right()).unwrap_err().to_string();
                assert!(error.contains(name) || error.contains("a body without hands"), "{name}: {error}");
            }
        }
    }
    // A pose of 63 numbers is a body's.
    refused(&json!({"poses": numbers(63), "betas": vec![0.0; 10]}), &["poses"]);
    // Beside them, the hand is found by its name.
    let file = json!({"body_pose": numbers(63), "my_hand_pose": numbers(45), "expression": numbers(45)});
    assert_eq!(read(&file, right()).unwrap().frames.len(), 4);
    // Two unknown names say nothing, one alone is read.
    refused(&json!({"a": numbers(45), "b": numbers(45)}), &["\"a\"", "\"b\""]);
    refused(&json!({"arr_0": numbers(45), "arr_1": numbers(7)}), &["arr_0"]);
    assert_eq!(read(&json!({"arr_0": numbers(45), "fps": 30}), right()).unwrap().frames.len(), 4);
}

#[test]
fn degrees_and_other_units_are_named() {
    let degrees: Vec<Vec<f64>> = (0..4).map(|k| (0..48).map(|j| f64::from(10 + k + j % 5)).collect()).collect();
    refused(&json!({"poses": degrees}), &["degrees", "radians"]);
    refused(&json!(degrees), &["degrees"]);
    let frame = |row: &Vec<f64>| json!({"global_orient": row[..3], "hand_pose": row[3..]});
    refused(&json!(degrees.iter().map(frame).collect::<Vec<_>>()), &["degrees"]);
    refused(&json!({"frames": [{"pose": degrees[0].chunks(3).collect::<Vec<_>>()}]}), &["degrees"]);
    let ik = HandIk::new(&RestSkeleton::of(right()).unwrap());
    let points = ik.landmarks(&named_pose("point", right()).unwrap());
    for (factor, unit) in [(1000.0, "millimetres"), (100.0, "centimetres"), (10.0, "decimetres")] {
        let scaled: Vec<[f64; 3]> = points.iter().map(|p| (*p * factor).to_array()).collect();
        let error = read(&json!({"xyz": [scaled]}), right()).unwrap_err().to_string();
        assert!(error.contains("give metres") && error.contains(unit), "{error}");
    }
}

#[test]
fn landmarks_are_read_in_the_order_in_which_they_are_a_hand() {
    let ik = HandIk::new(&RestSkeleton::of(right()).unwrap());
    let points = ik.landmarks(&named_pose("victory", right()).unwrap()).map(|p| p.to_array());
    let expected = read(&json!({"joints": [points]}), right()).unwrap();
    let inter_hand = [4, 3, 2, 1, 8, 7, 6, 5, 12, 11, 10, 9, 16, 15, 14, 13, 20, 19, 18, 17, 0];
    let mano = [0, 5, 6, 7, 9, 10, 11, 17, 18, 19, 13, 14, 15, 1, 2, 3, 4, 8, 12, 16, 20];
    for (order, name) in [(inter_hand, "InterHand2.6M"), (mano, "MANO")] {
        let found = read(&json!({"joints": [order.map(|k| points[k])]}), right()).unwrap();
        assert!(warned(&found, name), "{:?}", found.warnings);
        assert!(difference(&found.frames[0].pose, &expected.frames[0].pose) < 1e-6);
    }
    let shuffled = [3, 7, 11, 0, 4, 8, 1, 5, 9, 2, 6, 10, 12, 20, 13, 19, 14, 18, 15, 17, 16];
    refused(&json!({"joints": [shuffled.map(|k| points[k])]}), &["proportions"]);
    // Positions of MANO's sixteen joints are not rotations.
    refused(&json!({"joints": [points[..16].to_vec()]}), &["joints"]);
}

#[test]
fn left_hands_are_equal_whatever_the_keys_are_called() {
    let left = procedural(Side::Left);
    let numbers: Vec<f64> = (0..45).map(|k| if k % 3 == 2 { -0.3 } else { 0.05 }).collect();
    let orient = [0.4, 0.9, -0.3];
    let full: Vec<f64> = orient.iter().chain(&numbers).copied().collect();
    let hand = |side: Json| {
        let mut hand = json!({"global_orient": orient, "hand_pose": numbers});
        side.as_object().unwrap().iter().for_each(|(name, value)| hand[name] = value.clone());
        hand
    };
    let own = [
        json!([hand(json!({"side": "left"}))]),
        json!([hand(json!({"handedness": "Left"}))]),
        json!({"left": [hand(json!({}))]}),
        json!({"left": hand(json!({}))}),
        json!([{"left": hand(json!({}))}]),
        json!({"poses": [full], "side": "left"}),
        json!([hand(json!({"is_right": 0, "mirrored": false}))]),
    ];
    let expected = read(&own[0], left).unwrap();
    for file in &own {
        let found = read(file, left).unwrap();
        assert!(difference(&found.frames[0].pose, &expected.frames[0].pose) < 1e-9, "{file}");
        assert!(file.to_string().contains("mirrored") || warned(&found, "--mirrored"), "{:?}", found.warnings);
    }
    let mirrored = PoseOptions { mirrored: Some(true), ..Default::default() };
    let flags = [
        json!([hand(json!({"is_right": 0}))]),
        json!({"poses": [full], "is_right": 0}),
        json!([hand(json!({"side": "left", "mirrored": true}))]),
    ];
    let by_option = read_with(&own[0], left, &mirrored).unwrap();
    assert!(difference(&by_option.frames[0].pose, &expected.frames[0].pose) > 0.1);
    for file in &flags {
        let found = read(file, left).unwrap();
        assert!(difference(&found.frames[0].pose, &by_option.frames[0].pose) < 1e-9, "{file}");
    }
    assert!(warned(&read(&flags[0], left).unwrap(), "--mirrored no"));
    // One that is wrong shows in the fingers.
    let back: Vec<f64> = numbers.iter().map(|value| -value).collect();
    assert!(warned(&read(&json!({"poses": [back], "side": "left"}), left).unwrap(), "backwards"));
    assert!(!warned(&expected, "backwards"));
}

#[test]
fn the_side_of_landmarks_follows_from_the_bend_of_the_fingers() {
    let points = |side: Side, pose: &str| {
        let model = procedural(side);
        let ik = HandIk::new(&RestSkeleton::of(model).unwrap());
        ik.landmarks(&named_pose(pose, model).unwrap()).map(|p| p.to_array())
    };
    for pose in ["fist", "point", "thumbs-up"] {
        for (side, said) in [(Side::Left, "Right"), (Side::Right, "Left")] {
            let file = json!({"handedness": said, "world_landmarks": [points(side, pose)]});
            let found = read(&file, procedural(side)).unwrap();
            assert!(warned(&found, "bend as a"), "{pose}: {:?}", found.warnings);
            assert!(!warned(&found, "mirrored"), "{pose}: {:?}", found.warnings);
            let insisting =
                PoseOptions { side: Some(if said == "Left" { Side::Left } else { Side::Right }), ..Default::default() };
            assert!(warned(&read_with(&file, procedural(side), &insisting).unwrap(), "as --side says"));
        }
    }
    // A flat hand tells nothing.
    let flat = read(&json!({"handedness": "Left", "world_landmarks": [points(Side::Right, "rest")]}), right()).unwrap();
    assert!(warned(&flat, "mirrored"), "{:?}", flat.warnings);
}

/// The joints of a pose of the WebXR hand, in XR's world: positions and quaternions.
fn xr(pose: &str, side: Side) -> Vec<(String, DVec3, DQuat)> {
    let model = webxr(side);
    let rig = RestSkeleton::of(&model).unwrap();
    let hand = procedural(side);
    let way = Retarget::new(&RestSkeleton::of(hand).unwrap(), &rig);
    let pose = way.pose(&named_pose(pose, hand).unwrap());
    let chain = pose_skeleton(&rig.parents, &rig.joints, &pose.rotations);
    let flip = DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0));
    let joint = |k: usize| {
        let turn = flip * chain.world[k].linear * rig.frames[k];
        let at = flip * chain.world[k].translation;
        (rig.joint_names[k].clone(), at, DQuat::from_mat3(&turn))
    };
    (0..25).map(joint).collect()
}

fn xr_file(joints: &[(String, DVec3, DQuat)], side: &str, f: &dyn Fn(DVec3, DQuat) -> Json) -> Json {
    let map: serde_json::Map<String, Json> =
        joints.iter().map(|(name, at, turn)| (name.clone(), f(*at, *turn))).collect();
    json!({"handedness": side, "joints": map})
}

/// Largest distance of a joint from where it was seen, metres.
fn xr_error(found: &PoseSequence, model: &HandModel, joints: &[(String, DVec3, DQuat)]) -> f64 {
    let rig = RestSkeleton::of(model).unwrap();
    let pose = &found.frames[0].pose;
    let chain = pose_skeleton(&rig.parents, &rig.joints, &pose.rotations);
    let flip = DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0));
    let place = |k: usize| chain.world[k].translation + pose.translation;
    (0..25).map(|k| place(k).distance(flip * joints[k].1)).fold(0.0, f64::max)
}

#[test]
fn joints_with_other_axes_are_fitted_to_their_positions() {
    let placed = |at: DVec3, turn: DQuat| json!({"position": at.to_array(), "orientation": turn.to_array()});
    for (side, name) in [(Side::Right, "right"), (Side::Left, "left")] {
        let model = webxr(side);
        for pose in ["fist", "point"] {
            let joints = xr(pose, side);
            let good = read(&xr_file(&joints, name, &placed), &model).unwrap();
            assert!(!warned(&good, "positions"), "{:?}", good.warnings);
            let turned = |by: DQuat| xr_file(&joints, name, &|at, turn| placed(at, turn * by));
            let cases = [
                ("x along the bones", turned(DQuat::from_rotation_y(std::f64::consts::FRAC_PI_2))),
                ("palm up", turned(DQuat::from_rotation_z(std::f64::consts::PI))),
                (
                    "w first",
                    xr_file(
                        &joints,
                        name,
                        &|at, q| json!({"position": at.to_array(), "orientation": [q.w, q.x, q.y, q.z]}),
                    ),
                ),
                (
                    "zeros",
                    xr_file(&joints, name, &|at, _| json!({"position": at.to_array(), "orientation": [0, 0, 0, 0]})),
                ),
                ("positions alone", xr_file(&joints, name, &|at, _| json!({"position": at.to_array()}))),
                ("points", xr_file(&joints, name, &|at, _| json!({"x": at.x, "y": at.y, "z": at.z}))),
                (
                    "identities",
                    xr_file(
                        &joints,
                        name,
                        &|at, _| json!({"matrix": glam::DMat4::from_translation(at).to_cols_array()}),
                    ),
                ),
            ];
            for (case, file) in &cases {
                let found = read(file, &model).unwrap_or_else(|error| panic!("{case}: {error}"));
                assert!(warned(&found, "fitted to their positions"), "{case}: {:?}", found.warnings);
                let off = xr_error(&found, &model, &joints);
                assert!(off < 0.008, "{case}, {pose}, {name}: {off}");
            }
            // A left-handed world, as Unity's.
            let unity = xr_file(
                &joints,
                name,
                &|at, q| json!({"position": [at.x, at.y, -at.z], "orientation": [-q.x, -q.y, q.z, q.w]}),
            );
            let found = read(&unity, &model).unwrap();
            assert!(warned(&found, "left-handed world"), "{:?}", found.warnings);
            assert!(xr_error(&found, &model, &joints) < 0.008);
            // Rows instead of columns need no positions.
            let by_rows = xr_file(
                &joints,
                name,
                &|at, turn| json!({"transform": {"matrix": glam::DMat4::from_rotation_translation(turn, at).transpose().to_cols_array()}}),
            );
            let found = read(&by_rows, &model).unwrap();
            assert!(difference(&found.frames[0].pose, &good.frames[0].pose) < 1e-6);
            let centimetres = xr_file(&joints, name, &|at, turn| placed(at * 100.0, turn));
            let error = read(&centimetres, &model).unwrap_err().to_string();
            assert!(error.contains("centimetres"), "{error}");
        }
    }
}

#[test]
fn positions_of_xr_joints_are_no_rotations() {
    let joints = xr("point", Side::Right);
    let positions: Vec<[f64; 3]> = joints.iter().map(|(_, at, _)| at.to_array()).collect();
    let model = webxr(Side::Right);
    for file in [
        json!({"positions": [positions]}),
        json!({"joints": [positions]}),
        json!({"keypoints_3d": [positions], "fps": 30}),
        json!([positions]),
    ] {
        let found = read(&file, &model).unwrap();
        assert!(warned(&found, "fitted to their positions"), "{:?}", found.warnings);
        assert!(xr_error(&found, &model, &joints) < 0.008);
    }
}

#[test]
fn misspelt_fields_of_own_files_are_named() {
    let pose = rows(&Pose::rest(right().joint_count()));
    refused(&json!({"fp": 60, "frames": [{"pose": pose}]}), &["fp", "fps"]);
    refused(&json!({"frames": [{"pose": pose, "trans": [0, 0, 0]}]}), &["trans", "translation"]);
    refused(&json!([{"pose": pose}, {"pose": pose, "shap": []}]), &["shap"]);
    assert!(
        read(&json!({"fps": 60, "side": "right", "frames": [{"id": "a", "time": 0.0, "pose": pose}]}), right()).is_ok()
    );
}

#[test]
fn options_that_a_file_has_no_use_for_are_told() {
    let points = HandIk::new(&RestSkeleton::of(right()).unwrap()).landmarks(&named_pose("point", right()).unwrap());
    let landmarks = json!({"side": "right", "fps": 30, "xyz": [points.map(|p| p.to_array())]});
    let rotations = json!({"poses": [vec![0.1; 48]], "side": "right", "fps": 30});
    let take = PoseOptions { take: Some("0".into()), ..Default::default() };
    let flat = PoseOptions { flat_mean: true, ..Default::default() };
    let mirrored = PoseOptions { mirrored: Some(true), ..Default::default() };
    for (file, options, said) in [
        (&landmarks, &take, Some("--take is not used")),
        (&landmarks, &flat, Some("--flat-mean is not used")),
        (&landmarks, &mirrored, Some("--mirrored is not used")),
        (&rotations, &take, Some("--take is not used")),
        (&rotations, &mirrored, Some("--mirrored is not used")),
        (&rotations, &flat, None),
    ] {
        let found = read_with(file, right(), options).unwrap();
        assert_eq!(
            found.warnings.iter().find(|w| w.contains("is not used")).map(|w| w.contains(said.unwrap_or(""))),
            said.map(|_| true),
            "{:?}",
            found.warnings
        );
    }
}

#[test]
fn a_hand_at_rest_may_be_turned_by_any_angle() {
    for angle in [3.5, 6.0] {
        let mut pose = vec![0.0; 48];
        pose[0] = angle;
        assert!(read(&json!({"poses": [pose], "side": "right", "fps": 30}), right()).is_ok(), "{angle}");
    }
}

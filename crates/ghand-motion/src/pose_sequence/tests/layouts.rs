//! Layouts of trackers and data sets with both hands, components, bodies, and those that are named and not read.

use ghand_core::PoseSpace;
use serde_json::{Value as Json, json};

use super::super::*;
use super::mano::mano;
use super::{assert_same, difference, poses, read, read_with, right, rows, without_filled};

/// Components of a made MANO model: slightly mixed axes, so that each joint depends on several.
fn with_components(side: Side) -> HandModel {
    let mut model = mano(side);
    let sign = if side == Side::Right { 1.0 } else { -1.0 };
    let entry = |c: usize, at: usize| if c == at { sign } else { 0.1 * ((7 * c + 3 * at) % 11) as f64 / 11.0 };
    let vector = |c: usize, joint: usize| DVec3::from_array([0, 1, 2].map(|axis| entry(c, 3 * joint + axis)));
    let components = (0..45).flat_map(|c| (0..15).map(move |joint| (c, joint))).map(|(c, joint)| vector(c, joint));
    let mean = model.pose_space.as_ref().unwrap().mean.clone();
    model.pose_space = Some(PoseSpace { mean, components: components.collect() });
    model
}

/// Components and the rotations that they are, with the mean or without.
fn components(model: &HandModel, count: usize, frames: usize, with_mean: bool) -> (Vec<Vec<f64>>, Vec<Vec<f64>>) {
    let space = model.pose_space.as_ref().unwrap();
    let number = |k: usize, c: usize| 0.2 * ((5 * k + 2 * c) % 7) as f64 - 0.5;
    let rows: Vec<Vec<f64>> = (0..frames).map(|k| (0..count).map(|c| number(k, c)).collect()).collect();
    let turned = |row: &Vec<f64>| -> Vec<f64> {
        let joint = |j: usize| {
            let sum: DVec3 = row.iter().enumerate().map(|(c, part)| *part * space.components[15 * c + j]).sum();
            sum + if with_mean { space.mean[j] } else { DVec3::ZERO }
        };
        (0..15).flat_map(|j| joint(j).to_array()).collect()
    };
    let rotations = rows.iter().map(turned).collect();
    (rows, rotations)
}

fn message(file: &Json, model: &HandModel) -> String {
    read(file, model).unwrap_err().to_string()
}

fn assert_equal(a: &PoseSequence, b: &PoseSequence) {
    assert_same(a, &b.frames.iter().map(|frame| frame.pose.clone()).collect::<Vec<_>>(), 1e-12);
}

#[test]
fn dyn_hamr_results_have_both_hands_and_left_ones_are_mirrored_with_their_place() {
    let model = mano(Side::Right);
    let poses = poses(&model, 6);
    let part = |of: &dyn Fn(&Pose) -> Json| {
        json!([poses[..3].iter().map(of).collect::<Vec<_>>(), poses[3..].iter().map(of).collect::<Vec<_>>()])
    };
    let results = json!({
        "trans": part(&|p| json!(p.translation.to_array())), "root_orient": part(&|p| json!(rows(p)[0])),
        "pose_body": part(&|p| json!(rows(p)[1..].concat())), "betas": [vec![0.1; 10], vec![0.2; 10]],
        "is_right": [[1, 1, 1], [0, 0, 0]], "world_scale": [[1.0]], "intrins": [600, 600, 320, 240],
    });
    let left: Vec<Pose> = poses[3..].iter().map(Pose::mirrored).collect();
    let mut by_joint = results.clone();
    by_joint["pose_body"] = part(&|p| json!(rows(p)[1..]));
    by_joint["is_right"] = json!([1, 0]);
    for file in [results.clone(), by_joint, json!({"world": results, "prior": {}})] {
        let sequence = read(&file, &model).unwrap();
        assert_same(&sequence, &poses[..3], 0.0);
        assert_eq!(sequence.frames[2].shape, [0.1; 10]);
        let sequence = read(&file, &mano(Side::Left)).unwrap();
        assert_same(&sequence, &left, 1e-12);
        assert_eq!(sequence.frames[0].shape, [0.2; 10]);
    }
    // A hand that changes its track.
    let mut changed = results.clone();
    changed["is_right"] = json!([[0, 0, 1], [1, 1, 0]]);
    assert_same(&read(&changed, &model).unwrap(), &[poses[3].clone(), poses[4].clone(), poses[2].clone()], 0.0);
    // A hand that is not seen in a frame, and a file that does not say which hands it has.
    let mut hidden = results.clone();
    hidden["vis_mask"] = json!([[1, 0, 1], [1, 1, 1]]);
    let sequence = without_filled(read(&hidden, &model).unwrap(), &["0001"]);
    assert_same(&sequence, &[poses[0].clone(), poses[2].clone()], 0.0);
    assert!(sequence.warnings[0].contains("1 of 3 frames is skipped"), "{:?}", sequence.warnings);
    hidden.as_object_mut().unwrap().remove("is_right");
    assert!(message(&hidden, &model).contains("is_right: is missing"));
    let mut short = results;
    short["trans"] = json!([[[0, 0, 0]]]);
    assert!(message(&short, &model).contains("trans: has 3 numbers, expected (2, 3, 3)"));
}

#[test]
fn bodies_without_hands_are_refused_by_name() {
    let body = |width: usize| json!([vec![vec![0.1; width]; 4]]);
    let root = || json!([vec![[0.1, 0.2, 0.3]; 4]]);
    for file in [
        json!({"trans": root(), "root_orient": root(), "pose_body": body(63), "betas": [vec![0.0; 16]]}),
        json!({"global_orient": vec![[0.0, 0.1, 0.2]; 4], "body_pose": vec![vec![0.1; 69]; 4], "transl": vec![[0.0; 3]; 4]}),
        json!({"smpl_params_global": {"body_pose": vec![vec![0.1; 63]; 4], "global_orient": vec![[0.0; 3]; 4]}}),
        json!({"poses": vec![vec![0.1; 72]; 4], "trans": vec![[0.0; 3]; 4]}),
        json!([{"body_pose": vec![[[1, 0, 0], [0, 1, 0], [0, 0, 1]]; 23]}]),
    ] {
        let error = message(&file, right());
        assert!(error.contains("body without hands") && error.contains("HaMeR"), "{error}");
    }
}

#[test]
fn hands_of_bodies_move_their_fingers_only_and_say_so() {
    let model = mano(Side::Right);
    let poses = poses(&model, 3);
    let fingers: Vec<Vec<f64>> = poses.iter().map(|p| rows(p)[1..].concat()).collect();
    let other = vec![vec![0.1; 45]; 3];
    let root = vec![[0.5, 0.6, 0.7]; 3];
    let expected: Vec<Pose> = poses
        .iter()
        .map(|p| {
            let mut p = Pose { translation: DVec3::ZERO, ..p.clone() };
            p.rotations[0] = DVec3::ZERO;
            p
        })
        .collect();
    let whole: Vec<Vec<f64>> = fingers.iter().map(|row| [vec![0.3; 120], row.clone()].concat()).collect();
    let frames: Vec<Json> =
        fingers.iter().map(|row| json!({"smplx_rhand_pose": row, "smplx_root_pose": root[0]})).collect();
    for file in [
        json!({"right_hand_pose": fingers, "left_hand_pose": other, "global_orient": root, "body_pose": vec![vec![0.1; 63]; 3]}),
        json!({"rhand_pose": fingers, "lhand_pose": other, "transl": root}),
        json!({"fullpose": whole, "right_hand_pose": vec![vec![0.1; 24]; 3], "transl": root}),
        json!({"frames": frames}),
    ] {
        let sequence = read(&file, &model).unwrap();
        assert_same(&sequence, &expected, 0.0);
        assert!(sequence.warnings.iter().any(|w| w.contains("only the fingers move")), "{file}");
    }
    // Without a root there is nothing to say.
    let alone = read(&json!({"right_hand_pose": fingers}), &model).unwrap().warnings;
    assert!(!alone.iter().any(|w| w.contains("only the fingers move")), "{alone:?}");
    // A hand's own name beside a body's root.
    let mixed = json!({"global_orient": root, "hand_pose": fingers, "body_pose": vec![vec![0.1; 63]; 3]});
    assert!(message(&mixed, &model).contains("the root is not the wrist's"));
}

#[test]
fn grab_is_read_from_full_poses_and_from_components_with_the_model() {
    let model = with_components(Side::Right);
    let (parts, turned) = components(&model, 24, 3, false);
    let root = vec![[0.1, 0.2, 0.3]; 3];
    let place = vec![[0.4, 0.5, 0.6]; 3];
    let params = |with: &[(&str, Json)]| {
        let mut params = json!({"global_orient": root, "transl": place});
        with.iter().for_each(|(name, value)| params[*name] = value.clone());
        json!({"params": params, "vtemp": "a.ply"})
    };
    let full = params(&[("hand_pose", json!(vec![vec![9.0; 24]; 3])), ("fullpose", json!(turned))]);
    let few = params(&[("hand_pose", json!(parts))]);
    let still = params(&[("fullpose", json!(vec![vec![0.0; 45]; 3]))]);
    let file = |hand: &Json| json!({"gender": "male", "n_comps": 24, "framerate": 120.0, "rhand": hand, "lhand": still, "body": few});
    let plain = json!({"global_orient": root, "hand_pose": turned, "transl": place, "is_right": 1});
    let expected = read(&plain, &model).unwrap();
    for hand in [&full, &few] {
        let sequence = read(&file(hand), &model).unwrap();
        assert_equal(&sequence, &expected);
        assert_eq!(sequence.fps, 120.0);
    }
    // The left hand is its own, not a mirrored right one.
    let left = read(&file(&full), &mano(Side::Left)).unwrap();
    assert!(left.frames[0].pose.rotations[1..].iter().all(|r| *r == DVec3::ZERO) && left.warnings.is_empty());
    // A right hand without a meaning, beside a left one that has one.
    let sequence = read(&file(&few), &mano(Side::Right)).unwrap();
    assert!(sequence.warnings[0].contains("no right hand can be used"), "{:?}", sequence.warnings);
    assert!(sequence.warnings[0].contains("24 principal components"), "{:?}", sequence.warnings);
    // Without hands, the body's fingers.
    let whole: Vec<Vec<f64>> = turned.iter().map(|row| [vec![0.3; 120], row.clone()].concat()).collect();
    let body = read(&json!({"n_comps": 24, "body": params(&[("fullpose", json!(whole))])}), &model).unwrap();
    assert!(difference(&body.frames[0].pose, &expected.frames[0].pose) > 0.1, "the body's root is not the wrist's");
    assert!(body.frames[0].pose.rotations[1..] == expected.frames[0].pose.rotations[1..]);
    let error = message(&json!({"rhand": few}), &mano(Side::Right));
    assert!(error.contains("rhand.params.hand_pose has 24 principal components"), "{error}");
    assert!(error.contains("--pose-model MANO_RIGHT.pkl"), "{error}");
    // GRAB's arrays of a hand, as its authors' program writes them.
    let flat = json!({"global_orient": root, "hand_pose": vec![vec![9.0; 24]; 3], "transl": place, "fullpose": turned});
    assert_equal(&read(&flat, &model).unwrap(), &expected);
}

#[test]
fn components_are_turned_into_rotations_by_the_model_that_they_belong_to() {
    let model = with_components(Side::Right);
    let root = vec![[0.1, 0.2, 0.3]; 3];
    let expected = |count: usize, with_mean: bool| {
        let turned = components(&model, count, 3, with_mean).1;
        read(&json!({"global_orient": root, "hand_pose": turned, "is_right": 1}), &model).unwrap()
    };
    for count in [6, 12, 24, 45] {
        let (parts, _) = components(&model, count, 3, true);
        let with_root: Vec<Vec<f64>> = parts.iter().map(|row| [vec![0.1, 0.2, 0.3], row.clone()].concat()).collect();
        for file in [
            json!({"global_orient": root, "hand_pose": parts, "use_pca": true}),
            json!({"params": {"global_orient": root, "hand_pose": parts, "num_pca_comps": count, "use_pca": true}, "is_right": 1}),
            json!({"pose_pca": parts, "global_orient": root}),
            json!({"pose": with_root, "num_pca_comps": count, "use_pca": true}),
            json!({"frames": parts.iter().map(|row| json!({"hand_pose": row, "use_pca": true, "rot": root[0]})).collect::<Vec<_>>()}),
        ] {
            let sequence = read(&file, &model).unwrap_or_else(|error| panic!("{count}: {error}"));
            assert_equal(&sequence, &expected(count, true));
            let mut flat = file.clone();
            flat["flat_hand_mean"] = json!(true);
            assert_equal(&read(&flat, &model).unwrap(), &expected(count, false));
        }
        let error = message(&json!({"global_orient": root, "hand_pose": parts, "use_pca": true}), right());
        assert!(error.contains(&format!("{count} principal components")) && error.contains("--pose-model"), "{error}");
        // Another skeleton, with the model given beside.
        let options = PoseOptions { pose_model: Some(model.clone()), ..Default::default() };
        let file = json!({"right_hand_pose": parts, "use_pca": true});
        let turned = json!({"right_hand_pose": components(&model, count, 3, true).1});
        assert_equal(&read_with(&file, right(), &options).unwrap(), &read_with(&turned, right(), &options).unwrap());
    }
}

#[test]
fn dexycb_components_are_read_with_the_model_and_refused_without() {
    let model = with_components(Side::Right);
    let (parts, turned) = components(&model, 45, 3, true);
    let mut labels: Vec<Vec<f64>> =
        parts.iter().map(|row| [vec![0.1, 0.2, 0.3], row.clone(), vec![0.4, 0.5, 0.6]].concat()).collect();
    let plain =
        json!({"global_orient": vec![[0.1, 0.2, 0.3]; 3], "hand_pose": turned, "transl": vec![[0.4, 0.5, 0.6]; 3]});
    let expected = read(&plain, &model).unwrap();
    for file in [
        json!({"pose_m": labels, "mano_side": "right"}),
        json!({"pose_m": labels.iter().map(|row| [row]).collect::<Vec<_>>(), "pose_y": [0.0]}),
        json!(labels.iter().map(|row| json!({"pose_m": row})).collect::<Vec<_>>()),
    ] {
        assert_equal(&read(&file, &model).unwrap(), &expected);
        let error = message(&file, right());
        assert!(
            error.contains("\"pose_m\" contains principal components") && error.contains("--pose-model"),
            "{error}"
        );
    }
    labels[1] = vec![0.0; 51];
    let sequence = without_filled(read(&json!({"pose_m": labels}), &model).unwrap(), &["0001"]);
    assert!(sequence.frames.len() == 2 && sequence.warnings[0].contains("no hand"), "{:?}", sequence.warnings);
}

#[test]
fn components_that_may_mean_something_else_are_refused_with_the_cause() {
    let model = with_components(Side::Right);
    let root = |frames: usize| vec![[0.0; 3]; frames];
    let row = |width: usize, frames: usize| vec![vec![0.1; width]; frames];
    let cases = [
        (
            json!({"global_orient": root(15), "hand_pose": row(6, 15)}),
            "6 components of 15 frames or 6 numbers of 15 joints",
        ),
        (
            json!({"global_orient": root(3), "hand_pose": row(45, 3), "use_pca": true, "num_pca_comps": 6}),
            "correct one of them",
        ),
        (json!({"global_orient": root(3), "hand_pose": row(6, 3), "use_pca": false}), "has the shape [3, 6]"),
        (
            json!({"global_orient": root(3), "hand_pose": row(6, 3), "use_pca": true, "num_pca_comps": -6}),
            "says that it has 0 components",
        ),
        (json!({"pose": row(6, 3), "use_pca": true, "num_pca_comps": 1e30}), "6 numbers for 1000000 components"),
        (json!({"pose_pca": row(9, 3)}), "num_pca_comps"),
        (json!({"pose": row(20, 3), "num_pca_comps": 6, "use_pca": true}), "20 numbers for 6 components"),
        (json!({"left_hand_pose": row(6, 3)}), "whose components are others; give --pose-model MANO_LEFT.pkl"),
        (json!({"left": {"hand_pose": row(6, 3)}}), "whose components are others; give --pose-model MANO_LEFT.pkl"),
    ];
    for (file, cause) in cases {
        let error = message(&file, &model);
        assert!(error.contains(cause), "{file}: {error}");
    }
    let mut few = model.clone();
    few.pose_space.as_mut().unwrap().components.truncate(15 * 10);
    assert!(message(&json!({"right_hand_pose": row(12, 3)}), &few).contains("has 12 components, the model has 10"));
}

#[test]
fn settings_beside_the_hands_say_whether_numbers_are_components() {
    let model = with_components(Side::Right);
    let (parts, turned) = components(&model, 45, 3, true);
    let root = vec![[0.1, 0.2, 0.3]; 3];
    let hands = json!({"global_orient": root, "hand_pose": parts, "is_right": 1});
    let expected = read(&json!({"global_orient": root, "hand_pose": turned, "is_right": 1}), &model).unwrap();
    for file in [
        json!({"cfg": {"use_pca": true}, "params": hands}),
        json!({"settings": {"use_pca": "True", "num_pca_comps": 45}, "mano_params": hands}),
    ] {
        assert_equal(&read(&file, &model).unwrap(), &expected);
        assert!(message(&file, right()).contains("45 principal components"));
    }
    let rotations = json!({"cfg": {"use_pca": false}, "params": {"global_orient": root, "hand_pose": turned}});
    assert_equal(&read(&rotations, &model).unwrap(), &expected);
}

#[test]
fn parts_that_cannot_be_read_are_said_whether_the_rest_is_read_or_not() {
    let numbers = |shape: &[usize]| {
        let count = shape.iter().product::<usize>();
        Value::Numbers(ghand_files::npz::NumericArray { shape: shape.to_vec(), values: vec![0.1; count] })
    };
    let file = |unreadable: &str| {
        let part = |name: &str, shape: &[usize]| {
            let problem = "is a quantised tensor; save tensor.dequantize() instead";
            (name.to_owned(), if name == unreadable { Value::Unreadable(problem.into()) } else { numbers(shape) })
        };
        Value::Map(vec![part("global_orient", &[2, 3]), part("hand_pose", &[2, 45]), part("betas", &[2, 10])])
    };
    let read =
        |name: &str| poses_and_fit("a.pt", &file(name), right(), &PoseOptions::default()).map(|(sequence, _)| sequence);
    let sequence = read("betas").unwrap();
    assert!(sequence.warnings.iter().any(|w| w.contains("\"betas\" is a quantised tensor")), "{:?}", sequence.warnings);
    for name in ["global_orient", "hand_pose"] {
        let error = read(name).unwrap_err().to_string();
        assert!(error.contains("quantised tensor; save tensor.dequantize()"), "{error}");
    }
    let whole = read("nothing").unwrap().warnings;
    assert!(!whole.iter().any(|w| w.contains("quantised")), "{whole:?}");
}

#[test]
fn hands_of_sam_3d_body_are_read_as_landmarks() {
    let mut body = vec![[0.0; 3]; 70];
    let points = |sign: f64| -> Vec<[f64; 3]> {
        let finger = |f: usize, k: usize| [sign * (0.02 * f as f64 - 0.04), -0.05 - 0.025 * k as f64, 0.01 * f as f64];
        std::iter::once([0.0, 0.0, 0.0]).chain((0..5).flat_map(|f| (0..4).map(move |k| finger(f, k)))).collect()
    };
    // From the tip to the palm, the wrist last; first the right hand, then the left one.
    for (first, sign) in [(21, 1.0), (42, -1.0)] {
        let hand = points(sign);
        for finger in 0..5 {
            (0..4).for_each(|k| body[first + 4 * finger + k] = hand[1 + 4 * finger + 3 - k]);
        }
        body[first + 20] = hand[0];
    }
    let bodies = [
        json!({"pred_keypoints_3d": body, "pred_cam_t": [0.0, 0.0, 0.0], "hand_pose_params": vec![0.0; 108]}),
        json!({"pred_keypoints_3d": [body], "focal_length": 500.0}),
        json!([[{"pred_keypoints_3d": body}]]),
        json!({"frames": [{"outputs": [{"pred_keypoints_3d": body}]}]}),
        json!({"0001.jpg": [{"pred_keypoints_3d": body}]}),
    ];
    for side in [Side::Right, Side::Left] {
        let sign = if side == Side::Right { 1.0 } else { -1.0 };
        let options = PoseOptions { side: Some(side), ..Default::default() };
        let expected = read_with(&json!({"xyz": points(sign)}), right(), &options).unwrap();
        for file in &bodies {
            let found = read_with(file, right(), &options).unwrap();
            assert!(difference(&found.frames[0].pose, &expected.frames[0].pose) == 0.0, "{side:?}");
        }
    }
    let two = json!([[{"pred_keypoints_3d": body}, {"pred_keypoints_3d": body}]]);
    assert!(read(&two, right()).unwrap().warnings.iter().any(|w| w.contains("up to 2 bodies")));
    let parameters = message(&json!({"body_pose_params": vec![0.0; 133], "hand_pose_params": vec![0.0; 108]}), right());
    assert!(parameters.contains("MHR") && parameters.contains("pred_keypoints_3d"), "{parameters}");
}

#[test]
fn known_layouts_that_are_not_read_are_named_with_what_converts_them() {
    let cases = [
        (
            json!({"version": 1.3, "people": [{"pose_keypoints_2d": [1, 2, 0.5], "hand_right_keypoints_2d": vec![1.0; 63]}]}),
            "OpenPose",
            "--cameras",
        ),
        (json!([{"people": [{"hand_left_keypoints_2d": vec![1.0; 63]}]}]), "OpenPose", "--cameras"),
        (json!({"keypoints": vec![vec![[0.1, 0.2, 0.3]; 133]; 2]}), "COCO-WholeBody", "keypoints[112:133]"),
        (
            json!({"annotations": [{"righthand_kpts": vec![1.0; 63], "lefthand_kpts": vec![1.0; 63]}]}),
            "COCO-WholeBody",
            "keypoints[112:133]",
        ),
        (
            json!({"instance_info": [{"frame_id": 1, "instances": [{"keypoints": vec![[1.0, 2.0]; 133]}]}]}),
            "COCO-WholeBody",
            "image_landmarks",
        ),
        (
            json!([{"id": 7, "hands": [{"type": "right", "palmPosition": [1, 2, 3]}], "pointables": []}]),
            "Leap Motion",
            "world_landmarks",
        ),
        (json!({"version": 1.3, "people": []}), "OpenPose", "--cameras"),
        (json!([{"tracking_frame_id": 1, "hands": [{"digits": []}]}]), "Leap Motion", "world_landmarks"),
        (
            json!([{"timestamp_ns": 1, "hand_poses": {"1": {"wrist_xform": {"q_wxyz": [1, 0, 0, 0]}, "pose": vec![0.1; 15]}}}]),
            "HOT3D",
            "use_pca",
        ),
        (json!({"frames": [{"hands": [{"palm_position": [1, 2, 3]}]}]}), "Leap Motion", "metres"),
    ];
    for (file, what, remedy) in cases {
        let error = message(&file, right());
        assert!(error.contains(what) && error.contains(remedy), "{file}: {error}");
    }
}

use ghand_core::hand_model::PoseSpace;
use ghand_core::hand_model::named_poses::named_pose;
use ghand_core::skeleton::pose_skeleton;
use glam::DMat3;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde_json::{Value as Json, json};

use super::*;
use crate::test_hands::{generic, hands, larger, natural_pose, procedural};

fn read(value: &Json, model: &HandModel) -> Result<PoseSequence, PoseError> {
    read_with(value, model, &PoseOptions::default())
}

fn read_with(value: &Json, model: &HandModel, options: &PoseOptions) -> Result<PoseSequence, PoseError> {
    read_poses_bytes("poses.json", value.to_string().as_bytes(), model, options)
}

fn right() -> &'static HandModel {
    procedural(Side::Right)
}

/// A model of MANO's joints in MANO's axes with a mean pose, from made-up numbers: the built-in hand, turned.
fn mano(side: Side) -> HandModel {
    let mut model = procedural(side).clone();
    let sign = if side == Side::Right { 1.0 } else { -1.0 };
    let turn = |p: DVec3| DVec3::new(sign * p.y, sign * p.x, -p.z) + DVec3::new(0.1, 0.0, 0.0);
    model.joints.iter_mut().chain(&mut model.vertices).for_each(|p| *p = turn(*p));
    let mean = (0..15).map(|k| DVec3::new(0.1, -0.02 * f64::from(k), 0.3)).collect();
    model.pose_space = Some(PoseSpace { mean, components: vec![] });
    model
}

fn rows(pose: &Pose) -> Vec<[f64; 3]> {
    pose.rotations.iter().map(DVec3::to_array).collect()
}

/// Greatest difference of the rotations, as matrices, and of the translations; NaN if there is one.
fn difference(a: &Pose, b: &Pose) -> f64 {
    assert_eq!(a.rotations.len(), b.rotations.len());
    let entries = a
        .rotations
        .iter()
        .zip(&b.rotations)
        .flat_map(|(a, b)| (rotation_from_axis_angle(*a) - rotation_from_axis_angle(*b)).to_cols_array());
    let moved = (a.translation - b.translation).to_array();
    entries.chain(moved).map(f64::abs).fold(0.0, larger)
}

fn poses(model: &HandModel, count: usize) -> Vec<Pose> {
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    (0..count).map(|_| natural_pose(model, &mut rng)).collect()
}

fn assert_same(found: &PoseSequence, expected: &[Pose], tolerance: f64) {
    assert_eq!(found.frames.len(), expected.len());
    for (frame, pose) in found.frames.iter().zip(expected) {
        let off = difference(&frame.pose, pose);
        assert!(off <= tolerance, "frame {} is off by {off:.1e}", frame.id);
    }
}

#[test]
fn the_comparison_rejects_what_is_off_or_not_finite() {
    let pose = Pose::rest(16);
    let mut other = pose.clone();
    assert!(difference(&pose, &other) == 0.0);
    other.rotations[3].x = 1e-3;
    assert!(!(difference(&pose, &other) <= 1e-6));
    other.rotations[3].x = f64::NAN;
    assert!(!(difference(&pose, &other) <= 1e300));
}

#[test]
fn own_poses_are_read_written_and_read_again_bit_for_bit() {
    let poses = poses(right(), 3);
    let frames: Vec<Json> = poses
        .iter()
        .enumerate()
        .map(|(k, pose)| json!({"id": format!("f{k}"), "pose": rows(pose), "translation": pose.translation.to_array(), "shape": [0.5]}))
        .collect();
    let sequence = read(&json!({"fps": 12.5, "frames": frames}), right()).unwrap();
    assert_eq!((sequence.fps, sequence.frames[1].id.as_str(), &sequence.frames[2].shape), (12.5, "f1", &vec![0.5]));
    assert!(sequence.frames.iter().zip(&poses).all(|(frame, pose)| frame.pose == *pose));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("poses.json");
    ghand::write_poses(&path, &sequence).unwrap();
    assert_eq!(read_poses(&path, right(), &PoseOptions::default()).unwrap(), sequence);
    assert!(
        ghand::write_poses(&folder.path().join("no/poses.json"), &sequence)
            .unwrap_err()
            .to_string()
            .contains("no/poses.json")
    );
}

#[test]
fn rows_are_matched_by_name_and_a_missing_joint_is_named() {
    let pose = &poses(right(), 1)[0];
    let mut names: Vec<String> = right().joint_names.clone();
    let mut turned = rows(pose);
    names.reverse();
    turned.reverse();
    names.insert(0, "elbow".into());
    turned.insert(0, [9.0, 9.0, 9.0]);
    let file = json!({"hand_model": {"joints": names}, "frames": [{"pose": turned}]});
    assert_eq!(read(&file, right()).unwrap().frames[0].pose.rotations, pose.rotations);
    names[5] = "index9".into();
    let lacking = &right().joint_names[16 - 5];
    let file = json!({"hand_model": {"joints": names}, "frames": [{"pose": turned}]});
    let error = read(&file, right()).unwrap_err().to_string();
    assert!(error.contains(lacking.as_str()) && error.starts_with("poses.json: hand_model.joints"), "{error}");
}

#[test]
fn own_poses_that_are_wrong_are_errors_with_file_field_and_remedy() {
    let good = || vec![[0.0; 3]; 16];
    let frame = |pose: Json| json!({"frames": [{"id": "a", "pose": pose}]});
    let mut long = json!(good());
    long[3] = json!([0, 0]);
    let mut nan = json!(good());
    nan[4][1] = Json::Null;
    for (file, parts) in [
        (frame(json!(vec![[0.0; 3]; 5])), &["frames[\"a\"].pose", "5 rows", "expected 16"][..]),
        (frame(long), &["frames[\"a\"].pose", "row 3 has 2 numbers", "expected 3"]),
        (frame(nan), &["frames[\"a\"].pose", "row 4", "not finite"]),
        (frame(json!("text")), &["frames[\"a\"].pose", "is text"]),
        (json!({"frames": [{"id": "a"}]}), &["frames[\"a\"].pose", "missing"]),
        (json!({"frames": []}), &["frames", "there are none"]),
        (json!({"frames": 3}), &["frames", "must be a list"]),
        (json!({"fps": 0, "frames": [{"pose": good()}]}), &["fps", "is 0"]),
        (json!({"fps": "x", "frames": [{"pose": good()}]}), &["fps", "text"]),
        (
            json!({"frames": [{"id": "a", "pose": good()}, {"id": "a", "pose": good()}]}),
            &["frames", "\"a\" is there twice"],
        ),
        (
            json!({"frames": [{"id": "a", "pose": good(), "translation": [1, 2]}]}),
            &["frames[\"a\"].translation", "3 numbers"],
        ),
        (json!({"frames": [{"id": "a", "pose": good(), "shape": [1, null]}]}), &["frames[\"a\"].shape", "not finite"]),
        (json!({"format": "x", "frames": [{"pose": good()}]}), &["format", "ghand-capture"]),
        (json!({"format": "ghand-capture", "version": 2, "frames": [{"pose": good()}]}), &["version", "must be 1"]),
        (json!({"hello": 1}), &["content", "no kind of poses"]),
    ] {
        let error = read(&file, right()).unwrap_err().to_string();
        assert!(error.starts_with("poses.json: ") && parts.iter().all(|part| error.contains(part)), "{error}");
    }
    let error = read_poses(Path::new("absent.json"), right(), &PoseOptions::default()).unwrap_err().to_string();
    assert!(error.contains("absent.json"), "{error}");
}

#[test]
fn a_capture_of_another_rig_is_carried_over() {
    let Some(model) = generic(Side::Right) else { return };
    let capture = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/captures/blender-a");
    let own = Capture::open(&capture).unwrap();
    let sequence = read_poses(&capture, right(), &PoseOptions::default()).unwrap();
    let way = Retarget::new(&Rig::of(&own.hand_model).unwrap(), &Rig::of(right()).unwrap());
    let expected: Vec<Pose> = own.frames.iter().map(|frame| way.pose(&frame.pose)).collect();
    assert_same(&sequence, &expected, 1e-12);
    let direct = read_poses(&capture, &model, &PoseOptions::default());
    assert!(direct.is_ok_and(|direct| direct.frames[3].pose == own.frames[3].pose));
}

#[test]
fn interhand_poses_get_the_mean_and_skip_what_is_missing() {
    let model = mano(Side::Right);
    let poses = poses(&model, 4);
    let hand = |pose: &Pose| {
        let numbers: Vec<f64> = rows(pose).concat();
        json!({"pose": numbers, "shape": vec![0.1; 10], "trans": pose.translation.to_array()})
    };
    let mut broken = hand(&poses[2]);
    broken["pose"] = json!(vec![0.0; 45]);
    let file = json!({"0": {
        "100": {"right": hand(&poses[1]), "left": null},
        "9": {"right": hand(&poses[0]), "left": hand(&poses[3])},
        "101": {"right": broken, "left": null},
        "102": {"right": null, "left": hand(&poses[3])},
    }});
    let with_mean = |pose: &Pose| {
        let mut pose = pose.clone();
        let mean = &model.pose_space.as_ref().unwrap().mean;
        pose.rotations.iter_mut().skip(1).zip(mean).for_each(|(r, mean)| *r += *mean);
        pose
    };
    let sequence = read(&file, &model).unwrap();
    assert_eq!((sequence.fps, sequence.frames[0].id.as_str(), sequence.frames[0].shape.len()), (5.0, "9", 10));
    assert_same(&sequence, &[with_mean(&poses[0]), with_mean(&poses[1])], 0.0);
    assert!(
        sequence.warnings.len() == 1 && sequence.warnings[0].contains("1 of 3 frames is left out"),
        "{:?}",
        sequence.warnings
    );
    assert!(sequence.warnings[0].contains("45 numbers"));
    let flat = read_with(&file, &model, &PoseOptions { flat_mean: true, ..Default::default() }).unwrap();
    assert_same(&flat, &poses[..2], 0.0);
    // Left hands only when asked for; they are believed to be those of this model then.
    let left = read_with(&file, &mano(Side::Left), &PoseOptions { flat_mean: true, ..Default::default() }).unwrap();
    assert_eq!(left.frames.len(), 2);
    assert_same(&left, &[poses[3].clone(), poses[3].clone()], 0.0);
    let two = json!({"0": file["0"], "1": file["0"]});
    let error = read(&two, &model).unwrap_err().to_string();
    assert!(error.contains("--take") && error.contains("0, 1"), "{error}");
    assert!(read_with(&two, &model, &PoseOptions { take: Some("1".into()), ..Default::default() }).is_ok());
}

#[test]
fn hamer_estimates_are_read_however_they_are_stored_and_left_ones_are_mirrored() {
    let model = mano(Side::Right);
    let poses: Vec<Pose> = poses(&model, 2);
    let matrices = |rotations: &[DVec3]| -> Vec<[[f64; 3]; 3]> {
        rotations.iter().map(|r| rotation_from_axis_angle(*r).transpose().to_cols_array_2d()).collect()
    };
    let as_matrices = |pose: &Pose| json!({"global_orient": matrices(&pose.rotations[..1]), "hand_pose": matrices(&pose.rotations[1..])});
    let angles = |pose: &Pose| json!({"global_orient": rows(pose)[0], "hand_pose": rows(pose)[1..].concat(), "betas": vec![0.2; 10]});
    let place = |pose: &Pose| pose.translation.to_array();
    // Frames with hands, in the ways that users dump them.
    let list = json!([
        {"is_right": 1, "pred_mano_params": as_matrices(&poses[0]), "pred_cam_t_full": place(&poses[0])},
        {"is_right": 1, "pred_mano_params": as_matrices(&poses[1]), "pred_cam_t_full": place(&poses[1])},
    ]);
    let map = json!({
        "a.jpg": [{"is_right": true, "wilor_preds": angles(&poses[0]), "cam_t": place(&poses[0])}],
        "b.jpg": [{"is_right": true, "wilor_preds": angles(&poses[1]), "cam_t": place(&poses[1])}],
    });
    let batch = json!({
        "global_orient": poses.iter().map(|p| json!([rows(p)[0]])).collect::<Vec<_>>(),
        "hand_pose": poses.iter().map(|p| json!(rows(p)[1..])).collect::<Vec<_>>(),
        "transl": poses.iter().map(place).collect::<Vec<_>>(),
        "right": [1, 1],
    });
    for file in [&list, &map, &json!({"frames": list}), &batch] {
        assert_same(&read(file, &model).unwrap(), &poses, 1e-9);
    }
    // A left hand: parameters of the mirrored picture, the place as it is.
    let mut left = list.clone();
    for k in 0..2 {
        left[k]["is_right"] = json!(0);
    }
    let expected: Vec<Pose> =
        poses.iter().map(|p| Pose { rotations: mirrored(p).rotations, translation: p.translation }).collect();
    let sequence = read(&left, &mano(Side::Left)).unwrap();
    assert_same(&sequence, &expected, 1e-9);
    // On a right hand it is mirrored once more, with a word.
    let sequence = read(&left, &model).unwrap();
    let expected: Vec<Pose> = expected.iter().map(mirrored).collect();
    assert_same(&sequence, &expected, 1e-9);
    assert!(sequence.warnings.iter().any(|w| w.contains("left hand, mirrored")), "{:?}", sequence.warnings);
    // Matrices that are none, and numbers that are none, are left out.
    let mut bad = list.clone();
    bad[1]["pred_mano_params"]["hand_pose"][3][0][0] = json!(3.0);
    let sequence = read(&bad, &model).unwrap();
    assert!(sequence.frames.len() == 1 && sequence.warnings[0].contains("no rotation"), "{:?}", sequence.warnings);
    bad[0]["pred_mano_params"]["global_orient"] = json!([[[null, 0, 0], [0, 1, 0], [0, 0, 1]]]);
    let error = read(&bad, &model).unwrap_err().to_string();
    assert!(error.contains("none of the 2") && error.contains("not finite"), "{error}");
}

#[test]
fn hawor_arctic_and_amass_arrays_are_read() {
    let model = mano(Side::Right);
    let poses = poses(&model, 3);
    let fingers: Vec<Vec<f64>> = poses.iter().map(|p| rows(p)[1..].concat()).collect();
    let roots: Vec<[f64; 3]> = poses.iter().map(|p| rows(p)[0]).collect();
    let places: Vec<[f64; 3]> = poses.iter().map(|p| p.translation.to_array()).collect();
    let zeros = |width: usize| vec![vec![0.0; width]; 3];
    let hawor = json!({
        "pred_rot": [zeros(3), roots], "pred_hand_pose": [zeros(45), fingers], "pred_trans": [zeros(3), places],
        "pred_betas": [zeros(10), zeros(10)], "pred_valid": [[1, 1, 1], [1, 0, 1]],
    });
    let sequence = read(&hawor, &model).unwrap();
    assert_same(&sequence, &[poses[0].clone(), poses[2].clone()], 0.0);
    assert_eq!(sequence.frames[1].id, "0002");
    let flat = PoseOptions { flat_mean: true, ..Default::default() };
    let hand =
        json!({"rot": roots, "pose": fingers, "trans": places, "shape": vec![0.5; 10], "fitting_err": [0, 0, 0]});
    let other = json!({"rot": zeros(3), "pose": zeros(45), "trans": zeros(3), "shape": vec![0.5; 10]});
    let endings = json!({"rot_r": roots, "pose_r": fingers, "trans_r": places, "pose_l": zeros(45)});
    for file in [json!({"right": hand, "left": other}), hand.clone(), endings] {
        assert_same(&read_with(&file, &model, &flat).unwrap(), &poses, 0.0);
        // ARCTIC's are from the mean pose.
        assert!(difference(&read(&file, &model).unwrap().frames[0].pose, &poses[0]) > 0.1);
    }
    let body: Vec<Vec<f64>> = fingers.iter().map(|row| [vec![0.1; 111], row.clone()].concat()).collect();
    let file = json!({"poses": body, "mocap_framerate": 120.0, "trans": places});
    let sequence = read(&file, &model).unwrap();
    assert_eq!(sequence.fps, 120.0);
    let still = |p: &Pose| {
        let mut p = Pose { translation: DVec3::ZERO, ..p.clone() };
        p.rotations[0] = DVec3::ZERO;
        p
    };
    let expected: Vec<Pose> = poses.iter().map(still).collect();
    assert_same(&sequence, &expected, 0.0);
    assert_same(&read(&json!({"right_hand_pose": fingers}), &model).unwrap(), &expected, 0.0);
    let in_place = PoseOptions { in_place: true, flat_mean: true, ..Default::default() };
    assert_same(&read_with(&hand, &model, &in_place).unwrap(), &expected, 0.0);
    let short = json!({"rot": [[0, 0, 0]], "pose": fingers, "trans": places});
    let error = read(&short, &model).unwrap_err().to_string();
    assert!(error.contains("poses.json: rot") && error.contains("3 frames"), "{error}");
}

#[test]
fn mano_poses_drive_other_rigs_exactly_with_the_model_and_nearly_without() {
    for side in [Side::Right, Side::Left] {
        let model = mano(side);
        for to in hands().iter().filter(|to| to.side == side) {
            let poses = poses(&model, 5);
            let numbers: Vec<Vec<f64>> = poses.iter().map(|p| rows(p)[1..].concat()).collect();
            let hand = json!({"rot": poses.iter().map(|p| rows(p)[0]).collect::<Vec<_>>(), "pose": numbers,
                "trans": poses.iter().map(|p| p.translation.to_array()).collect::<Vec<_>>()});
            let name = if side == Side::Right { "right" } else { "left" };
            let file = json!({name: hand, "flat_hand_mean": true});
            let options = PoseOptions { pose_model: Some(model.clone()), ..Default::default() };
            let exact = read_with(&file, to, &options).unwrap();
            let way = Retarget::new(&Rig::of(&model).unwrap(), &Rig::of(to).unwrap());
            let expected: Vec<Pose> = poses.iter().map(|pose| way.pose(pose)).collect();
            assert_same(&exact, &expected, 1e-12);
            // The stand-in is the same hand here, but for where its wrist is.
            let near = read(&file, to).unwrap();
            for (near, exact) in near.frames.iter().zip(&exact.frames) {
                let mut exact = exact.pose.clone();
                exact.translation = near.pose.translation;
                assert!(difference(&near.pose, &exact) < 1e-9);
            }
            // Its mean pose is known only with the model.
            let from_mean = json!({name: hand});
            assert!(read(&from_mean, to).unwrap().warnings.iter().any(|w| w.contains("mean pose")));
            assert!(read_with(&from_mean, to, &options).unwrap().warnings.is_empty());
        }
    }
}

/// The joints of a pose as WebXR gives them, in its own world.
fn xr_joints(model: &HandModel, pose: &Pose) -> Vec<(String, [f64; 3], [f64; 4])> {
    let rig = Rig::of(model).unwrap();
    let chain = pose_skeleton(&rig.parents, &rig.joints, &pose.rotations);
    let world = DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0));
    let joint = |k: usize| {
        let place = world * (chain.world[k].translation + pose.translation);
        let turn = DQuat::from_mat3(&(world * chain.world[k].linear * rig.frames[k]));
        (rig.joint_names[k].clone(), place.to_array(), turn.to_array())
    };
    (0..rig.joints.len()).map(joint).collect()
}

#[test]
fn joints_of_webxr_and_openxr_drive_a_hand_of_any_rig() {
    for side in [Side::Right, Side::Left] {
        let Some(model) = generic(side) else { return };
        let poses = poses(&model, 3);
        let name = if side == Side::Right { "right" } else { "left" };
        let joints: Vec<_> = poses.iter().map(|pose| xr_joints(&model, pose)).collect();
        let by_name = |joints: &[(String, [f64; 3], [f64; 4])]| -> Json {
            let joint = |(name, p, q): &(String, [f64; 3], [f64; 4])| {
                let [x, y, z, w] = *q;
                (
                    name.clone(),
                    json!({"position": {"x": p[0], "y": p[1], "z": p[2], "w": 1}, "orientation": {"x": x, "y": y, "z": z, "w": w}}),
                )
            };
            Json::Object(joints.iter().map(joint).collect())
        };
        // OpenXR: the palm first, lists, its own names.
        let in_order = |joints: &[(String, [f64; 3], [f64; 4])]| -> Json {
            let palm = json!({"pose": {"position": [9, 9, 9], "orientation": [0, 0, 0, 1]}});
            let rest = joints.iter().map(|(_, p, q)| json!({"pose": {"position": p, "orientation": q}}));
            std::iter::once(palm).chain(rest).collect()
        };
        let matrices = |joints: &[(String, [f64; 3], [f64; 4])]| -> Json {
            let numbers = joints.iter().flat_map(|(_, p, q)| {
                glam::DMat4::from_rotation_translation(DQuat::from_array(*q), DVec3::from_array(*p)).to_cols_array()
            });
            numbers.collect()
        };
        let files = [
            json!({"fps": 72, "handedness": name, "frames": joints.iter().map(|j| json!({"joints": by_name(j)})).collect::<Vec<_>>()}),
            json!(
                joints
                    .iter()
                    .enumerate()
                    .map(|(k, j)| json!({"time": 13.888888888888889 * k as f64, name: {"joints": in_order(j)}}))
                    .collect::<Vec<_>>()
            ),
            json!({"fps": 72, "frames": joints.iter().map(|j| json!({"hands": [{"handedness": name, "poses": matrices(j)}]})).collect::<Vec<_>>()}),
        ];
        for file in &files {
            let sequence = read(file, &model).unwrap();
            assert!((sequence.fps - 72.0).abs() < 1e-6, "{}", sequence.fps);
            assert_same(&sequence, &poses, 1e-7);
            let hand = procedural(side);
            let way = Retarget::new(&Rig::of(&model).unwrap(), &Rig::of(hand).unwrap());
            let expected: Vec<Pose> = poses.iter().map(|pose| way.pose(pose)).collect();
            assert_same(&read(file, hand).unwrap(), &expected, 1e-7);
            // On the other hand: the mirror image.
            let other = procedural(crate::retarget::other_side(side));
            let expected: Vec<Pose> = expected.iter().map(mirrored).collect();
            assert_same(&read(file, other).unwrap(), &expected, 1e-7);
        }
        let mut gaps = files[0].clone();
        gaps["frames"][1]["joints"]["index-finger-tip"] = Json::Null;
        let sequence = read(&gaps, &model).unwrap();
        assert!(
            sequence.frames.len() == 2 && sequence.warnings[0].contains("index-finger-tip"),
            "{:?}",
            sequence.warnings
        );
        gaps["frames"][0]["joints"]["wrist"]["orientation"] = json!([0, 0, 0, 0]);
        gaps["frames"][2]["joints"]["wrist"]["position"] = json!([0, null, 0]);
        assert!(read(&gaps, &model).unwrap_err().to_string().contains("none of the 3"));
    }
}

#[test]
fn world_landmarks_are_fitted_and_image_landmarks_are_refused() {
    for side in [Side::Right, Side::Left] {
        let model = procedural(side);
        let ik = HandIk::new(&Rig::of(model).unwrap());
        let poses: Vec<Pose> =
            ["rest", "fist", "point", "victory"].map(|name| named_pose(name, model).unwrap()).to_vec();
        let points: Vec<[[f64; 3]; 21]> = poses.iter().map(|pose| ik.landmarks(pose).map(|p| p.to_array())).collect();
        let name = if side == Side::Right { "Right" } else { "Left" };
        let named = |points: &[[f64; 3]; 21]| -> Json {
            points.iter().map(|p| json!({"x": p[0], "y": p[1], "z": p[2], "visibility": 0})).collect()
        };
        let files = [
            json!(
                points
                    .iter()
                    .map(|p| json!({"landmarks": [], "worldLandmarks": [named(p)],
                "handedness": [[{"score": 1, "index": 0, "categoryName": name, "displayName": name}]]}))
                    .collect::<Vec<_>>()
            ),
            json!({"fps": 30, "handedness": name, "frames": points.iter().map(|p| json!({"world_landmarks": p})).collect::<Vec<_>>()}),
            json!({"world_landmarks": points, "side": name}),
            json!({"frames": points.iter().map(|p| json!({"multi_hand_world_landmarks": [{"landmark": named(p)}],
                "multi_handedness": [{"classification": [{"index": 0, "label": name}]}]})).collect::<Vec<_>>()}),
        ];
        for file in &files {
            let sequence = read(file, model).unwrap();
            for (frame, points) in sequence.frames.iter().zip(&points) {
                let reached = ik.landmarks(&frame.pose);
                let off = reached.iter().zip(points).map(|(a, b)| a.distance(DVec3::from_array(*b))).fold(0.0, larger);
                assert!(off < 5e-4, "{off}");
            }
            let mirrored_hand = procedural(crate::retarget::other_side(side));
            let sequence = read(file, mirrored_hand).unwrap();
            assert!(sequence.warnings[0].contains("mirrored"), "{:?}", sequence.warnings);
        }
        let mut gaps = files[1].clone();
        gaps["frames"][1]["world_landmarks"][3] = json!([0, null, 0]);
        gaps["frames"][2]["world_landmarks"] = json!([]);
        let sequence = read(&gaps, model).unwrap();
        assert_eq!(sequence.frames.len(), 2);
        assert!(
            sequence.warnings.len() == 1 && sequence.warnings[0].contains("2 of 4 frames are left out"),
            "{:?}",
            sequence.warnings
        );
    }
    let image = json!([{"landmarks": vec![[0.5, 0.5, 0.0]; 21]}]);
    let error = read(&image, right()).unwrap_err().to_string();
    assert!(error.contains("landmarks") && error.contains("worldLandmarks"), "{error}");
}

fn npy(shape: &str, code: &str, data: &[u8]) -> Vec<u8> {
    let header = format!("{{'descr': '{code}', 'fortran_order': False, 'shape': {shape}, }}\n");
    [&b"\x93NUMPY\x01\x00"[..], &(header.len() as u16).to_le_bytes(), header.as_bytes(), data].concat()
}

fn npz(arrays: &[(&str, Vec<u8>)]) -> Vec<u8> {
    let mut writer = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    for (name, bytes) in arrays {
        writer.start_file(format!("{name}.npy"), zip::write::SimpleFileOptions::default()).unwrap();
        std::io::Write::write_all(&mut writer, bytes).unwrap();
    }
    writer.finish().unwrap().into_inner()
}

#[test]
fn own_archives_are_read_with_names_and_rate() {
    let poses = poses(right(), 2);
    let doubles = |values: Vec<f64>| values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>();
    let turned = doubles(poses.iter().flat_map(|p| rows(p).concat()).collect());
    let places = doubles(poses.iter().flat_map(|p| p.translation.to_array()).collect());
    let text: Vec<u8> = "ab".chars().flat_map(|c| u32::from(c).to_le_bytes()).collect();
    let arrays = |pose_shape: &str, text: &[u8]| {
        npz(&[
            ("pose", npy(pose_shape, "<f8", &turned)),
            ("translation", npy("(2, 3)", "<f8", &places)),
            ("shape", npy("(1,)", "<f8", &doubles(vec![0.25]))),
            ("fps", npy("()", "<f8", &doubles(vec![24.0]))),
            ("ids", npy("(2,)", "<U1", text)),
        ])
    };
    let read = |bytes: &[u8]| read_poses_bytes("poses.npz", bytes, right(), &PoseOptions::default());
    let sequence = read(&arrays("(2, 16, 3)", &text)).unwrap();
    assert_eq!((sequence.fps, sequence.frames[1].id.as_str(), &sequence.frames[1].shape), (24.0, "b", &vec![0.25]));
    assert!(sequence.frames.iter().zip(&poses).all(|(frame, pose)| frame.pose == *pose));
    let error = read(&arrays("(6, 4, 4)", &text)).unwrap_err().to_string();
    assert!(error.contains("poses.npz: pose") && error.contains("(T, n_b, 3)"), "{error}");
    let error = read(&arrays("(4, 8, 3)", &text)).unwrap_err().to_string();
    assert!(error.contains("translation") && error.contains("(4, 3)"), "{error}");
    let twice = [&text[..4], &text[..4]].concat();
    assert!(read(&arrays("(2, 16, 3)", &twice)).unwrap_err().to_string().contains("twice"));
}

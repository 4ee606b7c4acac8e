#![allow(clippy::neg_cmp_op_on_partial_ord, reason = "`!(error <= bound)` rejects NaN too")]

mod arrays;
mod hands;
mod images;
mod layouts;
mod mano;
mod messages;
mod rigs;
mod sense;
mod time;

use ghand_capture::capture::Capture;
use ghand_core::skeleton::pose_skeleton;
use ghand_hand_model::named_poses::named_pose;
use ghand_test_support::shared;
use glam::DMat3;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde_json::{Value as Json, json};

use super::*;
use crate::ik::HandIk;
use crate::retarget::Retarget;
use crate::test_hands::{generic, larger, natural_pose, procedural};

fn read(value: &Json, model: &HandModel) -> Result<PoseSequence, PoseError> {
    read_with(value, model, &PoseOptions::default())
}

fn read_with(value: &Json, model: &HandModel, options: &PoseOptions) -> Result<PoseSequence, PoseError> {
    read_poses_bytes("poses.json", value.to_string().as_bytes(), model, options)
}

fn right() -> &'static HandModel {
    procedural(Side::Right)
}

fn rows(pose: &Pose) -> Vec<[f64; 3]> {
    pose.rotations.iter().map(DVec3::to_array).collect()
}

/// Largest difference of the rotations, as matrices, and of the translations; NaN if one is NaN.
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

/// The frames but for these, which had no pose in the file and were filled.
fn without_filled(mut sequence: PoseSequence, filled: &[&str]) -> PoseSequence {
    let is_filled = |frame: &PoseFrame| filled.contains(&frame.id.as_str());
    assert_eq!(
        sequence.frames.iter().filter(|frame| is_filled(frame)).count(),
        filled.len(),
        "{:?}",
        sequence.warnings
    );
    sequence.frames.retain(|frame| !is_filled(frame));
    sequence
}

#[test]
fn the_comparison_rejects_errors_and_numbers_that_are_not_finite() {
    let pose = Pose::rest(16);
    let mut other = pose.clone();
    assert!(difference(&pose, &other) == 0.0);
    other.rotations[3].x = 1e-3;
    assert!(!(difference(&pose, &other) <= 1e-6));
    other.rotations[3].x = f64::NAN;
    assert!(!(difference(&pose, &other) <= 1e300));
}

#[test]
fn ghand_poses_are_read_written_and_read_again_bit_for_bit() {
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
    ghand::write_poses(&path, &sequence, right()).unwrap();
    assert_eq!(read_poses(&path, right(), &PoseOptions::default()).unwrap(), sequence);
    let error = ghand::write_poses(folder.path(), &sequence, right()).unwrap_err().to_string();
    assert!(error.contains(&folder.path().display().to_string()), "{error}");
}

#[test]
fn a_shape_by_names_is_that_of_the_models_directions() {
    let file = json!({"frames": [{"pose": rows(&Pose::rest(16)), "shape": {"palm-width": 2, "0": -1.5}}]});
    let frames = read(&file, right()).unwrap().frames;
    assert_eq!(frames[0].shape, [-1.5, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
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
fn invalid_ghand_poses_are_errors_with_file_field_and_remedy() {
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
            &["frames", "\"a\" occurs twice"],
        ),
        (
            json!({"frames": [{"id": "a", "pose": good(), "translation": [1, 2]}]}),
            &["frames[\"a\"].translation", "3 numbers"],
        ),
        (json!({"frames": [{"id": "a", "pose": good(), "shape": [1, null]}]}), &["frames[\"a\"].shape", "not finite"]),
        (
            json!({"frames": [{"id": "a", "pose": good(), "shape": {"hand-sise": 1}}]}),
            &["frames[\"a\"].shape", "did you mean \"hand-size\"?"],
        ),
        (
            json!({"frames": [{"id": "a", "pose": good(), "shape": {"hand-size": "big"}}]}),
            &["frames[\"a\"].shape", "\"hand-size\" is text, must be a number"],
        ),
        (json!({"format": "x", "frames": [{"pose": good()}]}), &["format", "ghand-capture"]),
        (json!({"format": "ghand-capture", "version": 2, "frames": [{"pose": good()}]}), &["version", "must be 1"]),
        (json!({"hello": 1}), &["content", "\"hello\" (a number)", "not a supported kind of poses"]),
    ] {
        let error = read(&file, right()).unwrap_err().to_string();
        assert!(error.starts_with("poses.json: ") && parts.iter().all(|part| error.contains(part)), "{error}");
    }
    let error = read_poses(Path::new("absent.json"), right(), &PoseOptions::default()).unwrap_err().to_string();
    assert!(error.contains("absent.json"), "{error}");
}

#[test]
fn the_poses_of_a_capture_with_another_skeleton_are_retargeted() {
    let Some(model) = generic(Side::Right) else { return };
    let Some(capture) = shared("captures/blender-a") else { return };
    let own = Capture::open(&capture).unwrap();
    let sequence = read_poses(&capture, right(), &PoseOptions::default()).unwrap();
    let way = Retarget::new(&RestSkeleton::of(&own.hand_model).unwrap(), &RestSkeleton::of(right()).unwrap());
    let expected: Vec<Pose> = own.frames.iter().map(|frame| way.pose(&frame.pose)).collect();
    assert_same(&sequence, &expected, 1e-12);
    let direct = read_poses(&capture, &model, &PoseOptions::default());
    assert!(direct.is_ok_and(|direct| direct.frames[3].pose == own.frames[3].pose));
}

/// The joints of a pose in WebXR's form, in its own world.
fn xr_joints(model: &HandModel, pose: &Pose) -> Vec<(String, [f64; 3], [f64; 4])> {
    let rig = RestSkeleton::of(model).unwrap();
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
fn joints_of_webxr_and_openxr_drive_a_hand_with_any_skeleton() {
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
                    .map(|(k, j)| json!({"time": 1000.0 / 72.0 * k as f64, name: {"joints": in_order(j)}}))
                    .collect::<Vec<_>>()
            ),
            json!({"fps": 72, "frames": joints.iter().map(|j| json!({"hands": [{"handedness": name, "poses": matrices(j)}]})).collect::<Vec<_>>()}),
        ];
        for file in &files {
            let sequence = read(file, &model).unwrap();
            assert!((sequence.fps - 72.0).abs() < 1e-6, "{}", sequence.fps);
            assert_same(&sequence, &poses, 1e-7);
            let hand = procedural(side);
            let way = Retarget::new(&RestSkeleton::of(&model).unwrap(), &RestSkeleton::of(hand).unwrap());
            let expected: Vec<Pose> = poses.iter().map(|pose| way.pose(pose)).collect();
            assert_same(&read(file, hand).unwrap(), &expected, 1e-7);
            // On the other hand: the mirror image.
            let other = procedural(side.other());
            let expected: Vec<Pose> = expected.iter().map(Pose::mirrored).collect();
            assert_same(&read(file, other).unwrap(), &expected, 1e-7);
        }
        let mut gaps = files[0].clone();
        gaps["frames"][1]["joints"]["index-finger-tip"] = Json::Null;
        let sequence = without_filled(read(&gaps, &model).unwrap(), &["0001"]);
        assert!(
            sequence.frames.len() == 2 && sequence.warnings[0].contains("index-finger-tip"),
            "{:?}",
            sequence.warnings
        );
        gaps["frames"][0]["joints"]["wrist"]["orientation"] = json!([0, 0, 0, 0]);
        gaps["frames"][2]["joints"]["wrist"]["position"] = json!([0, null, 0]);
        let by_positions = read(&gaps, &model).unwrap().warnings;
        assert!(by_positions.iter().any(|w| w.contains("fitted to their positions")), "{by_positions:?}");
        gaps["frames"][0]["joints"]["wrist"]["position"] = json!([0, null, 0]);
        assert!(read(&gaps, &model).unwrap_err().to_string().contains("none of the 3"));
    }
}

#[test]
fn world_landmarks_are_fitted_and_image_landmarks_are_rejected() {
    for side in [Side::Right, Side::Left] {
        let model = procedural(side);
        let ik = HandIk::new(&RestSkeleton::of(model).unwrap());
        let poses: Vec<Pose> =
            ["rest", "fist", "point", "victory"].map(|name| named_pose(name, model).unwrap()).to_vec();
        // MediaPipe's tips lie 6 mm before the end of the finger.
        let seen = |pose: &Pose| {
            let mut places = ik.landmarks(pose);
            for tip in [4, 8, 12, 16, 20] {
                places[tip] -= 0.006 * (places[tip] - places[tip - 1]).normalize();
            }
            places.map(|p| p.to_array())
        };
        let points: Vec<[[f64; 3]; 21]> = poses.iter().map(seen).collect();
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
                let reached = seen(&frame.pose);
                let off =
                    reached.iter().zip(points).map(|(a, b)| DVec3::from_array(*a).distance(DVec3::from_array(*b)));
                let off = off.fold(0.0, larger);
                assert!(off < 1e-3, "{off}");
            }
            let mirrored_hand = procedural(side.other());
            let sequence = read(file, mirrored_hand).unwrap();
            assert!(sequence.warnings.iter().any(|w| w.contains("mirrored")), "{:?}", sequence.warnings);
        }
        let mut gaps = files[1].clone();
        gaps["frames"][1]["world_landmarks"][3] = json!([0, null, 0]);
        gaps["frames"][2]["world_landmarks"] = json!([]);
        let sequence = without_filled(read(&gaps, model).unwrap(), &["0001", "0002"]);
        assert_eq!(sequence.frames.len(), 2);
        assert!(sequence.warnings[0].contains("2 of 4 frames are skipped"), "{:?}", sequence.warnings);
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
fn ghand_archives_are_read_with_names_and_rate() {
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

#[test]
fn archives_with_many_empty_rows_or_one_long_row_for_all_are_rejected() {
    // 10^18 frames without joints take no bytes in the file.
    let empty = npz(&[("pose", npy("(1000000000000000000, 0, 3)", "<f8", &[]))]);
    let message =
        |bytes: &[u8]| read_poses_bytes("poses.npz", bytes, right(), &PoseOptions::default()).unwrap_err().to_string();
    assert!(message(&empty).contains("poses.npz"), "{}", message(&empty));
    let hawor = ["pred_rot", "pred_hand_pose", "pred_trans"];
    let hawor = hawor.map(|name| (name, npy("(2, 9223372036854775807, 0)", "<f8", &[])));
    assert!(message(&npz(&hawor)).contains("pred_rot"));
    let many = npz(&[
        ("pose", npy("(30000, 1, 3)", "<f8", &[0; 30_000 * 24])),
        ("shape", npy("(30000,)", "<f8", &[0; 30_000 * 8])),
    ]);
    assert!(message(&many).contains("shape: has 30000 numbers for each of 30000 frames"), "{}", message(&many));
}

//! Arrays whose meaning follows from their shape, and data sets that are such arrays.

use ghand_core::skeleton::pose_skeleton;

use super::hands::webxr;
use super::mano::mano;
use super::*;
use crate::pose_sequence::reading::source::OPENGL_AXES;

/// A pose's rotations of MANO's 16 joints as one row of axis-angle numbers.
fn row(pose: &Pose) -> Vec<f64> {
    rows(pose).concat()
}

fn matrices(pose: &Pose) -> Vec<[[f64; 3]; 3]> {
    pose.rotations.iter().map(|r| rotation_from_axis_angle(*r).transpose().to_cols_array_2d()).collect()
}

fn place(pose: &Pose) -> [f64; 3] {
    pose.translation.to_array()
}

/// The pose without the parts that an array of that kind lacks.
fn without(pose: &Pose, root: bool, translation: bool) -> Pose {
    let mut pose = pose.clone();
    if root {
        pose.rotations[0] = DVec3::ZERO;
    }
    if translation {
        pose.translation = DVec3::ZERO;
    }
    pose
}

#[test]
fn arrays_of_manos_rotations_are_read_in_every_shape_and_wrapping() {
    let model = mano(Side::Right);
    let poses = poses(&model, 3);
    let each = |f: &dyn Fn(&Pose) -> Json| -> Json { poses.iter().map(f).collect() };
    // The array, whether it lacks the root, whether it lacks the translation.
    let arrays = [
        (each(&|p| json!(row(p)[3..])), true, true),
        (each(&|p| json!(row(p))), false, true),
        (each(&|p| json!(([row(p), place(p).to_vec()].concat()))), false, false),
        (each(&|p| json!(([row(p), vec![0.5; 10]].concat()))), false, true),
        (each(&|p| json!(rows(p)[1..])), true, true),
        (each(&|p| json!(rows(p))), false, true),
        (each(&|p| json!(matrices(p)[1..])), true, true),
        (each(&|p| json!(matrices(p))), false, true),
        (each(&|p| json!(matrices(p).concat().concat())), false, true),
        (each(&|p| json!([row(p)])), false, true),
    ];
    for (array, no_root, no_translation) in &arrays {
        let expected: Vec<Pose> = poses.iter().map(|pose| without(pose, *no_root, *no_translation)).collect();
        let listed = array.as_array().unwrap();
        let lines: String = listed.iter().map(|frame| format!("{frame}\n")).collect();
        let objects: String = listed.iter().map(|frame| format!("{}\n", json!({"mano_pose": frame}))).collect();
        for text in [
            array.to_string(),
            json!({"fps": 30, "mano_pose": array}).to_string(),
            json!({"anything": array, "betas": vec![0.1; 10]}).to_string(),
            json!({"right": array}).to_string(),
            json!({"frames": array}).to_string(),
            lines,
            objects,
        ] {
            let sequence = read_poses_bytes("poses.jsonl", text.as_bytes(), &model, &PoseOptions::default());
            assert_same(&sequence.unwrap_or_else(|error| panic!("{error}: {text:.200}")), &expected, 1e-9);
        }
        let one = read(&listed[1], &model).unwrap();
        assert_same(&one, &expected[1..2], 1e-9);
        // They also transfer to another skeleton: the bones point the same way.
        assert_eq!(read(array, &webxr(Side::Right)).unwrap().frames.len(), 3);
    }
    let sequence = read(&arrays[3].0, &model).unwrap();
    assert_eq!(sequence.frames[2].shape, vec![0.5; 10]);
}

#[test]
fn arrays_beside_the_poses_are_used() {
    let model = mano(Side::Right);
    let poses = poses(&model, 3);
    let fingers: Vec<Vec<f64>> = poses.iter().map(|p| row(p)[3..].to_vec()).collect();
    let places: Vec<[f64; 3]> = poses.iter().map(place).collect();
    let roots: Vec<[f64; 3]> = poses.iter().map(|p| rows(p)[0]).collect();
    let file = json!({"mano_pose": fingers, "root_orient": roots, "trans": places, "betas": vec![0.25; 10], "fps": 12, "ids": ["a", "b", "c"]});
    let sequence = read(&file, &model).unwrap();
    assert_same(&sequence, &poses, 0.0);
    assert_eq!((sequence.fps, sequence.frames[2].id.as_str(), &sequence.frames[1].shape), (12.0, "c", &vec![0.25; 10]));
    let each = json!({"hand_pose": fingers, "betas": [vec![0.1; 10], vec![0.2; 10], vec![0.3; 10]]});
    assert_eq!(read(&each, &model).unwrap().frames[1].shape, vec![0.2; 10]);
    let from_mean = json!({"hand_pose": fingers, "flat_hand_mean": false});
    let off = difference(&read(&from_mean, &model).unwrap().frames[0].pose, &without(&poses[0], true, true));
    assert!(off > 0.1, "the mean pose is added: {off}");
    let short = json!({"hand_pose": fingers, "trans": [[0, 0, 0], [1, 1, 1]]});
    let error = read(&short, &model).unwrap_err().to_string();
    assert!(error.contains("poses.json: trans") && error.contains("(3, 3)"), "{error}");
}

#[test]
fn arrays_of_numpy_are_read_with_and_without_a_name() {
    let model = mano(Side::Right);
    let poses = poses(&model, 2);
    let expected: Vec<Pose> = poses.iter().map(|pose| without(pose, false, true)).collect();
    let bytes = |values: Vec<f64>| values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>();
    let array = npy("(2, 48)", "<f8", &bytes(poses.iter().flat_map(row).collect()));
    for file in [
        array.clone(),
        npz(&[("arr_0", array.clone())]),
        npz(&[("poses", array.clone()), ("other", npy("(3,)", "<f8", &[0; 24]))]),
    ] {
        let sequence = read_poses_bytes("poses.npz", &file, &model, &PoseOptions::default()).unwrap();
        assert_same(&sequence, &expected, 0.0);
    }
    // Two arrays could be the pose, and neither name decides.
    let error =
        read_poses_bytes("poses.npz", &npz(&[("a", array.clone()), ("b", array)]), &model, &PoseOptions::default());
    assert!(error.unwrap_err().to_string().contains("(\"a\", \"b\")"));
    // For a model with other joints, rows are for these joints.
    let own = webxr(Side::Right);
    let turned = super::poses(&own, 2);
    let file = npy("(2, 25, 3)", "<f8", &bytes(turned.iter().flat_map(row).collect()));
    let sequence = read_poses_bytes("poses.npy", &file, &own, &PoseOptions::default()).unwrap();
    assert_same(&sequence, &turned.iter().map(|pose| without(pose, false, true)).collect::<Vec<_>>(), 0.0);
}

#[test]
fn freihand_parameters_are_from_the_mean_pose_and_of_right_hands() {
    let model = mano(Side::Right);
    let poses = poses(&model, 3);
    let with_mean = |pose: &Pose| {
        let mut pose = without(pose, false, true);
        let mean = &model.pose_space.as_ref().unwrap().mean;
        pose.rotations.iter_mut().skip(1).zip(mean).for_each(|(r, mean)| *r += *mean);
        pose
    };
    let expected: Vec<Pose> = poses.iter().map(with_mean).collect();
    let entry = |pose: &Pose| json!([([row(pose), vec![0.3; 10], vec![112.0, 108.0, 0.04]].concat())]);
    let file: Json = poses.iter().map(entry).collect();
    let sequence = read(&file, &model).unwrap();
    assert_same(&sequence, &expected, 1e-12);
    assert_eq!(sequence.frames[0].shape, vec![0.3; 10]);
    let left = read(&file, &mano(Side::Left)).unwrap();
    assert!(left.warnings.iter().any(|w| w.contains("right hand, mirrored")), "{:?}", left.warnings);
    let flat = PoseOptions { flat_mean: true, ..Default::default() };
    assert_same(
        &read_with(&file, &model, &flat).unwrap(),
        &poses.iter().map(|p| without(p, false, true)).collect::<Vec<_>>(),
        1e-12,
    );
}

#[test]
fn plain_landmark_arrays_are_fitted_at_their_positions() {
    let ik = HandIk::new(&RestSkeleton::of(right()).unwrap());
    let move_to = |name: &str| Pose { translation: DVec3::new(0.05, -0.1, 0.6), ..named_pose(name, right()).unwrap() };
    let poses = ["point", "victory", "open"].map(move_to);
    let points: Vec<[[f64; 3]; 21]> = poses.iter().map(|pose| ik.landmarks(pose).map(|p| p.to_array())).collect();
    let flat: Vec<Vec<f64>> = points.iter().map(|points| points.concat()).collect();
    for file in
        [json!(points), json!(flat), json!({"xyz": points}), json!({"right": points}), json!(points[0]), json!(flat[0])]
    {
        let sequence = read(&file, right()).unwrap();
        for (frame, points) in sequence.frames.iter().zip(&points) {
            let reached = ik.landmarks(&frame.pose);
            let off = reached.iter().zip(points).map(|(a, b)| a.distance(DVec3::from_array(*b))).fold(0.0, larger);
            assert!(off < 5e-4, "{off}");
        }
    }
    let millimetres: Vec<[[f64; 3]; 21]> = points.iter().map(|frame| frame.map(|p| p.map(|v| 1000.0 * v))).collect();
    let error = read(&json!(millimetres), right()).unwrap_err().to_string();
    assert!(error.contains("millimetres") && error.contains("1000"), "{error}");
}

/// Positions of a hand's joints in a pose.
fn joints(model: &HandModel, pose: &Pose) -> Vec<DVec3> {
    let chain = pose_skeleton(&model.parents, &model.joints, &pose.rotations);
    chain.world.iter().map(|world| world.translation + pose.translation).collect()
}

/// A pickle of protocol 2 of a dictionary of lists of numbers, or `None`.
fn pickle(entries: &[(&str, Option<Vec<f64>>)]) -> Vec<u8> {
    let mut bytes = b"\x80\x02}(".to_vec();
    for (name, values) in entries {
        bytes.extend([b"U", &[name.len() as u8][..], name.as_bytes()].concat());
        match values {
            None => bytes.push(b'N'),
            Some(values) => {
                bytes.extend(b"](");
                values.iter().for_each(|value| bytes.extend([b"G", &value.to_be_bytes()[..]].concat()));
                bytes.push(b'e');
            }
        }
    }
    bytes.extend(b"u.");
    bytes
}

#[test]
fn ho3d_frames_and_folders_of_them_come_from_opengls_camera() {
    let model = mano(Side::Right);
    let poses = poses(&model, 3);
    let folder = tempfile::tempdir().unwrap();
    let meta = folder.path().join("meta");
    std::fs::create_dir(&meta).unwrap();
    for (k, pose) in poses.iter().enumerate() {
        let entries = [
            ("objName", None),
            ("handPose", Some(row(pose))),
            ("handTrans", Some(place(pose).to_vec())),
            ("handBeta", Some(vec![0.5; 10])),
        ];
        std::fs::write(meta.join(format!("{:04}.pkl", 10 * k)), pickle(&entries)).unwrap();
    }
    std::fs::write(meta.join("0005.pkl"), pickle(&[("handPose", None)])).unwrap();
    let read = |path: &Path| read_poses(path, &model, &PoseOptions::default());
    for path in [folder.path(), &meta] {
        let sequence = without_filled(read(path).unwrap(), &["0005", "0015"]);
        let ids: Vec<&str> = sequence.frames.iter().map(|frame| frame.id.as_str()).collect();
        assert_eq!((sequence.fps, ids), (30.0, vec!["0000", "0010", "0020"]));
        assert!(
            sequence.warnings[0].contains("1 of 4") && sequence.warnings[0].contains("0005"),
            "{:?}",
            sequence.warnings
        );
        for (frame, pose) in sequence.frames.iter().zip(&poses) {
            assert_eq!(frame.shape, vec![0.5; 10]);
            let seen: Vec<DVec3> = joints(&model, pose).iter().map(|joint| OPENGL_AXES * *joint).collect();
            let off = joints(&model, &frame.pose).iter().zip(&seen).map(|(a, b)| a.distance(*b)).fold(0.0, larger);
            assert!(off < 1e-9, "{off}");
        }
    }
    assert_same(&read(&meta.join("0020.pkl")).unwrap(), &[read(&meta).unwrap().frames[4].pose.clone()], 0.0);
    std::fs::write(meta.join("0006.pkl"), pickle(&[("camMat", None)])).unwrap();
    assert!(read(&meta).unwrap_err().to_string().contains("0006.pkl"));
    let empty = tempfile::tempdir().unwrap();
    let error = read(empty.path()).unwrap_err().to_string();
    assert!(error.contains("capture.json") && error.contains("HO-3D"), "{error}");
}

#[test]
fn ho3d_joints_replace_missing_poses_in_ho3ds_order() {
    let ik = HandIk::new(&RestSkeleton::of(right()).unwrap());
    let pose = Pose { translation: DVec3::new(0.05, -0.1, 0.6), ..named_pose("point", right()).unwrap() };
    let points = ik.landmarks(&pose);
    // From MediaPipe's order to MANO's with the tips after it: index, middle, little, ring, thumb.
    let order = [0, 5, 6, 7, 9, 10, 11, 17, 18, 19, 13, 14, 15, 1, 2, 3, 4, 8, 12, 16, 20];
    let joints: Vec<[f64; 3]> = order.iter().map(|k| (OPENGL_AXES * points[*k]).to_array()).collect();
    let sequence = read(&json!({"handPose": null, "handJoints3D": joints}), right()).unwrap();
    let reached = ik.landmarks(&sequence.frames[0].pose);
    let off = reached.iter().zip(&points).map(|(a, b)| a.distance(*b)).fold(0.0, larger);
    assert!(off < 5e-4, "{off}");
}

#[test]
fn the_output_of_webxrs_fill_poses_is_read_in_every_wrapping() {
    let model = webxr(Side::Right);
    let poses = poses(&model, 3);
    let of_joint = |(_, p, q): &(String, [f64; 3], [f64; 4])| {
        glam::DMat4::from_rotation_translation(DQuat::from_array(*q), DVec3::from_array(*p))
    };
    let frames: Vec<Vec<glam::DMat4>> =
        poses.iter().map(|pose| xr_joints(&model, pose).iter().map(of_joint).collect()).collect();
    let columns = |joints: &[glam::DMat4]| joints.iter().flat_map(|m| m.to_cols_array()).collect::<Vec<f64>>();
    let by_rows =
        |joints: &[glam::DMat4]| joints.iter().flat_map(|m| m.transpose().to_cols_array()).collect::<Vec<f64>>();
    // As JSON.stringify writes a Float32Array. serde_json's maps would sort the names.
    let typed = |joints: &[glam::DMat4]| -> String {
        let entries: Vec<String> = columns(joints).iter().enumerate().map(|(k, v)| format!("\"{k}\":{v:?}")).collect();
        format!("{{\"right\":{{{}}}}}\n", entries.join(","))
    };
    let bytes = |values: Vec<f64>| values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>();
    let all = |f: &dyn Fn(&[glam::DMat4]) -> Vec<f64>| bytes(frames.iter().flat_map(|joints| f(joints)).collect());
    let names = &model.joint_names;
    let joint_pose = |joints: &[glam::DMat4]| -> Json {
        let entry = |(name, m): (&String, &glam::DMat4)| {
            (name.clone(), json!({"pose": {"transform": {"matrix": m.to_cols_array()}, "radius": 0.01}}))
        };
        json!({"joints": Json::Object(names.iter().zip(joints).map(entry).collect())})
    };
    let each = |f: &dyn Fn(&[glam::DMat4]) -> Json| -> Vec<Json> { frames.iter().map(|joints| f(joints)).collect() };
    let text = |value: Json| value.to_string().into_bytes();
    let files: [Vec<u8>; 10] = [
        text(json!(each(&|joints| json!(columns(joints))))),
        text(json!(each(&|joints| json!({"right": columns(joints)})))),
        text(json!({"fps": 30, "frames": each(&|joints| json!({"matrices": columns(joints)}))})),
        frames.iter().map(|joints| typed(joints)).collect::<String>().into_bytes(),
        text(json!(each(&joint_pose))),
        text(json!({"right": each(&joint_pose)})),
        npy("(3, 400)", "<f8", &all(&columns)),
        npy("(3, 25, 16)", "<f8", &all(&columns)),
        npy("(3, 25, 4, 4)", "<f8", &all(&by_rows)),
        npz(&[("hand", npy("(3, 25, 4, 4)", "<f8", &all(&columns)))]),
    ];
    for (number, file) in files.iter().enumerate() {
        let sequence = read_poses_bytes("joints", file, &model, &PoseOptions::default());
        assert_same(&sequence.unwrap_or_else(|error| panic!("{number}: {error}")), &poses, 1e-7);
    }
    let one = npy("(25, 16)", "<f8", &bytes(columns(&frames[0])));
    assert_same(&read_poses_bytes("joints", &one, &model, &PoseOptions::default()).unwrap(), &poses[..1], 1e-7);
}

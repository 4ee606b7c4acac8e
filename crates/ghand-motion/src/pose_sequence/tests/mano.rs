//! MANO parameters from all sources.

use ghand_core::PoseSpace;
use serde_json::json;

use super::super::*;
use super::{assert_same, difference, poses, read, read_with, rows, without_filled};
use crate::retarget::Retarget;
use crate::test_hands::{hands, procedural};

/// A model of MANO's joints in MANO's axes with a mean pose, from invented numbers: the built-in hand, rotated.
pub(super) fn mano(side: Side) -> HandModel {
    let mut model = procedural(side).clone();
    let sign = if side == Side::Right { 1.0 } else { -1.0 };
    let turn = |p: DVec3| DVec3::new(sign * p.y, sign * p.x, -p.z) + DVec3::new(0.1, 0.0, 0.0);
    model.joints.iter_mut().chain(&mut model.vertices).for_each(|p| *p = turn(*p));
    let mean = (0..15).map(|k| DVec3::new(0.1, -0.02 * f64::from(k), 0.3)).collect();
    model.pose_space = Some(PoseSpace { mean, components: vec![] });
    model
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
        sequence.warnings.len() == 1 && sequence.warnings[0].contains("1 of 3 frames is skipped"),
        "{:?}",
        sequence.warnings
    );
    assert!(sequence.warnings[0].contains("45 numbers"));
    let flat = read_with(&file, &model, &PoseOptions { flat_mean: true, ..Default::default() }).unwrap();
    assert_same(&flat, &poses[..2], 0.0);
    // Left hands only on request; then they are read as those of this model.
    let left = read_with(&file, &mano(Side::Left), &PoseOptions { flat_mean: true, ..Default::default() }).unwrap();
    assert_eq!(left.frames.len(), 2);
    assert_same(&left, &[poses[3].clone(), poses[3].clone()], 0.0);
    let two = json!({"0": file["0"], "1": file["0"]});
    let error = read(&two, &model).unwrap_err().to_string();
    assert!(error.contains("--take") && error.contains("0, 1"), "{error}");
    assert!(read_with(&two, &model, &PoseOptions { take: Some("1".into()), ..Default::default() }).is_ok());
}

#[test]
fn hamer_estimates_are_read_in_every_layout_and_left_ones_are_mirrored() {
    let model = mano(Side::Right);
    let poses: Vec<Pose> = poses(&model, 2);
    let matrices = |rotations: &[DVec3]| -> Vec<[[f64; 3]; 3]> {
        rotations.iter().map(|r| rotation_from_axis_angle(*r).transpose().to_cols_array_2d()).collect()
    };
    let as_matrices = |pose: &Pose| json!({"global_orient": matrices(&pose.rotations[..1]), "hand_pose": matrices(&pose.rotations[1..])});
    let angles = |pose: &Pose| json!({"global_orient": rows(pose)[0], "hand_pose": rows(pose)[1..].concat(), "betas": vec![0.2; 10]});
    let place = |pose: &Pose| pose.translation.to_array();
    // Frames with hands, in the forms that users dump.
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
    // A left hand: parameters of the mirrored picture, with the actual position.
    let mut left = list.clone();
    for k in 0..2 {
        left[k]["is_right"] = json!(0);
    }
    let expected: Vec<Pose> =
        poses.iter().map(|p| Pose { rotations: p.mirrored().rotations, translation: p.translation }).collect();
    let sequence = read(&left, &mano(Side::Left)).unwrap();
    assert_same(&sequence, &expected, 1e-9);
    // On a right hand it is mirrored once more, with a warning.
    let sequence = read(&left, &model).unwrap();
    let expected: Vec<Pose> = expected.iter().map(Pose::mirrored).collect();
    assert_same(&sequence, &expected, 1e-9);
    assert!(sequence.warnings.iter().any(|w| w.contains("left hand, mirrored")), "{:?}", sequence.warnings);
    // Frames with invalid matrices or numbers are skipped.
    let mut bad = list.clone();
    bad[1]["pred_mano_params"]["hand_pose"][3][0][0] = json!(3.0);
    let sequence = without_filled(read(&bad, &model).unwrap(), &["0001"]);
    assert!(
        sequence.frames.len() == 1
            && sequence.warnings[0].contains("joint \"middle1\" has a matrix that is not a rotation"),
        "{:?}",
        sequence.warnings
    );
    bad[0]["pred_mano_params"]["global_orient"] = json!([[[null, 0, 0], [0, 1, 0], [0, 0, 1]]]);
    let error = read(&bad, &model).unwrap_err().to_string();
    assert!(
        error.contains("none of the 2") && error.contains("joint \"wrist\" has a number that is not finite"),
        "{error}"
    );
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
    let sequence = without_filled(read(&hawor, &model).unwrap(), &["0001"]);
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
fn mano_poses_drive_other_skeletons_exactly_with_the_model_and_nearly_without() {
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
            let way = Retarget::new(&RestSkeleton::of(&model).unwrap(), &RestSkeleton::of(to).unwrap());
            let expected: Vec<Pose> = poses.iter().map(|pose| way.pose(pose)).collect();
            assert_same(&exact, &expected, 1e-12);
            // The built-in replacement is the same hand here, except for the position of its wrist.
            let near = read(&file, to).unwrap();
            for (near, exact) in near.frames.iter().zip(&exact.frames) {
                let mut exact = exact.pose.clone();
                exact.translation = near.pose.translation;
                assert!(difference(&near.pose, &exact) < 1e-9);
            }
            // Its mean pose is known only with the model.
            let from_mean = json!({name: hand});
            assert!(read(&from_mean, to).unwrap().warnings.iter().any(|w| w.contains("mean pose")));
            let warnings = read_with(&from_mean, to, &options).unwrap().warnings;
            assert!(!warnings.iter().any(|w| w.contains("mean pose")), "{warnings:?}");
        }
    }
}

#![allow(clippy::neg_cmp_op_on_partial_ord, reason = "`!(error <= bound)` rejects NaN too")]

use ghand_core::Side;
use ghand_hand_model::named_poses::named_pose;

use super::*;
use crate::test_hands::{generic, hands, larger, procedural};

/// Largest angle that a joint rotates from one pose to the next, radians; NaN if one is NaN.
fn turn(a: &Pose, b: &Pose) -> f64 {
    let angle = |(a, b): (&DVec3, &DVec3)| {
        let [a, b] = [a, b].map(|r| rotation_from_axis_angle(*r));
        axis_angle_from_rotation(&(a.transpose() * b)).length()
    };
    let angles = a.rotations.iter().zip(&b.rotations).map(angle);
    angles.fold(0.0, larger)
}

#[test]
fn motions_are_smooth_end_as_they_begin_and_show_their_poses() {
    for model in hands() {
        for name in MOTION_NAMES {
            let fps = 60.0;
            let sequence = motion(name, &model, fps).unwrap().unwrap();
            let poses: Vec<&Pose> = sequence.frames.iter().map(|frame| &frame.pose).collect();
            assert!((1.0..20.0).contains(&sequence.duration()), "{name}: {} s", sequence.duration());
            assert!(turn(poses[0], poses[poses.len() - 1]) < 1e-9, "{name}");
            let steps: Vec<f64> = poses.windows(2).map(|pair| turn(pair[0], pair[1])).collect();
            // Fingers need a fifth of a second at least to close.
            assert!(
                steps.iter().all(|step| *step < 0.3),
                "{name} jumps by {:?}",
                steps.iter().copied().fold(0.0, larger)
            );
            let jerks = steps.windows(2).map(|pair| (pair[1] - pair[0]).abs());
            assert!(jerks.fold(0.0, larger) < 0.09, "{name}");
        }
        let grasp = motion("grasp", &model, 30.0).unwrap().unwrap();
        let fist = named_pose("fist", &model).unwrap();
        assert!(grasp.frames.iter().any(|frame| turn(&frame.pose, &fist) < 1e-9));
    }
}

#[test]
fn the_rate_changes_the_number_of_frames_and_nothing_else() {
    let model = procedural(Side::Right);
    let [slow, fast] = [10.0, 40.0].map(|fps| motion("count", model, fps).unwrap().unwrap());
    assert_eq!(slow.fps, 10.0);
    for (k, frame) in slow.frames.iter().enumerate() {
        assert!(turn(&frame.pose, &fast.frames[4 * k].pose) < 1e-9);
    }
    let again = fast.resampled(10.0).unwrap();
    assert_eq!(again.frames.len(), slow.frames.len());
    assert!(again.frames.iter().zip(&slow.frames).all(|(a, b)| turn(&a.pose, &b.pose) < 1e-9));
    assert!(!(turn(&slow.frames[0].pose, &slow.frames[9].pose) < 1e-9), "the comparison sees a difference");
    let mut broken = slow.frames[0].pose.clone();
    broken.rotations[2] = DVec3::NAN;
    assert!(turn(&slow.frames[0].pose, &broken).is_nan());
}

#[test]
fn unknown_names_and_unnamed_skeletons_have_no_motion() {
    assert!(motion("salute", procedural(Side::Right), 30.0).is_none());
    let mut strange = procedural(Side::Right).clone();
    strange.joint_names[4] = "bone".into();
    assert!(motion("wave", &strange, 30.0).unwrap().is_err());
}

#[test]
fn interpolation_takes_the_shorter_way_for_any_vectors() {
    let pose = |x: f64| Pose { rotations: vec![DVec3::X * x], translation: DVec3::ZERO };
    // 350 degrees and 10: the rotation between is 20 degrees.
    let middle = between(&pose(350f64.to_radians()), &pose(10f64.to_radians()), 0.5);
    assert!(turn(&middle, &pose(0.0)) < 1e-9);
    assert!(generic(Side::Right).is_none_or(|model| motion("wave", &model, 30.0).unwrap().is_ok()));
}

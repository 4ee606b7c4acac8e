#![allow(clippy::neg_cmp_op_on_partial_ord, reason = "`!(error <= bound)` rejects NaN too")]

use ghand_core::rotation::rotation_from_axis_angle;
use ghand_core::{HandModel, Side};
use ghand_hand_model::joints::limits::random_pose;
use ghand_hand_model::named_poses::{POSE_NAMES, named_pose};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::retarget::mirrored_point;
use crate::test_hands::{generic, hands, larger, natural_motion, natural_pose, procedural, vector};

/// Largest distance between the joints of two poses, metres; NaN if one is NaN.
fn joint_error(model: &HandModel, a: &Pose, b: &Pose) -> f64 {
    let places = [a, b].map(|pose| {
        let chain = pose_skeleton(&model.parents, &model.joints, &pose.rotations);
        chain.world.iter().map(|g| g.translation + pose.translation).collect::<Vec<DVec3>>()
    });
    let [a, b] = places;
    a.iter().zip(&b).map(|(a, b)| a.distance(*b)).fold(0.0, larger)
}

fn ik(model: &HandModel) -> HandIk {
    HandIk::new(&RestSkeleton::of(model).unwrap())
}

/// Asserts that the joints of a pose are recovered to half a millimetre, and returns the recovered pose.
fn found_again(model: &HandModel, ik: &HandIk, pose: &Pose, before: Option<&Pose>, what: &str) -> Pose {
    let solution = ik.solve(&ik.landmarks(pose), before).unwrap();
    let error = joint_error(model, pose, &solution.pose);
    assert!(error < 5e-4, "{}, {what}: {:.2} mm, residual {:.2} mm", model.name, error * 1e3, solution.residual * 1e3);
    solution.pose
}

#[test]
fn every_named_pose_is_found_from_rest_under_any_rotation() {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let half_turns =
        [DVec3::X, DVec3::Y, DVec3::Z, DVec3::new(1.0, 1.0, 0.0).normalize()].map(|axis| axis * std::f64::consts::PI);
    for model in hands() {
        let ik = ik(&model);
        for name in POSE_NAMES {
            let turns = half_turns.into_iter().chain([DVec3::ZERO]).chain((0..3).map(|_| vector(&mut rng, 3.0)));
            for turn in turns.collect::<Vec<_>>() {
                let mut pose = named_pose(name, &model).unwrap();
                pose.rotations[0] = turn;
                pose.translation = vector(&mut rng, 1.0);
                found_again(&model, &ik, &pose, None, &format!("{name} turned by {turn}"));
            }
        }
    }
}

#[test]
fn natural_poses_are_found_with_and_without_the_previous_frame() {
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    for model in hands() {
        let ik = ik(&model);
        for k in 0..40 {
            found_again(&model, &ik, &natural_pose(&model, &mut rng), None, &format!("pose {k}"));
        }
    }
    // The synthetic capture bends thumbs about other axes than the named poses do.
    let model = procedural(Side::Right);
    let ik = ik(model);
    let mut before: Option<Pose> = None;
    for (k, pose) in natural_motion(60, 5).iter().enumerate() {
        before = Some(found_again(model, &ik, pose, before.as_ref(), &format!("frame {k}")));
        found_again(model, &ik, pose, None, &format!("frame {k}, cold"));
    }
}

#[test]
fn the_pose_comparison_rejects_another_pose_and_numbers_that_are_not_finite() {
    let model = procedural(Side::Right);
    let fist = named_pose("fist", model).unwrap();
    let mut other = fist.clone();
    other.rotations[5] += DVec3::new(0.0, 0.0, 0.05);
    assert!(joint_error(model, &fist, &fist) == 0.0 && joint_error(model, &fist, &other) > 5e-4);
    other.rotations[5] = DVec3::NAN;
    assert!(joint_error(model, &fist, &other).is_nan());
}

#[test]
fn crossed_fingers_are_found() {
    for model in hands() {
        let mut pose = named_pose("point", &model).unwrap();
        let rig = RestSkeleton::of(&model).unwrap();
        let joint = |finger, k| rig.joint(JointRole::Bend(finger, k)).unwrap();
        // The middle finger bends a little and crosses the index finger.
        for (finger, angles) in [(Finger::Index, [0.1, -0.2, 0.0]), (Finger::Middle, [0.35, 0.3, 0.0])] {
            let k = joint(finger, 1);
            pose.rotations[k] = rig.axes[k].rotation(DVec3::from_array(angles));
            for j in 2..=3 {
                let k = joint(finger, j);
                pose.rotations[k] = rig.axes[k].rotation(DVec3::new(0.2, 0.0, 0.0));
            }
        }
        pose.rotations[0] = DVec3::new(0.3, -0.7, 1.1);
        found_again(&model, &ik(&model), &pose, None, "crossed fingers");
    }
}

#[test]
fn every_pose_within_the_anatomical_limits_is_found_from_rest() {
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    for model in [procedural(Side::Right), procedural(Side::Left)] {
        let ik = ik(model);
        for k in 0..100 {
            found_again(model, &ik, &random_pose(model, &mut rng).unwrap(), None, &format!("random pose {k}"));
        }
    }
}

#[test]
fn the_mirrored_hand_is_found_from_mirrored_landmarks() {
    let (right, left) = (procedural(Side::Right), procedural(Side::Left));
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    for _ in 0..10 {
        let pose = natural_pose(right, &mut rng);
        let seen = ik(right).landmarks(&pose).map(mirrored_point);
        let solution = ik(left).solve(&seen, None).unwrap();
        let error = joint_error(left, &pose.mirrored(), &solution.pose);
        assert!(error < 5e-4, "{error}");
    }
}

#[test]
fn noise_of_five_millimetres_leaves_a_natural_hand_near_the_truth() {
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    for model in hands() {
        let ik = ik(&model);
        let mut errors = vec![];
        let mut angles = vec![];
        let mut steps = vec![];
        let mut before = None;
        for _ in 0..60 {
            let pose = natural_pose(&model, &mut rng);
            // Uniform within +-8.66 mm has a standard deviation of 5 mm.
            let noisy = ik.landmarks(&pose).map(|p| p + vector(&mut rng, 0.00866));
            let solution = ik.solve(&noisy, before.as_ref()).unwrap();
            for (k, (joint, axes)) in ik.hinges.iter().enumerate() {
                let components = axes.angles(solution.pose.rotations[*joint]).to_array();
                for (value, range) in components.iter().zip(&ik.ranges[3 * k..]) {
                    let slack = 1e-9;
                    assert!((range.low - slack..=range.high + slack).contains(value), "{value} is outside {range:?}");
                }
                let [a, b] = [&pose, &solution.pose].map(|p| rotation_from_axis_angle(p.rotations[*joint]));
                angles.push(axis_angle_from_rotation(&(a.transpose() * b)).length().to_degrees());
            }
            errors.push(joint_error(&model, &pose, &solution.pose));
            steps.push(solution.steps as f64);
            before = Some(solution.pose);
        }
        let error = median(errors.clone());
        let angle = median(angles.clone());
        // Not close to the truth, or not a number.
        let far = angles.iter().filter(|angle| !(**angle <= 60.0)).count();
        println!(
            "{}: worst joint {:.1} mm (median), angles {angle:.1} (median), {far} joints far off, {} steps",
            model.name,
            error * 1e3,
            median(steps)
        );
        // Of 900 joints, one or two may bend quite differently. A landmark is off by 8.7 mm, the square root of three times 5
        // mm: the worst joint is no further off than that, plus a little for the metacarpals' ends, which have no
        // landmark.
        assert!(error < 0.010 && angle < 12.0 && far <= 2, "{error} {angle} {far}");
    }
}

#[test]
fn hands_of_other_sizes_and_proportions_are_fitted_with_the_same_rotations() {
    let model = procedural(Side::Right);
    let ik = ik(model);
    let mut rng = ChaCha8Rng::seed_from_u64(6);
    let poses: Vec<Pose> = (0..12).map(|_| natural_pose(model, &mut rng)).collect();
    // A child's hand with long fingers.
    let mut other = ik.clone();
    let rest = ik.landmarks.map(|joint| ik.joints[joint]);
    for joint in &mut other.joints {
        *joint = rest[0] + 0.7 * (*joint - rest[0]);
    }
    for finger in 1..5 {
        for k in 2..=4 {
            let (from, to) = (4 * finger + k - 1, 4 * finger + k);
            other.joints[ik.landmarks[to]] = other.joints[ik.landmarks[from]] + 0.8 * (rest[to] - rest[from]);
        }
    }
    let seen: Vec<[DVec3; LANDMARK_COUNT]> = poses.iter().map(|pose| other.landmarks(pose)).collect();
    let fitted = ik.fitted(&seen);
    for (pose, seen) in poses.iter().zip(&seen) {
        let solution = fitted.solve(seen, None).unwrap();
        assert!(solution.residual < 5e-4, "{}", solution.residual);
        let error = joint_error(model, pose, &solution.pose);
        assert!(error < 3e-3, "{error}");
        // Without fitting, the hand is far too large.
        assert!(ik.solve(seen, None).unwrap().residual > 3e-3);
    }
    // A few frames determine only the size.
    let few: Vec<_> = poses.iter().take(2).map(|pose| ik.landmarks(pose).map(|p| p * 0.8)).collect();
    let solution = ik.fitted(&few).solve(&few[0], None).unwrap();
    assert!(solution.residual < 1e-4, "{}", solution.residual);
}

#[test]
fn landmarks_that_are_not_a_hand_have_no_pose() {
    let model = procedural(Side::Right);
    let ik = ik(model);
    let good = ik.landmarks(&Pose::rest(16));
    let mut nan = good;
    nan[7].y = f64::NAN;
    assert!(ik.solve(&nan, None).is_none() && ik.solve(&good.map(|_| DVec3::ONE), None).is_none());
    assert!(ik.solve(&good.map(|p| DVec3::X * p.x), None).is_none());
    // Squares of such lengths overflow; no result is acceptable, too.
    assert!(ik.solve(&good.map(|p| p * 1e200), None).is_none_or(|solution| solution.pose.translation.is_finite()));
    // Finite points give a finite pose or none.
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    for _ in 0..30 {
        let size = 10f64.powi(rng.random_range(-6..6));
        let points = std::array::from_fn(|_| vector(&mut rng, size));
        if let Some(solution) = ik.solve(&points, None) {
            assert!(solution.pose.rotations.iter().all(|r| r.is_finite()) && solution.pose.translation.is_finite());
        }
    }
}

#[test]
fn a_jacobian_matches_finite_differences() {
    for model in [Some(procedural(Side::Right).clone()), generic(Side::Left)].into_iter().flatten() {
        let ik = ik(&model);
        let mut rng = ChaCha8Rng::seed_from_u64(8);
        let landmarks = ik.landmarks(&natural_pose(&model, &mut rng));
        let fit = Fit { hand: &ik, landmarks: &landmarks };
        let x = ik.unknowns(&natural_pose(&model, &mut rng));
        let (_, gradient) = fit.normal_equations(&x);
        let check = |k: usize, scale: f64| {
            let at = |by: f64| {
                let mut moved = x;
                moved[k] += by;
                fit.squares(&moved)
            };
            let difference = (at(1e-6) - at(-1e-6)) / 2e-6;
            // Differences of this width are accurate to about 1e-9 for squares of some decimetres.
            (difference - 2.0 * scale * gradient[k]).abs() <= 1e-6
        };
        assert!((0..UNKNOWNS).all(|k| check(k, 1.0)));
        assert!(!(0..UNKNOWNS).all(|k| check(k, 1.001)));
    }
}

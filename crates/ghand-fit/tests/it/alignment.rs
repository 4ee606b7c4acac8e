//! Alignment of captures with known truth.

use crate::common::{errors, exact, exact_alignment, first, make, poses, small_options};
use ghand_capture::Capture;
use ghand_core::Pose;
use ghand_core::pose_error::{moving_joints, pose_error_degrees};
use ghand_core::rotation::{axis_angle_from_rotation, rotation_from_axis_angle};
use ghand_fit::alignment::shape_fit::fit_shape;
use ghand_fit::alignment::single_frames::{SingleFrame, align_single_frames};
use ghand_fit::alignment::{Alignment, AlignmentError, align};
use ghand_synthetic::SyntheticOptions;
use ghand_test_support::cases;
use glam::DVec3;

#[test]
fn contours_correct_poses_and_proportions_of_other_hands() {
    assert_corrected(exact(), exact_alignment());
    if cases(false, true) {
        let (capture, _folder) = make(&small_options(11));
        assert_corrected(&capture, &align(&capture, capture.split("train").unwrap(), None, &mut |_, _| true).unwrap());
    }
}

fn assert_corrected(capture: &Capture, aligned: &Alignment) {
    let split = capture.split("train").unwrap();
    for view in &split.views {
        let alpha = capture.load_view(view.camera, view.frame).unwrap().rgba;
        let mask = capture.load_hand_mask(view.camera, view.frame).unwrap();
        assert!(alpha.iter().map(|pixel| pixel[3] == 255).eq(mask), "the mask alone is another one");
    }
    let [given, truth] = poses(capture, split);
    let [before, after] = [&given, &aligned.poses].map(|poses| errors(poses, &truth));
    println!("{before:.2?} -> {after:.2?} degrees and mm, {:.2?}", aligned.fit);
    assert!(after[0] < 0.75 * before[0] && after[1] < 0.75 * before[1], "{before:?} {after:?}");
    let [before, after] = aligned.fit;
    assert!(after.contours[0] < 0.7 && after.contours[0] < 0.5 * before.contours[0], "{:?}", aligned.fit);
    assert!(aligned.rejection.is_none() && aligned.kept.is_empty(), "{:?} {:?}", aligned.fit, aligned.kept);
}

#[test]
fn hands_in_large_images_are_aligned_as_well_as_in_small_ones() {
    let options = SyntheticOptions { train_frames: 4, ..small_options(3) };
    let of_size = |times: u32| {
        let (capture, _folder) = make(&SyntheticOptions { width: times * 128, height: times * 192, ..options.clone() });
        let split = capture.split("train").unwrap();
        let aligned = align(&capture, split, None, &mut |_, _| true).unwrap();
        let [given, truth] = poses(&capture, split);
        println!("{times} times: {:.2?} to {:.2?}", errors(&given, &truth), errors(&aligned.poses, &truth));
        assert!(aligned.rejection.is_none(), "{:?}", aligned.rejection);
        (errors(&aligned.poses, &truth), aligned.fit)
    };
    let (small, [_, fit]) = of_size(1);
    let (large, [_, large_fit]) = of_size(cases(5, 10));
    assert!(large[0] < 1.1 * small[0] && large[1] < small[1] + 0.2, "{large:?} {small:?}");
    // Distances are told in pixels of the images as they are.
    let part = large_fit.mask_size / fit.mask_size / f64::from(cases(5_u32, 10));
    assert!((0.98..1.02).contains(&part), "{large_fit:?} {fit:?}");
    assert!(large_fit.contours[0] > fit.contours[0], "{large_fit:?} {fit:?}");
}

#[test]
fn one_thread_gives_the_same_bits() {
    let split = first(exact().split("train").unwrap(), cases(3, 6), cases(3, 8));
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| align(exact(), &split, None, &mut |_, _| true)).unwrap()
    };
    let [one, two] = [1, 2].map(with);
    assert!(one.poses == two.poses && one.template == two.template);
}

#[test]
fn single_frames_are_aligned_to_a_known_template_each_for_itself() {
    let (capture, template) = (exact(), &exact_alignment().template);
    let split = capture.split("train").unwrap();
    let [given, truth] = poses(capture, split);
    let frame = |(frame, pose): (&usize, &Pose)| SingleFrame {
        frame: *frame,
        cameras: split.cameras.clone(),
        pose: pose.clone(),
    };
    let frames: Vec<SingleFrame> = split.frames.iter().zip(&given).map(frame).collect();
    let found = align_single_frames(capture, template, None, &frames).unwrap();
    let [before, after] = [&given, &found].map(|poses| errors(poses, &truth));
    println!("{before:.2?} -> {after:.2?} degrees and mm");
    assert!(after[0] < before[0] && after[1] < 0.75 * before[1], "{before:?} {after:?}");
    let alone = align_single_frames(capture, template, None, &frames[2..3]).unwrap();
    assert!(alone[0] == found[2], "other frames have a part in it");
}

#[test]
fn frames_without_masks_keep_their_poses_and_a_caller_may_stop() {
    let (capture, folder) = make(&small_options(5));
    let split = capture.split("train").unwrap();
    // In one frame every mask is empty; in another one is full.
    for camera in 0..6 {
        let empty = capture.mask_file(split.cameras[camera], split.frames[2]).unwrap().unwrap();
        image::GrayImage::new(128, 192).save(empty).unwrap();
    }
    let full = capture.mask_file(split.cameras[0], split.frames[4]).unwrap().unwrap();
    image::GrayImage::from_pixel(128, 192, image::Luma([255])).save(full).unwrap();
    let [given, truth] = poses(&capture, split);
    let aligned = align(&capture, split, None, &mut |_, _| true).unwrap();
    let moving = moving_joints(&given);
    let error =
        |poses: &[Pose], frame: usize| pose_error_degrees(&poses[frame..=frame], &truth[frame..=frame], &moving);
    assert!(error(&aligned.poses, 2) < 1.3 * error(&given, 2), "{}", error(&aligned.poses, 2));
    assert!(error(&aligned.poses, 4) < error(&given, 4));
    let mut steps = 0;
    let stopped = align(&capture, split, None, &mut |_, _| {
        steps += 1;
        steps < 3
    });
    assert!(matches!(stopped, Err(AlignmentError::Stopped)) && steps == 3);
    drop(folder);
}

#[test]
#[ignore = "takes a minute; CAPTURE names a capture with truth"]
fn figures_of_a_capture() {
    let path = std::env::var("CAPTURE").unwrap();
    let capture = Capture::open(path.as_ref()).unwrap();
    let split = capture.split("train").unwrap().clone();
    let truth: Vec<Pose> = split.frames.iter().map(|f| capture.truth.as_ref().unwrap()[*f].clone().unwrap()).collect();
    let given: Vec<Pose> = split.frames.iter().map(|f| capture.frames[*f].pose.clone()).collect();
    let joints = truth[0].rotations.len();
    let moving: Vec<usize> = (0..joints).filter(|k| given.iter().any(|p| p.rotations[*k] != DVec3::ZERO)).collect();
    let figures = |poses: &[Pose]| {
        let off = |k: usize| -> Vec<DVec3> {
            let turn = |p: &Pose| rotation_from_axis_angle(p.rotations[k]);
            poses.iter().zip(&truth).map(|(p, t)| axis_angle_from_rotation(&(turn(p) * turn(t).transpose()))).collect()
        };
        let mut all = 0.0;
        let mut aligned = 0.0;
        for k in &moving {
            let off = off(*k);
            let mean = off.iter().sum::<DVec3>() / off.len() as f64;
            all += off.iter().map(|o| o.length()).sum::<f64>() / off.len() as f64;
            aligned += off.iter().map(|o| (*o - mean).length()).sum::<f64>() / off.len() as f64;
        }
        let translation = poses.iter().zip(&truth).map(|(p, t)| p.translation.distance(t.translation)).sum::<f64>();
        let count = moving.len() as f64;
        format!(
            "{:.2} degrees, {:.2} less the mean, {:.2} mm",
            (all / count).to_degrees(),
            (aligned / count).to_degrees(),
            1e3 * translation / poses.len() as f64
        )
    };
    println!("given: {}", figures(&given));
    let start = std::time::Instant::now();
    let aligned = align(&capture, &split, None, &mut |text, poses| {
        println!("{:.1} s, {text}: {}", start.elapsed().as_secs_f64(), figures(poses));
        true
    })
    .unwrap();
    println!("{:?}, kept {:?}, {:.1} s", aligned.fit, aligned.kept, aligned.seconds);
    if let Some(texture) = &aligned.texture {
        println!("by contours alone: {}, with texture: {}", figures(&texture.contour_poses), figures(&aligned.poses));
        println!(
            "refined {} frames, kept {:?}, held out {:.5?}, variance factors {:.2?}",
            texture.refined.len(),
            texture.kept,
            texture.held_out,
            texture.variance_factors
        );
    }
    println!("by given poses and spreads alone: {}", figures(&aligned.prior_poses));
    // By joint: root mean square of the error over frames and axes, and what the alignment expects it to be.
    for k in &moving {
        let square = |(p, t): (&Pose, &Pose)| {
            let turn =
                rotation_from_axis_angle(p.rotations[*k]) * rotation_from_axis_angle(t.rotations[*k]).transpose();
            axis_angle_from_rotation(&turn).length_squared() / 3.0
        };
        let mean = aligned.poses.iter().zip(&truth).map(square).sum::<f64>() / truth.len() as f64;
        println!(
            "{:34} {:5.2} degrees, expected {:5.2}",
            capture.template.joint_names[*k],
            mean.sqrt().to_degrees(),
            aligned.uncertainty[*k].to_degrees()
        );
    }
}

#[test]
fn a_models_own_shape_and_poses_follow_the_outlines_from_a_hand_of_another_size() {
    let (capture, _folder) = make(&small_options(7));
    let split = capture.split("train").unwrap().clone();
    let [given, truth] = poses(&capture, &split);
    let sizes: Vec<f64> = [-0.6, 0.0]
        .into_iter()
        .take(cases(1, 2))
        .map(|size| {
            let mut capture = capture.clone();
            capture.take_shape(&[size]).unwrap();
            let found = fit_shape(&capture, &[&split]).unwrap();
            assert_eq!(found.rejection, None);
            let found_poses: Vec<Pose> = split.frames.iter().map(|frame| found.poses[*frame].clone()).collect();
            let [before, after] = [&given, &found_poses].map(|poses| errors(poses, &truth));
            println!("from {size}: size {:.2}, {before:.2?} to {after:.2?}", size + found.shape[0]);
            assert!(after[0] < 0.8 * before[0] && after[1] < 0.8 * before[1], "{before:?} {after:?}");
            assert_eq!(found.shape.len(), capture.hand_model.shape_count());
            size + found.shape[0]
        })
        .collect();
    // 0.0 is the capture's own; the person's bones are a little others.
    assert!(sizes.iter().all(|size| (size - sizes[0]).abs() < 0.2 && size.abs() < 0.4), "{sizes:?}");
}

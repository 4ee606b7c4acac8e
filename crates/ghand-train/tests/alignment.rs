//! Alignment of captures with known truth.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use ghand_capture::Capture;
use ghand_core::Pose;
use ghand_core::rotation::{axis_angle_from_rotation, rotation_from_axis_angle};
use ghand_train::alignment::align;
use glam::DVec3;

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
        let (mut all, mut aligned) = (0.0, 0.0);
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
    let aligned = align(&capture, &split, &mut |text, poses| {
        println!("{:.1} s, {text}: {}", start.elapsed().as_secs_f64(), figures(poses));
    })
    .unwrap();
    println!("contours {:?}", aligned.contours);
}

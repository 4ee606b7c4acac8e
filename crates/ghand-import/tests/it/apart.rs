//! Two hands near each other: whose pixels are whose, against their silhouettes.

use ghand_capture::mask::covered_pixels;
use ghand_core::posing::pose_hand;
use ghand_core::{Camera, Pose, Side};
use ghand_hand_model::builtin::builtin_hand;
use ghand_hand_model::named_poses::named_pose;
use ghand_import::apart::{MOST_OVERLAP, other_hands, overlap};
use ghand_import::track::{OtherHand, Sighting};
use ghand_motion::RestSkeleton;
use ghand_motion::ik::HandIk;
use glam::DVec3;

const SIZE: [usize; 2] = [640, 480];

/// A hand's silhouette, and its landmarks.
fn seen(side: Side, pose: &str, place: DVec3, camera: &Camera) -> (Vec<bool>, OtherHand) {
    let model = builtin_hand(side).unwrap();
    let mut pose: Pose = named_pose(pose, &model).unwrap();
    pose.translation += place;
    let vertices = pose_hand(&model, &[], &pose).unwrap().vertices;
    let points = HandIk::new(&RestSkeleton::of(&model).unwrap()).landmarks(&pose);
    let middle = points.iter().sum::<DVec3>() / 21.0;
    let other = OtherHand {
        pixels: points.map(|point| camera.project(point).0),
        world: points.map(|point| camera.rotation * (point - middle)),
    };
    (covered_pixels(camera, &vertices, &model.faces), other)
}

#[test]
fn pixels_of_hands_that_touch_are_told_apart_and_hands_that_cover_each_other_are_told() {
    // Palms face along x, fingers point along y.
    let camera = Camera::look_at(DVec3::new(0.6, -0.02, 0.06), DVec3::new(0.0, -0.02, 0.06), DVec3::Y, 0.7, 640, 480);
    let mut cases = [0usize; 2];
    for pose in ["rest", "fist", "point"] {
        let (own_shape, own) = seen(Side::Right, pose, DVec3::ZERO, &camera);
        for step in 0..12 {
            let place = DVec3::new(0.0, 0.01 * f64::from(step % 3), 0.018 * f64::from(step));
            let (shape, other) = seen(Side::Left, "rest", place, &camera);
            let pixels = || own_shape.iter().zip(&shape);
            let count = |is_it: &dyn Fn(bool, bool) -> bool| pixels().filter(|(a, b)| is_it(**a, **b)).count() as f64;
            let covered = count(&|own, other| own && other) / count(&|own, _| own);
            let OtherHand { pixels: at, world } = own.clone();
            let hand = Sighting { pixels: at, world, presence: 1.0, sharpness: 1.0, others: vec![other] };
            let told = overlap(&hand, SIZE);
            let found = other_hands(&hand, SIZE);
            let of = |is_it: &dyn Fn(bool, bool) -> bool| {
                let all = pixels().zip(&found).filter(|((a, b), _)| is_it(**a, **b));
                let cut = all.clone().filter(|(_, cut)| **cut).count();
                cut as f64 / all.count().max(1) as f64
            };
            let (others_cut, own_cut) = (of(&|own, other| other && !own), of(&|own, other| own && !other));
            println!(
                "{pose} {step}: covered {covered:.3}, told {told:.3}; cut {others_cut:.3} of the other, {own_cut:.4} of it"
            );
            if covered > 0.12 {
                assert!(told > MOST_OVERLAP, "{pose} {step}: {covered} {told}");
                cases[0] += 1;
            }
            if told < MOST_OVERLAP {
                assert!(covered < 0.08 && others_cut > 0.97 && own_cut < 0.02, "{pose} {step}");
                cases[1] += 1;
            }
        }
    }
    assert!(cases.iter().all(|count| *count >= 6), "{cases:?}");
}

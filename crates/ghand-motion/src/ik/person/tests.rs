use ghand_core::rotation::axis_angle_from_rotation;
use ghand_core::{HandModel, Side};
use ghand_hand_model::builtin::builtin_hand;
use ghand_synthetic::hand::trajectory::natural_motion;
use glam::{DMat3, DVec2};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::camera_freedom::UsualFocal;
use super::sightings::{Sighting, SightingPosition, WRONG};
use super::*;
use crate::image_landmarks::MEDIAPIPE_BESIDE;
use crate::rest_skeleton::RestSkeleton;

/// Landmarks of a person of known lengths in known poses.
struct Person {
    proportions: Proportions,
    truth: HandIk,
    poses: Vec<Pose>,
}

/// Standard deviations of the built-in hand's shapes that change lengths, as in the synthetic capture's persons.
const SHAPES: [(&str, f64); 4] = [("finger-length", 0.5), ("hand-scale", 0.6), ("macro-1", 1.0), ("macro-2", 1.0)];
/// Bones differ by up to this beyond the shape.
const BONE_RANGE: f64 = 0.1;
const FRAMES: usize = 60;
/// The frame of which all landmarks are wrong.
const WRONG_FRAME: usize = 33;

fn model() -> HandModel {
    builtin_hand(Side::Right).unwrap()
}

fn normal(rng: &mut ChaCha8Rng) -> f64 {
    // Twelve uniform numbers: near enough to a normal one.
    (0..12).map(|_| rng.random_range(-0.5..0.5)).sum()
}

fn person(seed: u64, tip_inset: f64) -> Person {
    person_seen(&model(), seed, tip_inset, &[])
}

fn person_seen(model: &HandModel, seed: u64, tip_inset: f64, beside: &[(usize, DVec3)]) -> Person {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let proportions = Proportions::new(model, tip_inset, beside).unwrap();
    let mut shape = vec![0.0; model.shape_count()];
    for (name, deviation) in SHAPES {
        shape[model.shape_names.iter().position(|known| known == name).unwrap()] = deviation * normal(&mut rng);
    }
    let mut parameters = proportions.parameters_of(&shape);
    let bones = proportions.count() - BONES.len();
    parameters[bones..].iter_mut().for_each(|bone| *bone = rng.random_range(-BONE_RANGE..BONE_RANGE));
    let truth = proportions.hand(&parameters);
    Person { poses: natural_motion(model, FRAMES, seed), truth, proportions }
}

fn vector(rng: &mut ChaCha8Rng, deviation: f64) -> DVec3 {
    DVec3::from_array([0; 3].map(|_| deviation * normal(rng)))
}

impl Person {
    /// Landmarks in space with noise of 3 mm, one in twenty 5 cm off, and a frame of which all are wrong.
    fn in_space(&self, rng: &mut ChaCha8Rng) -> Vec<SeenFrame> {
        self.seen(rng, |rng, landmark, at, is_wrong_frame| {
            let is_wrong = rng.random::<f64>() < 0.05;
            let off = if is_wrong { 0.05 * vector(rng, 1.0).normalize_or(DVec3::X) } else { vector(rng, 0.003) };
            let at = if is_wrong_frame { at + vector(rng, 0.06) } else { at + off };
            vec![Sighting { landmark, confidence: 1.0, place: SightingPosition::Point(at) }]
        })
    }

    /// Landmarks in images with noise of 2 pixels, one in twenty 100 pixels off, and a frame of which all are wrong.
    fn in_images(&self, rng: &mut ChaCha8Rng, cameras: &[Camera]) -> Vec<SeenFrame> {
        self.seen(rng, |rng, landmark, at, is_wrong_frame| {
            let mut sighting = |(number, camera): (usize, &Camera)| {
                let mut plane = |deviation: f64| DVec2::new(normal(rng), normal(rng)) * deviation;
                let noise = if is_wrong_frame { plane(60.0) } else { plane(2.0) };
                let off = 100.0 * plane(1.0).normalize_or(DVec2::X);
                let is_wrong = rng.random::<f64>() < 0.05;
                let pixel = camera.project(at).0 + if is_wrong { off } else { noise };
                Sighting { landmark, confidence: 1.0, place: SightingPosition::Pixel(number, pixel) }
            };
            cameras.iter().enumerate().map(&mut sighting).collect()
        })
    }

    fn seen(
        &self,
        rng: &mut ChaCha8Rng,
        mut sightings: impl FnMut(&mut ChaCha8Rng, usize, DVec3, bool) -> Vec<Sighting>,
    ) -> Vec<SeenFrame> {
        let frame = |(k, pose): (usize, &Pose)| {
            let places = self.truth.landmarks(pose);
            let sightings =
                places.iter().enumerate().flat_map(|(i, at)| sightings(rng, i, *at, k == WRONG_FRAME)).collect();
            SeenFrame { id: format!("{k}"), sightings }
        };
        self.poses.iter().enumerate().map(frame).collect()
    }

    /// Relative error of a bone's length, root mean square, and of the sum of all.
    fn length_errors(&self, hand: &HandIk) -> (f64, f64) {
        let found = self.proportions.lengths(hand);
        let truth = self.proportions.lengths(&self.truth);
        let squares = found.iter().zip(&truth).map(|(a, b)| (a / b - 1.0).powi(2)).sum::<f64>();
        let sum = found.iter().sum::<f64>() / truth.iter().sum::<f64>() - 1.0;
        ((squares / found.len() as f64).sqrt(), sum.abs())
    }

    /// Root mean square distance of the landmarks of poses from the true ones, metres, without the wrong frame.
    fn pose_error<'a>(&self, hand: &HandIk, poses: impl Iterator<Item = &'a Pose>) -> f64 {
        let squares: Vec<f64> = (self.poses.iter().zip(poses).enumerate())
            .filter(|(k, _)| *k != WRONG_FRAME)
            .flat_map(|(_, (truth, found))| {
                let truth = self.truth.landmarks(truth);
                let found = hand.landmarks(found);
                truth.into_iter().zip(found).map(|(a, b)| a.distance_squared(b)).collect::<Vec<f64>>()
            })
            .collect();
        (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
    }
}

fn cameras(count: usize) -> Vec<Camera> {
    let eyes = [DVec3::new(0.5, -0.2, -0.5), DVec3::new(-0.5, -0.2, -0.5), DVec3::new(0.1, -0.7, 0.3)];
    let at = DVec3::new(0.04, 0.0, 0.0);
    let camera = |(number, eye): (usize, &DVec3)| {
        let eye = at + *eye;
        Camera { id: format!("cam{number}"), ..Camera::look_at(eye, at, DVec3::NEG_Y, 0.75, 720, 720) }
    };
    eyes.iter().take(count).enumerate().map(camera).collect()
}

fn poses(fit: &PersonFit) -> Vec<Pose> {
    fit.frames.iter().map(|frame| frame.as_ref().unwrap().pose.clone()).collect()
}

fn wrong_part(frame: &FittedFrame, noise: f64) -> f64 {
    let wrong = frame.distances.iter().filter(|distance| **distance > WRONG * noise).count();
    wrong as f64 / frame.distances.len() as f64
}

#[test]
fn lengths_and_poses_come_back_from_noisy_landmarks_with_wrong_ones() {
    for seed in 0..4 {
        let person = person(seed, 0.006);
        let mut rng = ChaCha8Rng::seed_from_u64(100 + seed);
        let seen = person.in_space(&mut rng);
        let fit = fit_person(&person.proportions, &seen, &[]);
        let hand = person.proportions.hand(&fit.parameters);
        let (bone, sum) = person.length_errors(&hand);
        let error = person.pose_error(&hand, poses(&fit).iter());
        // The hand before: lengths as medians over the frames, poses by least squares.
        let points: Vec<_> = seen.iter().map(|frame| frame.points().unwrap()).collect();
        let before = HandIk::new(&RestSkeleton::of(&model()).unwrap());
        let by_medians = before.fitted(&points);
        let solved = |hand: &HandIk| points.iter().map(|p| hand.solve(p, None).unwrap().pose).collect::<Vec<Pose>>();
        let median_error = person.pose_error(&by_medians, solved(&by_medians).iter());
        let unfitted_error = person.pose_error(&before, solved(&before).iter());
        // The shape alone has the person's size, and is one that people have.
        let alone = person.proportions.hand(&person.proportions.without_bones(&fit.parameters));
        let (_, size) = person.length_errors(&alone);
        let shape = person.proportions.shape(&fit.parameters);
        assert!(size < 0.02 && shape.iter().all(|value| value.abs() < 3.0), "{size} {shape:?}");
        println!(
            "person {seed}: bones {:.1} %, sum {:.2} %, joints {:.1} mm ({:.1} by medians and least squares, {:.1} \
             unfitted), noise {:.1} mm",
            100.0 * bone,
            100.0 * sum,
            1e3 * error,
            1e3 * median_error,
            1e3 * unfitted_error,
            1e3 * fit.noise
        );
        assert!(bone < 0.035 && sum < 0.01, "{bone} {sum}");
        assert!(error < 0.7 * median_error && error < 0.7 * unfitted_error, "{error} {median_error} {unfitted_error}");
        // Medians are no help with bones: noise makes them longer.
        assert!(person.length_errors(&by_medians).0 > bone);
        assert!((0.002..0.0045).contains(&fit.noise), "{}", fit.noise);
        let parts = fit.frames.iter().map(|frame| wrong_part(frame.as_ref().unwrap(), fit.noise));
        for (k, part) in parts.enumerate() {
            assert_eq!(part > 0.4, k == WRONG_FRAME, "frame {k}: {part}");
        }
    }
}

#[test]
fn lengths_and_poses_come_back_from_the_images_of_two_cameras() {
    for seed in 0..3 {
        let person = person(seed, 0.006);
        let cameras = cameras(2);
        let seen = person.in_images(&mut ChaCha8Rng::seed_from_u64(200 + seed), &cameras);
        let fit = fit_person(&person.proportions, &seen, &cameras);
        let hand = person.proportions.hand(&fit.parameters);
        let (bone, sum) = person.length_errors(&hand);
        let error = person.pose_error(&hand, poses(&fit).iter());
        println!(
            "person {seed}: bones {:.1} %, sum {:.2} %, joints {:.1} mm, noise {:.1} mm",
            100.0 * bone,
            100.0 * sum,
            1e3 * error,
            1e3 * fit.noise
        );
        assert!(bone < 0.035 && sum < 0.01, "{bone} {sum}");
        // Two pixels are 1.6 mm at the hand.
        assert!(error < 0.003, "{error}");
        for (k, frame) in fit.frames.iter().enumerate() {
            let part = wrong_part(frame.as_ref().unwrap(), fit.noise);
            assert_eq!(part > 0.4, k == WRONG_FRAME, "frame {k}: {part}");
        }
    }
}

/// The turn of the second camera relative to the first one, and its place in the first one's axes, without a unit of length.
fn relative(cameras: &[Camera]) -> (DMat3, DVec3) {
    let place = cameras[0].camera_from_world(cameras[1].center());
    (cameras[1].rotation * cameras[0].rotation.transpose(), place.normalize())
}

#[test]
fn cameras_come_back_together_with_the_hand() {
    for seed in 0..2 {
        let person = person(seed, 0.006);
        let truth = cameras(2);
        let seen = person.in_images(&mut ChaCha8Rng::seed_from_u64(200 + seed), &truth);
        let off = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -0.05, 0.08, -0.06, 0.05, 0.03, -0.04, 0.05, -0.08];
        let start = CameraFreedom::moved(&truth, &off);
        let usual = UsualFocal { pixels: 650.0, deviation: UsualFocal::UNSTATED };
        let freedom = CameraFreedom { usual_focals: vec![usual; 2], focals_are_known: false };
        let angle = |cameras: &[Camera]| {
            let ((turn, place), (true_turn, true_place)) = (relative(cameras), relative(&truth));
            let between = axis_angle_from_rotation(&(turn * true_turn.transpose())).length();
            (between.to_degrees(), place.angle_between(true_place).to_degrees())
        };
        let fit = fit_person_and_cameras(&person.proportions, &seen, &start, Some(&freedom));
        let zooms: Vec<f64> = fit.cameras.iter().zip(&truth).map(|(a, b)| a.focal.x / b.focal.x - 1.0).collect();
        let (turn, place) = angle(&fit.cameras);
        println!(
            "person {seed}: turn {turn:.2}, place {place:.2} degrees, focals {zooms:.3?}, at first {:?}",
            angle(&start)
        );
        // At first the second camera is turned by 6.4 degrees, and focal lengths are 5 and 8 % off.
        assert!(turn < 1.0 && place < 1.0 && zooms.iter().all(|zoom| zoom.abs() < 0.04), "{turn} {place} {zooms:?}");
        assert!(fit.cameras[0].center().distance(truth[0].center()) < 1e-9);
    }
}

#[test]
fn one_camera_gives_the_pose_and_keeps_the_mean_size() {
    let mut person = person(5, 0.006);
    // The person is the model: the size cannot be seen.
    person.truth = person.proportions.hand(&vec![0.0; person.proportions.count()]);
    let cameras = cameras(1);
    let seen = person.in_images(&mut ChaCha8Rng::seed_from_u64(300), &cameras);
    let fit = fit_person(&person.proportions, &seen, &cameras);
    let hand = person.proportions.hand(&fit.parameters);
    let (_, sum) = person.length_errors(&hand);
    // In the image, and in space but for where the hand is.
    let mut pixels = vec![];
    let mut metres = vec![];
    for (truth, found) in person.poses.iter().zip(poses(&fit)) {
        let truth = person.truth.landmarks(truth);
        let found = hand.landmarks(&found);
        let mean = |places: &[DVec3; LANDMARK_COUNT]| places.iter().sum::<DVec3>() / LANDMARK_COUNT as f64;
        let moved = mean(&truth) - mean(&found);
        for (a, b) in truth.into_iter().zip(found) {
            pixels.push(cameras[0].project(a).0.distance(cameras[0].project(b).0));
            metres.push(a.distance(b + moved));
        }
    }
    let pixels = median(pixels);
    let metres = median(metres);
    println!("sum {:.2} %, {pixels:.1} px, {:.1} mm", 100.0 * sum, 1e3 * metres);
    // The size is within half a standard deviation of adults'.
    assert!(sum < 0.03 && pixels < 2.5 && metres < 0.008, "{sum} {pixels} {metres}");
}

#[test]
fn frames_without_some_cameras_and_landmarks_are_fitted() {
    let person = person(6, 0.0);
    let cameras = cameras(3);
    let mut rng = ChaCha8Rng::seed_from_u64(400);
    let mut seen = person.in_images(&mut rng, &cameras);
    for (k, frame) in seen.iter_mut().enumerate() {
        // One camera sees only every third frame, another one not the thumb.
        frame.sightings.retain(|sighting| match sighting.place {
            SightingPosition::Pixel(2, _) => k % 3 == 0,
            SightingPosition::Pixel(1, _) => !(1..=4).contains(&sighting.landmark),
            _ => true,
        });
    }
    let fit = fit_person(&person.proportions, &seen, &cameras);
    let hand = person.proportions.hand(&fit.parameters);
    let (bone, sum) = person.length_errors(&hand);
    let error = person.pose_error(&hand, poses(&fit).iter());
    println!("bones {:.1} %, sum {:.2} %, joints {:.1} mm", 100.0 * bone, 100.0 * sum, 1e3 * error);
    // A thumb that one camera sees is only as near as its lengths say.
    assert!(bone < 0.035 && sum < 0.015 && error < 0.008, "{bone} {sum} {error}");
}

#[test]
fn the_same_landmarks_give_the_same_bits() {
    let person = person(7, 0.006);
    let cameras = cameras(2);
    let seen = person.in_images(&mut ChaCha8Rng::seed_from_u64(500), &cameras);
    let fits = [0; 2].map(|_| fit_person(&person.proportions, &seen[..20], &cameras));
    assert_eq!(fits[0].parameters, fits[1].parameters);
    assert_eq!(poses(&fits[0]), poses(&fits[1]));
}

#[test]
fn a_frame_of_pixels_has_the_derivative_of_its_cost() {
    let person = person(8, 0.006);
    let cameras = cameras(2);
    let seen = person.in_images(&mut ChaCha8Rng::seed_from_u64(600), &cameras).remove(0);
    let x = person.truth.unknowns(&person.poses[1]);
    let scales = scales_of(&person.truth, &x, &cameras);
    let fit = FrameFit { hand: &person.truth, seen: &seen, cameras: &cameras, scales: &scales, noise: 0.003 };
    let (_, gradient, stays) = equations(&fit, &x, 1.0);
    let check = |k: usize, scale: f64| {
        let at = |by: f64| {
            let mut moved = x;
            moved[k] += by;
            fit.cost(&moved)
        };
        let difference = (at(1e-6) - at(-1e-6)) / 2e-6;
        stays[k] || (difference - 2.0 * scale * gradient[k]).abs() <= 1e-4 * gradient[k].abs() + 1e-3
    };
    assert!((0..UNKNOWNS).all(|k| check(k, 1.0)));
    assert!(!(0..UNKNOWNS).all(|k| check(k, 1.01)));
}

#[test]
fn one_wrong_landmark_moves_least_squares_but_not_this_fit() {
    let person = person(9, 0.0);
    let mut rng = ChaCha8Rng::seed_from_u64(700);
    let mut robust = 0.0f64;
    let mut squares = 0.0f64;
    for (k, pose) in person.poses.iter().take(20).enumerate() {
        let truth = person.truth.landmarks(pose);
        let mut points = truth.map(|at| at + vector(&mut rng, 0.001));
        let wrong = 1 + k;
        points[wrong] += 0.05 * vector(&mut rng, 1.0).normalize();
        let sighting = |(landmark, at): (usize, &DVec3)| Sighting {
            landmark,
            confidence: 1.0,
            place: SightingPosition::Point(*at),
        };
        let seen = SeenFrame { id: String::new(), sightings: points.iter().enumerate().map(sighting).collect() };
        let fit = FrameFit { hand: &person.truth, seen: &seen, cameras: &[], scales: &[], noise: 0.001 };
        let x = with_fingers_retried(&fit, first_pose(&fit, None).unwrap());
        let off = |pose: &Pose| {
            let found = person.truth.landmarks(pose);
            let right = (0..LANDMARK_COUNT).filter(|i| *i != wrong);
            (right.map(|i| found[i].distance_squared(truth[i])).sum::<f64>() / (LANDMARK_COUNT - 1) as f64).sqrt()
        };
        robust = robust.max(off(&person.truth.pose(&x)));
        squares = squares.max(off(&person.truth.solve(&points, None).unwrap().pose));
    }
    println!("right landmarks: {:.1} mm, by least squares {:.1} mm", 1e3 * robust, 1e3 * squares);
    assert!(robust < 0.004 && squares > 2.0 * robust, "{robust} {squares}");
}

#[test]
fn fingers_swapped_in_one_camera_are_taken_from_the_other() {
    let person = person(10, 0.006);
    let cameras = cameras(3);
    let mut seen = person.in_images(&mut ChaCha8Rng::seed_from_u64(800), &cameras);
    let swapped = [5, 20, 47];
    for k in swapped {
        for sighting in &mut seen[k].sightings {
            if matches!(sighting.place, SightingPosition::Pixel(1, _)) {
                // Index and middle finger.
                sighting.landmark = match sighting.landmark {
                    i @ 5..=8 => i + 4,
                    i @ 9..=12 => i - 4,
                    i => i,
                };
            }
        }
    }
    let fit = fit_person(&person.proportions, &seen, &cameras);
    let hand = person.proportions.hand(&fit.parameters);
    let found = poses(&fit);
    for k in swapped {
        let truth = person.truth.landmarks(&person.poses[k]);
        let found = hand.landmarks(&found[k]);
        let off = truth.iter().zip(&found).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
        println!("frame {k}: {:.1} mm", 1e3 * off);
        assert!(off < 0.012, "frame {k}: {off}");
    }
}

#[test]
fn landmarks_beside_their_joints_show_where_the_joints_are() {
    for side in [Side::Right, Side::Left] {
        let model = builtin_hand(side).unwrap();
        let person = person_seen(&model, 5, 0.006, &MEDIAPIPE_BESIDE);
        let rest = person.truth.landmarks(&Pose::rest(model.joint_count()));
        let joints = person.truth.joints.clone();
        // Nearer to the fingers, and on the thumb's side of its joint.
        assert!(rest[0].distance(rest[9]) < 0.95 * joints[0].distance(rest[9]));
        let thumb = joints[person.proportions.joint_of(1)];
        assert!((rest[1] - thumb).dot(rest[17] - rest[5]) < 0.0);
    }
    let person = person_seen(&model(), 5, 0.006, &MEDIAPIPE_BESIDE);
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let cameras = cameras(3);
    let seen = person.in_images(&mut rng, &cameras);
    let off = |proportions: &Proportions| {
        let found = poses(&fit_person(proportions, &seen, &cameras)).into_iter();
        let frames = found.zip(&person.poses).enumerate().filter(|(k, _)| *k != WRONG_FRAME);
        1e3 * median(frames.map(|(_, (found, truth))| found.translation.distance(truth.translation)).collect())
    };
    let [with, without] = [off(&person.proportions), off(&Proportions::new(&model(), 0.006, &[]).unwrap())];
    println!("wrist {with:.1} mm off, {without:.1} without");
    assert!(with < 3.0 && without > 1.5 * with, "{with} {without}");
}

#[test]
fn a_model_with_a_joint_in_the_wrong_place_does_not_distort_the_shape() {
    let person = person(11, 0.006);
    let truth = person.proportions.lengths(&person.truth);
    let found = from_lengths(&person.proportions, &truth);
    assert_eq!(found.len(), person.proportions.count());
    let shape = |parameters: &[f64]| person.proportions.shape(parameters);
    let lengths = person.proportions.lengths(&person.proportions.hand(&found));
    assert!(lengths.iter().zip(&truth).all(|(a, b)| (a / b - 1.0).abs() < 1e-9));
    // The thumb's first joint 15 mm further out, its second bone as much shorter.
    let mut moved = truth;
    moved[0] += 0.015;
    moved[1] -= 0.015;
    let other = from_lengths(&person.proportions, &moved);
    let change = shape(&found).iter().zip(shape(&other)).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    println!("the shape changes by {change:.2}");
    assert!(change < 0.5, "{change}");
}

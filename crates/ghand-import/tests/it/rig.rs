//! Cameras and clocks that the hand tells, against known ones.

use ghand_core::Camera;
use ghand_import::clocks;
use ghand_import::moments::moments;
use ghand_import::rig::lengths::{hand_length, lengths_of};
use ghand_import::solve::{Known, solve};
use ghand_import::track::Track;
use ghand_import::uneven::solve_with_times;
use ghand_motion::image_landmarks::{MEDIAPIPE_TIP_INSET, UsualFocal};
use ghand_test_support::{cases, long};
use glam::{DMat3, DVec3};

use crate::hands::{Motion, cameras, hand, lenses, track};

const OFFSETS: [f64; 4] = [0.0, 0.137, -0.41, 1.213];

fn tracks(cameras: &[Camera], rates: &[f64], noise: f64, seed: u64) -> Vec<Track> {
    let motion = Motion::new(seed);
    let one =
        |(k, camera)| track(&motion, camera, rates[k % rates.len()], 12.0, OFFSETS[k], noise, 100 * seed + k as u64);
    cameras.iter().enumerate().map(one).collect()
}

/// Focal lengths that no footage states.
fn usual(cameras: &[Camera]) -> Vec<UsualFocal> {
    cameras.iter().map(|camera| UsualFocal { pixels: camera.focal.x, deviation: UsualFocal::UNSTATED }).collect()
}

/// Of camera k relative to the first one: degrees of its turn, and metres of its place.
fn off(found: &[Camera], truth: &[Camera], k: usize) -> (f64, f64) {
    let turn = |cameras: &[Camera]| cameras[k].rotation * cameras[0].rotation.transpose();
    let place = |cameras: &[Camera]| cameras[0].camera_from_world(cameras[k].center());
    let between: DMat3 = turn(found) * turn(truth).transpose();
    let cosine = 0.5 * (between.x_axis.x + between.y_axis.y + between.z_axis.z - 1.0);
    let shift: DVec3 = place(found) - place(truth);
    (cosine.clamp(-1.0, 1.0).acos().to_degrees(), shift.length())
}

#[test]
fn movements_tell_the_clocks_to_a_frame() {
    let cameras = cameras(4);
    let tracks = tracks(&cameras, &[30.0, 25.0], 0.003, 1);
    for k in 1..4 {
        let found = clocks::offsets(&tracks[0], &tracks[k])[0];
        assert!((found.seconds - OFFSETS[k]).abs() < 0.04, "{k}: {found:?}");
    }
    // The other footage shows another motion.
    let other = track(&Motion::new(40), &cameras[1], 30.0, 12.0, 0.0, 0.003, 9);
    let wrong = clocks::offsets(&tracks[0], &other).first().map_or(0.0, |found| found.agreement);
    let right = clocks::offsets(&tracks[0], &tracks[1])[0].agreement;
    println!("agreement {right:.2}, of other motions {wrong:.2}");
    assert!(right > wrong + 0.2);
}

#[test]
fn repeated_gestures_tell_the_clock_by_where_the_hand_is() {
    let lengths = lengths_of(&hand(), MEDIAPIPE_TIP_INSET, &[]).unwrap();
    let truth = cameras(2);
    let unknown: Vec<Camera> =
        (truth.iter()).map(|c| ghand_import::rig::start::unknown_camera(&c.id, c.width, c.height)).collect();
    for seed in 1..=cases(1, 3) {
        // Fingers and wrist do the same every 3.5 s, while the hand wanders.
        let motion = Motion::repeated(seed, 3.5);
        let noise = |k: usize| 10 * seed + k as u64;
        let both: Vec<Track> =
            (0..2).map(|k| track(&motion, &truth[k], 30.0, 14.0, OFFSETS[k], 0.003, noise(k))).collect();
        let may_be = clocks::offsets(&both[0], &both[1]);
        assert!(may_be.len() > 1, "{may_be:?}");
        for (known, start) in [(Known::Nothing, &unknown), (Known::All, &truth)].into_iter().take(cases(1, 2)) {
            let found = solve(&both, &lenses(start), known, &usual(start), &lengths, None).unwrap();
            println!("{known:?}: {:.1} ms off", 1e3 * (found.rig.offsets[1] - OFFSETS[1]));
            assert!((found.rig.offsets[1] - OFFSETS[1]).abs() < 0.02, "{may_be:?} {:?}", found.rig.offsets);
        }
    }
}

#[test]
fn the_hand_alone_tells_cameras_and_clocks() {
    let lengths = lengths_of(&hand(), MEDIAPIPE_TIP_INSET, &[]).unwrap();
    let mut wrong = vec![];
    let all = [(2, 1, &[30.0][..]), (2, 2, &[30.0, 25.0]), (4, 3, &[30.0, 29.7])];
    for (count, seed, rates) in all.into_iter().take(cases(2, 3)) {
        let truth = cameras(count);
        let tracks = tracks(&truth, rates, 0.003, seed);
        let unknown: Vec<Camera> =
            (truth.iter()).map(|c| ghand_import::rig::start::unknown_camera(&c.id, c.width, c.height)).collect();
        let found = solve(&tracks, &lenses(&unknown), Known::Nothing, &usual(&unknown), &lengths, None).unwrap();
        // The hand's length is known.
        let mut cameras = found.rig.cameras.clone();
        let length = hand_length(&std::array::from_fn(|k| lengths[k] * found.rig.bones[k].exp()));
        cameras.iter_mut().for_each(|camera| camera.translation *= hand_length(&lengths) / length);
        for k in 0..count {
            let (degrees, metres) = off(&cameras, &truth, k);
            let zoom = found.rig.cameras[k].focal.x / truth[k].focal.x;
            let clock = found.rig.offsets[k] - OFFSETS[k];
            println!(
                "{count} cameras, {k}: {degrees:.2} degrees, {:.1} mm, focal {:+.1} %, clock {:.1} ms; noise {:.1} mm",
                1e3 * metres,
                1e2 * (zoom - 1.0),
                1e3 * clock,
                1e3 * found.noise,
            );
            let is_near = degrees < 1.5 && metres < 0.02 && (zoom - 1.0).abs() < 0.05 && clock.abs() < 0.004;
            wrong.extend((!is_near).then(|| format!("{count} cameras, camera {k}")));
        }
    }
    assert!(wrong.is_empty(), "{wrong:?}");
}

#[test]
fn focal_lengths_that_footage_states_place_cameras_with_different_lenses() {
    let lengths = lengths_of(&hand(), MEDIAPIPE_TIP_INSET, &[]).unwrap();
    let mut truth = cameras(2);
    // A phone's wide lens beside its usual one.
    truth[1].focal *= 0.55;
    let tracks = tracks(&truth, &[30.0], 0.003, 1);
    let found = |start: &[Camera], focals: &[UsualFocal]| {
        let found = solve(&tracks, &lenses(start), Known::Nothing, focals, &lengths, None).unwrap();
        let zooms = [0, 1].map(|k| (found.rig.cameras[k].focal.x / truth[k].focal.x).ln().abs());
        let (degrees, _) = off(&found.rig.cameras, &truth, 1);
        println!("{degrees:.2} degrees, focal lengths {zooms:.3?}");
        (degrees, zooms[0].max(zooms[1]))
    };
    let unknown: Vec<Camera> =
        (truth.iter()).map(|c| ghand_import::rig::start::unknown_camera(&c.id, c.width, c.height)).collect();
    let (_, unstated) = found(&unknown, &usual(&unknown));
    // Stated with errors as videos have them.
    let mut stated = truth.clone();
    stated[0].focal *= 1.05;
    stated[1].focal *= 0.94;
    let focals: Vec<UsualFocal> =
        stated.iter().map(|camera| UsualFocal { pixels: camera.focal.x, deviation: 0.1 }).collect();
    stated.iter_mut().zip(&unknown).for_each(|(camera, unknown)| {
        (camera.rotation, camera.translation) = (unknown.rotation, unknown.translation);
    });
    let (degrees, wrong) = found(&stated, &focals);
    assert!(degrees < 2.0 && wrong < 0.08 && unstated > 3.0 * wrong, "{degrees} {wrong} {unstated}");
}

#[test]
fn a_known_rig_keeps_its_place_and_tells_the_hands_size() {
    let lengths = lengths_of(&hand(), MEDIAPIPE_TIP_INSET, &[]).unwrap();
    let truth = cameras(2);
    let tracks = tracks(&truth, &[30.0], 0.003, 5);
    // As calibrated with a board whose squares, 43 mm long, are the unit.
    let mut squares = truth.clone();
    squares.iter_mut().for_each(|camera| camera.translation /= 0.043);
    let found = solve(&tracks, &lenses(&squares), Known::AllButTheUnit, &usual(&squares), &lengths, None).unwrap();
    let length = hand_length(&std::array::from_fn(|k| lengths[k] * found.rig.bones[k].exp())) * found.rig.size;
    let unit = hand_length(&lengths) / length;
    println!("one unit is {:.2} mm", 1e3 * unit);
    assert!((unit / 0.043 - 1.0).abs() < 0.03);
    let found = solve(&tracks, &lenses(&truth), Known::All, &usual(&truth), &lengths, None).unwrap();
    assert_eq!(found.rig.cameras, truth);
    let given = solve(&tracks, &lenses(&truth), Known::All, &usual(&truth), &lengths, Some(&OFFSETS[..2])).unwrap();
    assert!(given.rig.offsets == OFFSETS[..2] && (given.rig.size - found.rig.size).abs() < 0.01);
    assert!((found.rig.size - 1.0).abs() < 0.1 && (found.rig.offsets[1] - OFFSETS[1]).abs() < 0.003);
    assert!(hand_length(&lengths) > 0.16);
    let moments = moments(&tracks, &lenses(&truth), &found.rig.offsets, &tracks[0].times);
    assert!(moments.iter().filter(|moment| moment.iter().all(Option::is_some)).count() > 300);
}

/// How far the times of frames are off the true ones, seconds, root mean square.
fn lateness(track: &Track, truth: &[f64], offset: f64) -> f64 {
    let squares: f64 = track.times.iter().zip(truth).map(|(time, truth)| (time - truth - offset).powi(2)).sum();
    (squares / truth.len() as f64).sqrt()
}

#[test]
fn drift_and_lost_frames_are_found_and_corrected() {
    if !long() {
        return;
    }
    let lengths = lengths_of(&hand(), MEDIAPIPE_TIP_INSET, &[]).unwrap();
    let truth = cameras(3);
    let motion = Motion::new(3);
    let mut all: Vec<Track> =
        (0..3).map(|k| track(&motion, &truth[k], 30.0, 20.0, OFFSETS[k], 0.003, 60 + k as u64)).collect();
    let even = solve_with_times(&mut all.clone(), &lenses(&truth), Known::All, &usual(&truth), &lengths, None).unwrap();
    assert!(even.1.is_empty(), "{:?}", even.1);
    let times: Vec<Vec<f64>> = all.iter().map(|track| track.times.clone()).collect();
    // The second clock is fast by 4 ms a second, and the third camera loses seven frames in the middle.
    all[1].times.iter_mut().for_each(|time| *time *= 1.004);
    let kept = |k: usize| !(250..360).contains(&k) || !k.is_multiple_of(16);
    let lost = &mut all[2];
    lost.sightings = (0..lost.sightings.len()).filter(|k| kept(*k)).map(|k| lost.sightings[k].clone()).collect();
    lost.times.truncate(lost.sightings.len());
    let kept_times: Vec<f64> = (0..times[2].len()).filter(|k| kept(*k)).map(|k| times[2][k]).collect();
    let (solved, uneven) =
        solve_with_times(&mut all, &lenses(&truth), Known::All, &usual(&truth), &lengths, None).unwrap();
    println!("{uneven:?}");
    assert_eq!(uneven.iter().map(|clock| clock.camera).collect::<Vec<_>>(), [1, 2]);
    assert!((uneven[0].fast - 0.004).abs() < 1e-3 && uneven[1].uneven > 0.0);
    for (k, truth) in [(1, &times[1]), (2, &kept_times)] {
        let late = lateness(&all[k], truth, solved.rig.offsets[k] - OFFSETS[k]);
        println!("camera {k}: {:.1} ms off", 1e3 * late);
        // Without correction, a tenth of a second where frames are lost.
        assert!(late < 0.035, "{k}: {late}");
    }
}

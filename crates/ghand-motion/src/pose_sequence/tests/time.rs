//! Frames have their places in time, whatever a file leaves out.

use super::*;

/// A hand whose index finger bends by `bend`, as trackers give it.
fn hand(bend: f64) -> Json {
    let mut fingers = vec![0.0; 45];
    fingers[2] = bend;
    json!({"global_orient": [0, 0, 0], "hand_pose": fingers, "is_right": 1})
}

fn with(mut hand: Json, fields: Json) -> Json {
    for (name, value) in fields.as_object().unwrap() {
        hand[name] = value.clone();
    }
    hand
}

/// Frames 0 to 9 and 20 to 29 of a recording at 10 per second whose finger bends by 0.05 a frame.
fn known() -> Vec<usize> {
    (0..10).chain(20..30).collect()
}

fn bend(sequence: &PoseSequence, k: usize) -> f64 {
    let joint = RestSkeleton::of(right()).unwrap().joint(JointRole::Bend(Finger::Index, 1)).unwrap();
    sequence.frames[k].pose.rotations[joint].length()
}

fn assert_is_whole(file: &str, value: &Json) {
    let sequence = read(value, right()).unwrap_or_else(|error| panic!("{file}: {error}"));
    assert_eq!(sequence.frames.len(), 30, "{file}: {:?}", sequence.warnings);
    assert!((sequence.fps - 10.0).abs() < 1e-9, "{file}: {}", sequence.fps);
    for k in 0..30 {
        let off = bend(&sequence, k) - 0.05 * k as f64;
        assert!(off.abs() < 1e-9, "{file}: frame {k} is off by {off}");
    }
    let said = sequence.warnings.iter().any(|w| w.contains("10 frames without a pose are interpolated"));
    assert!(said, "{file}: {:?}", sequence.warnings);
}

use ghand_hand_model::joints::names::{Finger, JointRole};

#[test]
fn a_gap_stays_a_gap_in_files_of_every_kind() {
    let at = |k: usize| 0.05 * k as f64;
    let list = |f: &dyn Fn(usize) -> Json| known().into_iter().map(f).collect::<Vec<Json>>();
    let whole = |f: &dyn Fn(usize, bool) -> Json| (0..30).map(|k| f(k, known().contains(&k))).collect::<Vec<Json>>();
    let files = [
        ("numbers", json!(list(&|k| with(hand(at(k)), json!({"frame": k + 7, "fps": 10}))))),
        ("times", json!(list(&|k| with(hand(at(k)), json!({"timestamp": 3.0 + 0.1 * k as f64}))))),
        ("milliseconds", json!(list(&|k| with(hand(at(k)), json!({"timestamp": 100 * k}))))),
        ("nanoseconds", json!(list(&|k| with(hand(at(k)), json!({"timestamp": 1e8 * k as f64}))))),
        (
            "names of images",
            json!({"fps": 10, "frames": Json::Object(known().into_iter().map(|k| (format!("img_{k:05}.jpg"), json!([hand(at(k))]))).collect())}),
        ),
        (
            "nothing",
            json!({"fps": 10, "frames": whole(&|k, is_known| if is_known { hand(at(k)) } else { Json::Null })}),
        ),
        (
            "null hands",
            json!({"fps": 10, "frames": whole(&|k, is_known| if is_known { hand(at(k)) } else { json!({"global_orient": null, "hand_pose": null}) })}),
        ),
        (
            "sides",
            json!({"fps": 10, "frames": whole(&|k, is_known| if is_known { json!({"right": hand(at(k))}) } else { json!({"right": null}) })}),
        ),
        (
            "one side",
            json!({"fps": 10, "right": whole(&|k, is_known| if is_known { hand(at(k)) } else { Json::Null })}),
        ),
        (
            "arrays",
            json!({"fps": 10, "poses": whole(&|k, is_known| json!((0..48).map(|j| if !is_known { None } else if j == 5 { Some(at(k)) } else { Some(0.0) }).collect::<Vec<_>>())), "side": "right"}),
        ),
        ("own", {
            let joint = RestSkeleton::of(right()).unwrap().joint(JointRole::Bend(Finger::Index, 1)).unwrap();
            let axis = RestSkeleton::of(right()).unwrap().axes[joint].flexion;
            let pose = |k: usize| {
                let mut pose = Pose::rest(right().joint_count());
                pose.rotations[joint] = axis * at(k);
                pose
            };
            json!({"fps": 10, "frames": list(&|k| json!({"id": format!("{k:04}"), "pose": rows(&pose(k))}))})
        }),
    ];
    for (name, file) in &files {
        assert_is_whole(name, file);
    }
}

#[test]
fn the_ends_of_a_recording_are_held_and_a_pause_is_left_out() {
    let frames: Vec<Json> = (0..20).map(|k| if (4..15).contains(&k) { hand(0.1) } else { Json::Null }).collect();
    let sequence = read(&json!({"fps": 10, "frames": frames}), right()).unwrap();
    assert_eq!(sequence.frames.len(), 20);
    let said = |text: &str| sequence.warnings.iter().any(|w| w.contains(text));
    assert!(said("first 4 frames") && said("last 5 frames"), "{:?}", sequence.warnings);
    let two_takes: Vec<Json> =
        (0..10).chain(5000..5010).map(|k| with(hand(0.1), json!({"frame": k, "fps": 30}))).collect();
    let sequence = read(&json!(two_takes), right()).unwrap();
    assert_eq!(sequence.frames.len(), 20);
    assert!(sequence.warnings.iter().any(|w| w.contains("166 s") && w.contains("left out")), "{:?}", sequence.warnings);
}

#[test]
fn frames_are_sorted_by_numbers_and_uneven_times_are_resampled() {
    let order = [0, 1, 10, 11, 2, 3, 4, 5, 6, 7, 8, 9];
    let file = json!({"fps": 30, "frames": order.iter().map(|k| with(hand(0.05 * f64::from(*k)), json!({"id": format!("frame{k}.jpg")}))).collect::<Vec<_>>()});
    let sequence = read(&file, right()).unwrap();
    assert!((0..12).all(|k| (bend(&sequence, k) - 0.05 * k as f64).abs() < 1e-9));
    assert!(sequence.warnings.iter().any(|w| w.contains("sorted")), "{:?}", sequence.warnings);
    // Jitter of a clock leaves the frames as they are, and the length is the recording's.
    let jittered: Vec<Json> =
        (0..60_u32).map(|k| with(hand(0.01), json!({"timestamp_ms": (33.366 * f64::from(k)).round()}))).collect();
    let sequence = read(&json!(jittered), right()).unwrap();
    assert_eq!(sequence.frames.len(), 60);
    assert!((sequence.fps - 29.97).abs() < 0.02, "{}", sequence.fps);
    let times = [0.0, 0.1, 0.15, 0.3, 0.33, 0.36, 0.5, 0.9, 1.0];
    let uneven: Vec<Json> = times.iter().map(|time| with(hand(*time), json!({"time": time}))).collect();
    let sequence = read(&json!(uneven), right()).unwrap();
    assert!((sequence.duration() - 1.0).abs() < 1.0 / sequence.fps, "{} {}", sequence.duration(), sequence.fps);
    for k in 0..sequence.frames.len() {
        assert!((bend(&sequence, k) - k as f64 / sequence.fps).abs() < 1e-9, "{k}");
    }
    assert!(sequence.warnings.iter().any(|w| w.contains("unevenly")), "{:?}", sequence.warnings);
}

#[test]
fn rates_come_from_the_user_the_times_or_the_file_and_a_missing_one_is_said() {
    let frames: Vec<Json> = (0..5).map(|_| hand(0.1)).collect();
    let warned = |sequence: &PoseSequence, text: &str| sequence.warnings.iter().any(|w| w.contains(text));
    let none = read(&json!(frames), right()).unwrap();
    assert!(none.fps == 30.0 && warned(&none, "--file-fps"), "{:?}", none.warnings);
    let given = PoseOptions { file_fps: Some(25.0), ..Default::default() };
    let sequence = read_with(&json!(frames), right(), &given).unwrap();
    assert!(sequence.fps == 25.0 && !warned(&sequence, "--file-fps"), "{:?}", sequence.warnings);
    // Below the side of the hand, too.
    let below = read(&json!({"right": {"fps": 60, "frames": frames}}), right()).unwrap();
    assert!(below.fps == 60.0 && !warned(&below, "--file-fps"), "{:?}", below.warnings);
    let stated = json!({"fps": 60, "frames": frames});
    assert!(!warned(&read(&stated, right()).unwrap(), "fps"));
    let over = read_with(&stated, right(), &given).unwrap();
    assert!(over.fps == 25.0 && warned(&over, "--file-fps"), "{:?}", over.warnings);
    let every_fifth: Vec<Json> = (0..5).map(|k| with(hand(0.1), json!({"frame": 5 * k, "fps": 30}))).collect();
    let sequence = read(&json!(every_fifth), right()).unwrap();
    assert!(sequence.fps == 30.0 && warned(&sequence, "--file-fps 6"), "{:?}", sequence.warnings);
    let timed: Vec<Json> = (0..5).map(|k| with(hand(0.1), json!({"time": 0.1 * f64::from(k)}))).collect();
    let contradicts = read(&json!({"fps": 30, "frames": timed}), right()).unwrap();
    assert!((contradicts.fps - 10.0).abs() < 1e-9 && warned(&contradicts, "are used"), "{:?}", contradicts.warnings);
}

#[test]
fn frames_that_are_used_by_their_ids_are_not_filled() {
    let by_id = PoseOptions { by_id: true, ..Default::default() };
    let gap = json!([
        with(hand(0.1), json!({"id": "0000"})),
        with(hand(0.1), json!({"id": "0004"})),
        with(hand(0.1), json!({"id": "0005"}))
    ]);
    let found = read_with(&gap, right(), &by_id).unwrap();
    assert_eq!(found.frames.iter().map(|frame| frame.id.as_str()).collect::<Vec<_>>(), ["0000", "0004", "0005"]);
    assert!(found.warnings.is_empty(), "{:?}", found.warnings);
    assert_eq!(read(&gap, right()).unwrap().frames.len(), 6);
    let uneven = json!([0.0, 0.1, 0.13, 0.7].map(|time| with(hand(0.1), json!({"time": time}))));
    assert!(read_with(&uneven, right(), &by_id).unwrap().warnings.is_empty());
    assert!(read(&uneven, right()).unwrap().warnings.iter().any(|w| w.contains("are interpolated")));
}

#[test]
fn a_frame_that_jumps_is_said_and_smoothing_mends_it() {
    let bends: Vec<f64> = (0..60).map(|k| if k == 30 { 1.5 } else { 0.3 + 0.2 * (0.1 * f64::from(k)).sin() }).collect();
    let file = json!({"fps": 30, "frames": bends.iter().map(|bend| hand(*bend)).collect::<Vec<_>>()});
    let as_read = read(&file, right()).unwrap();
    assert!((bend(&as_read, 30) - 1.5).abs() < 1e-9);
    assert!(
        as_read.warnings.iter().any(|w| w.contains("\"0030\"") && w.contains("--smooth")),
        "{:?}",
        as_read.warnings
    );
    let smooth = PoseOptions { smooth: true, ..Default::default() };
    let mended = read_with(&file, right(), &smooth).unwrap();
    for (k, given) in bends.iter().enumerate().filter(|(k, _)| *k != 30) {
        assert!((bend(&mended, k) - given).abs() < 0.06, "{k}: {} for {given}", bend(&mended, k));
    }
    assert!((bend(&mended, 30) - 0.328).abs() < 0.06, "{}", bend(&mended, 30));
    // Noise falls, and a slow motion does not lag.
    let noise = |k: i32| if k % 2 == 0 { 0.01 } else { -0.01 };
    let slow = |k: i32| 0.5 + 0.3 * (f64::from(k) * 0.05).sin();
    let noisy = json!({"fps": 30, "frames": (0..120).map(|k| hand(slow(k) + noise(k))).collect::<Vec<_>>()});
    let found = read_with(&noisy, right(), &smooth).unwrap();
    let off: f64 = (10..110).map(|k| (bend(&found, k as usize) - slow(k)).abs()).sum::<f64>() / 100.0;
    assert!(off < 0.006, "{off}");
}

use ghand_core::rotation::rotation_from_axis_angle;
use ghand_hand_model::named_poses::named_pose;
use glam::DQuat;
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::{Value as Json, json};

use super::*;
use crate::motions::motion;
use crate::pose_sequence::read_poses_bytes;
use crate::test_hands::{natural_pose, procedural, vector};

/// As sent, like a file.
const AS_SENT: LiveOptions = LiveOptions { smooth: Some(false), in_place: false, own_side_only: false };

fn right() -> &'static HandModel {
    procedural(Side::Right)
}

fn random() -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(8)
}

fn own_packet(pose: &Pose) -> Json {
    json!({
        "pose": pose.rotations.iter().map(DVec3::to_array).collect::<Vec<_>>(),
        "translation": pose.translation.to_array(),
        "sent_ms": 1.7e12,
    })
}

/// Joints as a WebXR frame has them.
fn xr_hand(random: &mut ChaCha8Rng) -> Json {
    let mut joint = |k: usize| {
        let turn = DQuat::from_scaled_axis(vector(random, 0.3)).to_array();
        json!({"position": [0.01 * k as f64, 1.2, -0.4], "orientation": turn})
    };
    let names = &RestSkeleton::webxr(Side::Right).joint_names;
    Json::Object(names.iter().enumerate().map(|(k, name)| (name.clone(), joint(k))).collect())
}

fn landmarks_of(model: &HandModel, pose: &Pose) -> [DVec3; LANDMARK_COUNT] {
    HandIk::new(&RestSkeleton::of(model).unwrap()).landmarks(pose)
}

fn landmarks_packet(points: &[DVec3; LANDMARK_COUNT], side: &str) -> Json {
    let points: Vec<Json> = points.iter().map(|p| json!({"x": p.x, "y": p.y, "z": p.z})).collect();
    json!({"worldLandmarks": [points], "handedness": [[{"categoryName": side, "score": 0.9}]], "sent_ms": 1.7e12})
}

fn bytes(packet: &Json) -> Vec<u8> {
    packet.to_string().into_bytes()
}

/// Largest difference of the rotations, as matrices.
fn difference(a: &Pose, b: &Pose) -> f64 {
    assert_eq!(a.rotations.len(), b.rotations.len());
    let turns = a.rotations.iter().zip(&b.rotations);
    let entries =
        turns.flat_map(|(a, b)| (rotation_from_axis_angle(*a) - rotation_from_axis_angle(*b)).to_cols_array());
    entries.map(f64::abs).fold(0.0, f64::max)
}

#[test]
fn every_kind_of_packet_gives_the_pose_that_a_file_with_it_gives() {
    let mut random = random();
    for side in [Side::Right, Side::Left] {
        let model = procedural(side);
        let pose = natural_pose(model, &mut random);
        let turns: Vec<f64> = (0..45).map(|_| random.random_range(-0.3..0.3)).collect();
        let mut array: Vec<f64> = Vec::new();
        for k in 0..25 {
            let turn = DQuat::from_scaled_axis(vector(&mut random, 0.3));
            let matrix = glam::DMat4::from_rotation_translation(turn, DVec3::new(0.01 * f64::from(k), 0.0, -0.5));
            array.extend(matrix.to_cols_array());
        }
        let packets = [
            (PacketKind::Pose, own_packet(&pose)),
            (PacketKind::Mano, json!({"global_orient": [0.1, 0.2, 0.3], "hand_pose": turns, "is_right": 1})),
            (PacketKind::XrJoints, json!({"handedness": "left", "joints": xr_hand(&mut random)})),
            (PacketKind::XrJoints, json!(array)),
            (PacketKind::XrJoints, json!({"handedness": "right", "joints": array, "sent_ms": 1.5})),
            (PacketKind::Landmarks, landmarks_packet(&landmarks_of(model, &pose), &side.to_string())),
            (PacketKind::Landmarks, json!(landmarks_of(model, &pose).map(|p| p.to_array()))),
        ];
        for (kind, packet) in packets {
            let found = LivePoses::default().read(&bytes(&packet), model, 0.0, &AS_SENT).unwrap();
            let file = read_poses_bytes("file", &bytes(&packet), model, &PoseOptions::default()).unwrap();
            assert_eq!(found.kind, kind, "{packet}");
            if kind == PacketKind::Landmarks {
                // A file is fitted with all that one can know about a person; a stream must be quick.
                let [a, b] = [&found.pose, &file.frames[0].pose].map(|pose| landmarks_of(model, pose));
                let off = a.iter().zip(&b).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
                assert!(off < 0.008, "{off} m");
            } else {
                assert_eq!(found.pose, file.frames[0].pose, "{packet}");
            }
            assert_eq!(found.sent_ms, packet.get("sent_ms").and_then(Json::as_f64));
        }
    }
}

#[test]
fn of_two_hands_the_one_of_the_model_is_taken() {
    let mut random = random();
    let hands = [xr_hand(&mut random), xr_hand(&mut random)];
    let both = json!({"left": {"joints": hands[0]}, "right": {"joints": hands[1]}});
    for (side, hand) in [(Side::Left, &hands[0]), (Side::Right, &hands[1])] {
        let name = side.to_string();
        let model = procedural(side);
        let read = |packet: &Json| LivePoses::default().read(&bytes(packet), model, 0.0, &AS_SENT).unwrap().pose;
        assert_eq!(read(&both), read(&json!({"handedness": name, "joints": hand})));
        let points = ["thumbs-up", "point"].map(|pose| landmarks_of(model, &named_pose(pose, model).unwrap()));
        for (sides, own) in [
            (["right", "left"], points[usize::from(side == Side::Left)]),
            (["left", "right"], points[usize::from(side == Side::Right)]),
        ] {
            let both = json!({"worldLandmarks": points.map(|hand| hand.map(|p| p.to_array())), "handedness": sides});
            assert_eq!(read(&both), read(&landmarks_packet(&own, &name)));
        }
    }
}

#[test]
fn the_other_hand_is_mirrored_unless_the_own_one_was_just_seen() {
    let mut random = random();
    let model = right();
    let (left, right) = (xr_hand(&mut random), xr_hand(&mut random));
    let [left, right] =
        [("left", left), ("right", right)].map(|(side, hand)| json!({"handedness": side, "joints": hand}));
    let mut live = LivePoses::default();
    let mut read = |packet: &Json, seconds: f64| live.read(&bytes(packet), model, seconds, &AS_SENT);
    assert!(read(&left, 0.0).is_ok());
    assert!(read(&right, 0.1).is_ok());
    let error = read(&left, 0.2).unwrap_err().to_string();
    assert!(error.contains("only a left hand"), "{error}");
    assert!(read(&left, 1.2).is_ok());
}

#[test]
fn landmarks_of_a_hand_of_another_size_are_followed() {
    let model = right();
    let grasp = motion("grasp", model, 30.0).unwrap().unwrap();
    let mut live = LivePoses::default();
    let mut random = random();
    let options = LiveOptions::default();
    let (mut worst, mut before): (f64, Option<Pose>) = (0.0, None);
    for (k, frame) in grasp.frames.iter().enumerate() {
        let noisy = landmarks_of(model, &frame.pose).map(|point| 1.2 * point + vector(&mut random, 0.001));
        let packet = bytes(&landmarks_packet(&noisy, "Right"));
        let found = live.read(&packet, model, k as f64 / 30.0, &options).unwrap().pose;
        assert_eq!(found.translation, DVec3::ZERO);
        if k > 10 {
            worst = worst.max(difference(&found, &frame.pose));
        }
        // No jump: a finger closes at 10 rad/s.
        let step = before.replace(found.clone()).map_or(0.0, |before| difference(&before, &found));
        assert!(step < 0.5, "frame {k} jumps by {step}");
    }
    assert!(worst < 0.5, "{worst}");
}

#[test]
fn only_landmarks_are_smoothed_unless_the_user_decides() {
    let model = right();
    let poses = ["rest", "fist"].map(|name| named_pose(name, model).unwrap());
    let kinds: [fn(&HandModel, &Pose) -> Json; 2] =
        [|_, pose| own_packet(pose), |model, pose| landmarks_packet(&landmarks_of(model, pose), "Right")];
    for (packet, smoothed) in kinds.into_iter().zip([false, true]) {
        for smooth in [None, Some(true), Some(false)] {
            let options = LiveOptions { smooth, ..LiveOptions::default() };
            let mut live = LivePoses::default();
            live.read(&bytes(&packet(model, &poses[0])), model, 0.0, &options).unwrap();
            let found = live.read(&bytes(&packet(model, &poses[1])), model, 0.03, &options).unwrap().pose;
            let is_there = difference(&found, &poses[1]) < 0.1;
            assert_eq!(is_there, !smooth.unwrap_or(smoothed), "{smooth:?}");
        }
    }
}

/// A packet that cannot be used, and a part of the message.
fn hostile() -> Vec<(Vec<u8>, &'static str)> {
    let model = right();
    let mut random = random();
    let pose = natural_pose(model, &mut random);
    let own = own_packet(&pose);
    let mut short = xr_hand(&mut random);
    short.as_object_mut().unwrap().remove("wrist");
    let line = [DVec3::X; LANDMARK_COUNT];
    let nan = own.to_string().replacen("[[", "[[NaN,0,0],[", 1);
    let text = |packet: Json| packet.to_string().into_bytes();
    vec![
        (vec![], "not JSON"),
        (b"\x80\x04\x95pickle".to_vec(), "not JSON"),
        (b"PK\x03\x04".to_vec(), "not JSON"),
        (vec![0xff; 100], "not JSON"),
        (b"{}".to_vec(), "content"),
        (vec![b'['; LARGEST_PACKET], "content"),
        (vec![b' '; LARGEST_PACKET + 1], "larger than 64 KiB"),
        ([vec![b'['; 60_000], vec![b']'; 5000]].concat(), "content"),
        (nan.into_bytes(), "pose"),
        (text(json!({"pose": vec![[1e300, 0.0, 0.0]; 16]})), "pose"),
        (text(json!({"pose": vec![[0.0, 0.0, 0.0]; 17]})), "17 rows"),
        (text(json!({"pose": vec![[0.0, 0.0, 0.0]; 16], "translation": [1e9, 0, 0]})), "translation"),
        (text(json!({"frames": [own, own]})), "frames"),
        (text(json!({"frames": []})), "frames"),
        (text(json!({"joints": short})), "\"wrist\" is missing"),
        (text(json!({"joints": vec![[0.0; 7]; 25]})), "quaternion"),
        (text(json!({"joints": vec![[1e300; 16]; 25]})), "joint"),
        (text(landmarks_packet(&line, "Right")), "at one point"),
        (text(json!({"worldLandmarks": [vec![[0.0, 0.0, 0.0]; 20]]})), "20 landmarks"),
        (text(json!({"landmarks": [vec![[0.0, 0.0, 0.0]; 21]]})), "world_landmarks"),
        (
            text(json!({"format": "ghand-capture", "version": 1, "hand_model": {"kind": "mano"}, "frames": [own]})),
            "capture",
        ),
    ]
}

#[test]
fn a_hostile_packet_is_refused_in_a_sentence_and_the_next_one_is_read() {
    let model = right();
    let good = bytes(&landmarks_packet(&landmarks_of(model, &named_pose("ok", model).unwrap()), "Right"));
    let mut live = LivePoses::default();
    for (packet, part) in hostile() {
        let shown = String::from_utf8_lossy(&packet[..packet.len().min(200)]).into_owned();
        let error = live.read(&packet, model, 0.0, &AS_SENT).expect_err(&shown).to_string();
        assert!(error.starts_with("packet: ") && error.contains(part), "{shown}: {error}");
        assert!(live.read(&good, model, 0.0, &AS_SENT).is_ok(), "after {shown}");
    }
}

/// One or two changes of the kinds that break parsers.
fn changed(bytes: &[u8], random: &mut impl Rng) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    for _ in 0..random.random_range(1..=2) {
        let at = random.random_range(0..=bytes.len());
        let insert: &[u8] = match random.random_range(0..8) {
            0 => b"1e999",
            1 => b"NaN",
            2 => b"-1e300",
            3 => b"[[[[",
            4 => b"\"\\ud800\"",
            5 => b"null",
            6 => b"]},{[",
            _ => &[0xff, 0],
        };
        let end = (at + random.random_range(0..8)).min(bytes.len());
        match random.random_range(0..4) {
            0 => bytes.truncate(at),
            1 => _ = bytes.splice(at..end, insert.iter().copied()),
            2 => bytes.iter_mut().skip(at).take(1).for_each(|byte| *byte = b'0' + random.random_range(0..10)),
            _ => bytes.iter_mut().skip(at).take(1).for_each(|byte| *byte = random.random()),
        }
    }
    bytes
}

#[test]
fn changed_packets_give_a_pose_in_range_or_an_error() {
    let model = right();
    let mut random = random();
    let pose = natural_pose(model, &mut random);
    let packets = [
        own_packet(&pose),
        json!({"global_orient": [0.1, 0.2, 0.3], "hand_pose": vec![0.1; 45]}),
        json!({"hands": [{"handedness": "right", "joints": xr_hand(&mut random)}]}),
        landmarks_packet(&landmarks_of(model, &pose), "Right"),
    ];
    let mut live = LivePoses::default();
    let mut read = 0;
    let mut refused = 0;
    for packet in packets.iter().map(bytes) {
        for k in 0..500 {
            match live.read(&changed(&packet, &mut random), model, f64::from(k), &LiveOptions::default()) {
                Ok(found) => {
                    found.pose.check_range(&model.joint_names).unwrap();
                    read += 1;
                }
                Err(error) => {
                    assert!(error.to_string().starts_with("packet: "), "{error}");
                    refused += 1;
                }
            }
        }
    }
    assert!(read > 20 && refused > 500, "{read} read, {refused} refused");
}

//! The stage without a device: hands, what drives them, the view, the light.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use ghand_avatar::light::AvatarLight;
use ghand_avatar::view_side::ViewSide;
use ghand_avatar::{Avatar, AvatarConfig, Light};
use ghand_core::Side;
use ghand_hand_model::surface::sample_surface;
use ghand_test_support::procedural_hand::ProceduralHand;
use ghand_web::description;
use ghand_web::layer::Layer;
use ghand_web::stage::{LightChoice, Stage};
use glam::DVec3;

fn avatar(left: bool) -> Avatar {
    let model = ProceduralHand { detail: 1, left, ..Default::default() }.build().unwrap();
    let config = AvatarConfig { uv_resolution: 32, ..Default::default() };
    Avatar::untrained(&model, &config, [0.5; 3], 0).unwrap()
}

fn stage(hands: &[bool]) -> Stage {
    let mut stage = Stage::default();
    for left in hands {
        stage.add(avatar(*left)).unwrap();
    }
    stage
}

#[test]
fn all_hands_are_in_the_picture_and_apart() {
    for hands in [&[false][..], &[true], &[false, true], &[false, false, true]] {
        let stage = stage(hands);
        let camera = stage.camera([400, 300]).unwrap();
        let mut extents = Vec::new();
        for hand in stage.hands() {
            let places: Vec<_> = hand.model().vertices.iter().map(|v| camera.project(*v + hand.place)).collect();
            assert!(places.iter().all(|(p, z)| *z > 0.0 && p.x > 0.0 && p.x < 400.0 && p.y > 0.0 && p.y < 300.0));
            let xs = places.iter().map(|(p, _)| p.x);
            extents.push(xs.fold([f64::MAX, f64::MIN], |[low, high], x| [low.min(x), high.max(x)]));
        }
        extents.sort_by(|a, b| a[0].total_cmp(&b[0]));
        assert!(extents.windows(2).all(|pair| pair[0][1] < pair[1][0]), "{hands:?}: {extents:?}");
    }
}

#[test]
fn left_hands_are_left_as_their_backs_are_seen() {
    let mut stage = stage(&[false, true]);
    stage.look_from(ViewSide::Back);
    let camera = stage.camera([400, 300]).unwrap();
    let middle = |k: usize| {
        let hand = stage.hand(k).unwrap();
        let sum: DVec3 = hand.model().vertices.iter().map(|v| *v + hand.place).sum();
        camera.project(sum / hand.model().vertices.len() as f64).0.x
    };
    assert_eq!(stage.hand(1).unwrap().model().side, Side::Left);
    assert!(middle(1) < middle(0), "{} {}", middle(1), middle(0));
}

#[test]
fn a_transition_ends_exactly_in_its_pose_and_a_motion_repeats() {
    let mut stage = stage(&[false]);
    let hand = stage.hand_mut(0).unwrap();
    let fist = hand.named("fist").unwrap();
    hand.go_to(fist.clone(), 0.3).unwrap();
    assert!(hand.advance(0.15) && hand.is_moving() && *hand.pose() != fist);
    assert!(hand.advance(0.16) && !hand.is_moving() && *hand.pose() == fist);
    assert!(!hand.advance(1.0));
    let motion = hand.motion("count").unwrap();
    let length = motion.duration();
    hand.play(motion.clone(), true);
    hand.advance(length + 0.5);
    assert!((hand.playback().unwrap().time - 0.5).abs() < 1e-9 && hand.is_moving());
    hand.play(motion.clone(), false);
    hand.advance(length + 0.5);
    assert_eq!(hand.playback().unwrap().time, length);
    assert!(!hand.is_moving() && *hand.pose() == motion.frames.last().unwrap().pose);
    hand.play(motion, true);
    hand.playback_mut().unwrap().speed = -1.0;
    hand.advance(0.25);
    assert!((hand.playback().unwrap().time - (length - 0.25)).abs() < 1e-9, "it plays backwards");
    hand.seek(f64::NAN);
    assert_eq!(hand.playback().unwrap().time, 0.0);
}

#[test]
fn each_hand_takes_its_own_part_of_a_packet() {
    let packet = |side: &str| {
        let pose = vec!["[0,0,0.4]"; 16].join(",");
        format!(r#"{{"side":"{side}","pose":[{pose}],"translation":[0,0,0]}}"#)
    };
    let moved = |stage: &Stage| stage.hands().iter().map(|h| h.pose().rotations[3] != DVec3::ZERO).collect::<Vec<_>>();
    let mut both = stage(&[false, true]);
    both.take_packet(packet("left").as_bytes(), 0.0, true).unwrap();
    assert_eq!(moved(&both), [false, true]);
    // One hand alone mirrors the other.
    let mut one = stage(&[false]);
    one.take_packet(packet("left").as_bytes(), 0.0, true).unwrap();
    assert_eq!(moved(&one), [true]);
    let error = both.take_packet(b"{\"pose\":[]}", 0.1, true).unwrap_err();
    assert!(error.contains("packet"), "{error}");
    let error = Stage::default().take_packet(b"{}", 0.0, true).unwrap_err();
    assert!(error.contains("no hand"), "{error}");
}

#[test]
fn what_cannot_be_done_is_one_sentence() {
    let mut stage = stage(&[false]);
    let hand = stage.hand_mut(0).unwrap();
    let says = |error: String, words: &str| assert!(error.contains(words), "{error}");
    says(hand.named("fits").unwrap_err(), "fist");
    says(hand.motion("cuont").unwrap_err(), "count");
    says(hand.read_poses("poses.json", b"{").unwrap_err(), "poses.json");
    let mut pose = hand.named("fist").unwrap();
    pose.rotations[1].x = f64::NAN;
    says(hand.go_to(pose.clone(), 0.3).unwrap_err(), "NaN");
    pose.rotations.pop();
    says(hand.go_to(pose, 0.3).unwrap_err(), "joints");
    says(hand.set_angles(99, DVec3::ZERO).unwrap_err(), "99");
    says(stage.hand_mut(1).err().unwrap(), "no hand 1");
    says(stage.set_light(LightChoice::Studio, 0.0).unwrap_err(), "light=transfer");
    let at = DVec3::new(0.0, 0.0, -0.5);
    says(stage.look_at(at, at, DVec3::NEG_Y, 0.5).unwrap_err(), "camera");
    says(stage.look_at(at, DVec3::ZERO, DVec3::Z, 0.5).unwrap_err(), "camera");
    says(stage.look_at(at, DVec3::ZERO, DVec3::NEG_Y, f64::NAN).unwrap_err(), "camera");
    stage.look_at(at, DVec3::ZERO, DVec3::NEG_Y, 0.5).unwrap();
    let camera = stage.camera([300, 300]).unwrap();
    assert!(camera.center().distance(at) < 1e-9 && (camera.project(DVec3::ZERO).0.x - 150.0).abs() < 1e-6);
}

#[test]
fn angles_are_those_that_were_set() {
    let mut stage = stage(&[true]);
    let hand = stage.hand_mut(0).unwrap();
    let joint = hand.model().joint_index("index2").unwrap();
    let angles = DVec3::new(0.7, 0.05, -0.02);
    hand.set_angles(joint, angles).unwrap();
    assert!(hand.angles(joint).unwrap().distance(angles) < 1e-12);
    let text = description::of_hand(hand);
    assert_eq!(text["side"], "left");
    assert_eq!(text["joints"].as_array().unwrap().len(), hand.model().joint_count());
    let limits = &text["joints"][joint]["limits"]["flexion"];
    assert!(limits[0].as_f64() <= Some(0.0) && limits[1].as_f64() > Some(1.0), "{limits}");
}

#[test]
fn a_layer_changes_the_colours_and_nothing_else() {
    let mut plain = stage(&[false]);
    assert_eq!(description::of_hand(plain.hand(0).unwrap())["layers"], serde_json::json!(["skin"]));
    let error = plain.show(Layer::Albedo).unwrap_err();
    assert!(error.contains("no layer \"albedo\"; it has skin"), "{error}");
    let mut lit = avatar(false);
    let samples = sample_surface(&lit.model, 32).unwrap();
    lit.light = Some(AvatarLight::new(Light::studio(), None, &samples));
    lit.seen = Some((0..lit.template.len()).map(|k| k as f32).collect());
    let mut stage = Stage::default();
    stage.add(lit.clone()).unwrap();
    assert_eq!(description::of_hand(stage.hand(0).unwrap())["layers"], serde_json::json!(["skin", "albedo", "views"]));
    stage.show(Layer::Albedo).unwrap();
    let hand = stage.hand(0).unwrap();
    assert!(hand.shown().light.is_none() && stage.light_on(hand).is_none());
    assert_eq!(hand.shown().tables, lit.tables);
    stage.show(Layer::Views).unwrap();
    assert_ne!(stage.hand(0).unwrap().shown().tables, lit.tables);
    // Another hand is shown alike, if it can be.
    stage.add(lit.clone()).unwrap();
    assert_ne!(stage.hand(1).unwrap().shown().tables, lit.tables);
    stage.add(avatar(true)).unwrap();
    assert_eq!(stage.layer(), Layer::Skin);
    assert!(stage.show(Layer::Albedo).is_err() && stage.layer() == Layer::Skin);
    let hand = stage.hand(0).unwrap();
    assert!(stage.light_on(hand).is_some());
    assert_eq!(hand.shown().tables, lit.tables);
}

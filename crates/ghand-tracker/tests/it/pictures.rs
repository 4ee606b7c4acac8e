//! Hands in pictures of known content.

use ghand_core::Side;
use ghand_tracker::{HandTracker, TrackedHand};
use glam::DVec3;
use image::imageops::{flip_horizontal, overlay, replace};
use image::{Rgb, RgbImage};
use serde_json::Value;

/// The demo avatar, a right hand.
fn hand() -> RgbImage {
    image::load_from_memory(include_bytes!("../data/hand.png")).unwrap().to_rgb8()
}

/// Points of MediaPipe's own program.
fn points(list: &Value) -> Vec<DVec3> {
    let point = |p: &Value| DVec3::new(p[0].as_f64().unwrap(), p[1].as_f64().unwrap(), p[2].as_f64().unwrap_or(0.0));
    list.as_array().unwrap().iter().map(point).collect()
}

fn track(tracker: &mut HandTracker, picture: &RgbImage) -> Vec<TrackedHand> {
    tracker.track(picture, picture.width(), picture.height()).unwrap()
}

/// The largest distance of corresponding points.
fn largest(ours: impl IntoIterator<Item = DVec3>, theirs: &[DVec3]) -> f64 {
    ours.into_iter().zip(theirs).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max)
}

#[test]
fn landmarks_and_sides_are_those_of_mediapipe() {
    let reference: Value = serde_json::from_str(include_str!("../data/hand.json")).unwrap();
    for (name, picture, side) in [("as_it_is", hand(), Side::Right), ("mirrored", flip_horizontal(&hand()), Side::Left)]
    {
        let hands = track(&mut HandTracker::new(2), &picture);
        let [hand] = &hands[..] else { panic!("{name}: {} hands", hands.len()) };
        assert_eq!(hand.side, side, "{name}");
        assert!(hand.side_score > 0.8 && hand.presence > 0.9, "{name}: {hand:?}");
        // MediaPipe places pixels of its pieces by their corners, we by their middles.
        let off = largest(hand.landmarks.map(|p| p.extend(0.0)), &points(&reference[name]["landmarks"]));
        assert!(off < 2.0, "{name}: {off} pixels");
        let other = if name == "mirrored" { "as_it_is" } else { "mirrored" };
        let off = largest(hand.landmarks.map(|p| p.extend(0.0)), &points(&reference[other]["landmarks"]));
        assert!(off > 20.0, "{name}: the comparison does not tell a mirrored hand");
        let off = largest(hand.world, &points(&reference[name]["world"]));
        assert!(off < 0.003, "{name}: {off} m");
    }
}

#[test]
fn two_hands_of_one_picture_keep_their_identities() {
    let mut both = RgbImage::new(1280, 480);
    replace(&mut both, &hand(), 0, 0);
    replace(&mut both, &flip_horizontal(&hand()), 640, 0);
    let mut tracker = HandTracker::new(2);
    let first = track(&mut tracker, &both);
    for _ in 0..3 {
        let mut hands = track(&mut tracker, &both);
        assert_eq!(hands.len(), 2);
        assert_eq!(hands.iter().map(|hand| hand.identity).collect::<Vec<_>>(), [first[0].identity, first[1].identity]);
        hands.sort_by(|a, b| a.landmarks[0].x.total_cmp(&b.landmarks[0].x));
        assert_eq!([hands[0].side, hands[1].side], [Side::Right, Side::Left]);
        assert!(hands[0].landmarks[0].x < 640.0 && hands[1].landmarks[0].x > 640.0);
    }
    assert_eq!(track(&mut HandTracker::new(1), &both).len(), 1);
}

#[test]
fn a_moving_hand_is_followed_steadily_and_found_again() {
    let still = hand();
    let background = *still.get_pixel(0, 0);
    let moved = |x: i64, y: i64| {
        let mut picture = RgbImage::from_pixel(still.width(), still.height(), background);
        overlay(&mut picture, &still, x, y);
        picture
    };
    let mut tracker = HandTracker::new(2);
    // From the second picture on, the region is that of the landmarks before.
    track(&mut tracker, &still);
    let start = track(&mut tracker, &still).remove(0);
    for frame in 1..12_i64 {
        let hands = track(&mut tracker, &moved(6 * frame, -3 * frame));
        let [hand] = &hands[..] else { panic!("frame {frame}: {} hands", hands.len()) };
        assert_eq!((hand.identity, hand.side), (start.identity, Side::Right));
        let shift = DVec3::new(6.0 * frame as f64, -3.0 * frame as f64, 0.0);
        let expected = start.landmarks.map(|p| p.extend(0.0) + shift);
        let off = largest(hand.landmarks.map(|p| p.extend(0.0)), &expected);
        assert!(off < 4.0, "frame {frame}: {off} pixels");
    }
    let empty = RgbImage::from_pixel(640, 480, Rgb([120, 130, 140]));
    assert_eq!(track(&mut tracker, &empty), []);
    let again = track(&mut tracker, &still);
    assert!(again.len() == 1 && again[0].identity != start.identity);
}

#[test]
fn bytes_of_another_size_are_an_error() {
    let mut tracker = HandTracker::new(1);
    for (bytes, width, height) in [(0, 0, 0), (11, 2, 2), (12, u32::MAX, u32::MAX)] {
        let error = tracker.track(&vec![0; bytes], width, height).unwrap_err().to_string();
        assert!(error.contains(&format!("{width} x {height}")), "{error}");
    }
    assert_eq!(tracker.track(&[9; 3], 1, 1).unwrap(), []);
}

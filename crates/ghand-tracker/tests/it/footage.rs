//! Real hands, if the footage and ffmpeg are there.

use std::process::Command;

use ghand_test_support::shared;
use ghand_tracker::HandTracker;

/// Frames of each film that are looked at.
const FRAMES: usize = 90;

/// In how many of the first frames a hand is found.
fn found(film: &str, width: u32, height: u32) -> Option<usize> {
    let path = shared(film)?;
    if !ghand_test_support::ffmpeg() {
        return None;
    }
    let arguments = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-frames:v", &FRAMES.to_string(), "-"];
    let output = Command::new("ffmpeg").args(["-loglevel", "error", "-i"]).arg(path).args(arguments).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let mut tracker = HandTracker::new(1);
    let frames = output.stdout.chunks_exact(width as usize * height as usize * 3);
    assert_eq!(frames.len(), FRAMES);
    Some(frames.filter(|frame| !tracker.track(frame, width, height).unwrap().is_empty()).count())
}

#[test]
fn real_hands_are_found_in_almost_all_frames() {
    // All 378 and 621 frames: 95 %, 100 %, 100 %; the first film begins without a hand.
    for (film, [width, height], least) in [
        ("footage/desk-two-cameras/cam0.mp4", [720, 720], 70),
        ("footage/desk-two-cameras/cam1.mp4", [720, 720], 88),
        ("footage/one-hand-mono/hand.mp4", [1280, 720], 88),
    ] {
        if let Some(found) = found(film, width, height) {
            assert!(found >= least, "{film}: {found} of {FRAMES}");
        }
    }
}

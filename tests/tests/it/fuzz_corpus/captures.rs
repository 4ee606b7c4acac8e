//! Runs the readers of `fuzz/fuzz_targets` on the inputs of `fuzz/corpus` and changed copies of them: the result is
//! valid or an error, never a panic.

use std::path::Path;

use ghand_capture::ghand_format::read_capture_text;
use ghand_capture::hand_appearance::read_pose;
use ghand_test_support::fuzz_corpus::inputs;
use rand::{Rng, RngExt, SeedableRng};

use crate::fixtures::mano;

/// Number of changed copies per input: enough to reach all parts of a reader, few enough to take only a few seconds.
const CHANGES: usize = 1500;

/// Applies one to four changes that typically damage text, or that a fuzzer tries.
fn changed(bytes: &[u8], random: &mut impl Rng) -> Vec<u8> {
    const PIECES: [&str; 10] =
        ["null", "-1", "1e999", "[]", "{}", "\"\"", "[[", "NaN", "18446744073709551616", "\"../x\""];
    let mut bytes = bytes.to_vec();
    for _ in 0..random.random_range(1..=4) {
        if bytes.is_empty() {
            break;
        }
        let at = random.random_range(0..bytes.len());
        let end = bytes.len().min(at + random.random_range(1..=12));
        match random.random_range(0..6) {
            0 => bytes[at] = random.random(),
            1 => drop(bytes.drain(at..end)),
            2 => {
                // Replaces a whole number, word or string.
                let ends = |b: &u8| b",:[]{}".contains(b);
                let end = bytes[at..].iter().position(ends).map_or(bytes.len(), |n| at + n);
                bytes.splice(at..end, PIECES[random.random_range(0..PIECES.len())].bytes());
            }
            3 => {
                let copy = bytes[at..end].to_vec();
                bytes.splice(at..at, copy);
            }
            4 => bytes.swap(at, end - 1),
            _ => bytes.truncate(at.max(bytes.len() / 2)),
        }
    }
    bytes
}

/// Runs inputs and changed copies; returns the number of valid inputs and the number of inputs.
fn run(target: &str, read: impl Fn(&[u8]) -> bool) -> (usize, usize) {
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(22);
    let inputs = inputs(target);
    let mut sound = 0;
    for (path, bytes) in &inputs {
        println!("{}", path.display());
        sound += usize::from(read(bytes));
        for _ in 0..CHANGES {
            read(&changed(bytes, &mut random));
        }
    }
    (sound, inputs.len())
}

#[test]
fn corpus_captures_and_changed_copies_give_a_valid_capture_or_an_error() {
    let (sound, inputs) = run("capture", |bytes| {
        let Ok(text) = std::str::from_utf8(bytes) else { return false };
        match read_capture_text(Path::new("/nowhere/capture.json"), text, Some(mano())) {
            Ok(capture) => {
                let joints = capture.hand_model.joint_count();
                assert!(capture.frames.iter().all(|f| f.pose.rotations.len() == joints));
                assert!(capture.frames.iter().flat_map(|f| &f.pose.rotations).all(|r| r.is_finite()));
                let cameras = capture.cameras.len();
                let frames = capture.frames.len();
                let views = || capture.splits.values().flat_map(|s| &s.views);
                assert!(views().all(|v| v.camera < cameras && v.frame < frames));
                assert!(views().all(|v| capture.image_file(v.camera, v.frame).unwrap().starts_with("/nowhere")));
                true
            }
            Err(error) => {
                assert!(error.to_string().contains("/nowhere"), "{error}");
                false
            }
        }
    });
    assert!(sound >= 2 && inputs > sound, "the corpus has {sound} valid of {inputs} inputs");
}

#[test]
fn corpus_pickles_are_read_as_poses_or_rejected() {
    run("pickle", |bytes| read_pose("0001_mano.pkl", bytes, mano()).is_ok());
}

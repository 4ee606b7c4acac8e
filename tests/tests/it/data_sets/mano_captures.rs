//! Captures in ghand's own format with MANO poses.

use ghand_capture::capture::{Frame, HandModelSource};
use ghand_capture::{Capture, OpenOptions};
use ghand_test_support::procedural_hand::ProceduralHand;

use crate::fixtures::{assert_says, mano, mano_hand, model_of, shape, synthetic};

#[test]
fn a_capture_with_mano_poses_is_written_and_read_with_the_users_file() {
    let folder = tempfile::tempdir().unwrap();
    let frames: Vec<Frame> = synthetic().frames.iter().map(|f| Frame { shape: shape(), ..f.clone() }).collect();
    let written = Capture {
        root: folder.path().into(),
        hand_model: mano().clone(),
        hand_model_source: HandModelSource::Mano,
        frames: frames.clone(),
        ..synthetic().clone()
    };
    written.save().unwrap();
    let text = std::fs::read_to_string(folder.path().join("capture.json")).unwrap();
    assert!(text.contains("\"kind\":\"mano\"") && text.len() < 100_000, "nothing of the model is in the file");
    let open = |model| Capture::open_with(folder.path(), &OpenOptions { mano: model, ..Default::default() });
    let read = open(Some(mano().clone())).unwrap().capture;
    assert_eq!((&read.frames, &read.splits, &read.hand_model), (&frames, &written.splits, mano()));
    assert_ne!(read.template.vertices, read.hand_model.vertices);
    assert_says(&open(None).unwrap_err().to_string(), &["capture.json", "hand_model.kind", "--hand-model"]);
    let left = model_of(&mano_hand().mirrored(), "MANO_LEFT.pkl");
    assert_says(&open(Some(left)).unwrap_err().to_string(), &["left hand", "side says right"]);
    let mut other = ProceduralHand { detail: 1, ..Default::default() }.build().unwrap();
    other.parents[3] = Some(0);
    assert_says(&open(Some(other)).unwrap_err().to_string(), &["not a MANO model", "MANO_RIGHT.pkl"]);
}

#[test]
fn the_error_for_a_folder_that_is_not_a_capture_lists_the_formats() {
    let folder = tempfile::tempdir().unwrap();
    let message = Capture::open(folder.path()).unwrap_err().to_string();
    assert_says(&message, &["capture.json", "InterHand2.6M", "Hand Appearance"]);
}

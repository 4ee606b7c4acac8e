//! Any text, read as a `capture.json`, gives a capture whose poses and splits are sound, or an error.
#![no_main]

use std::path::Path;
use std::sync::LazyLock;

use ghand_capture::ghand_format::read_capture_text;
use ghand_core::HandModel;
use ghand_test_support::procedural_hand::ProceduralHand;
use libfuzzer_sys::fuzz_target;

/// Has MANO's joints, and so stands for the user's MANO model.
static MODEL: LazyLock<HandModel> =
    LazyLock::new(|| ProceduralHand { detail: 1, ..Default::default() }.build().expect("the built-in hand is sound"));

fuzz_target!(|text: &str| {
    if let Ok(capture) = read_capture_text(Path::new("/nowhere/capture.json"), text, Some(&MODEL)) {
        let joints = capture.hand_model.joint_count();
        assert!(capture.frames.iter().all(|f| f.pose.rotations.len() == joints));
        for view in capture.splits.values().flat_map(|split| &split.views) {
            let file =
                capture.image_file(view.camera, view.frame).expect("splits name cameras and frames that are there");
            assert!(file.starts_with("/nowhere"));
        }
    }
});

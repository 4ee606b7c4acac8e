//! Any text, read as a `capture.json`, gives a capture whose poses and splits are sound, or an error.
#![no_main]

use std::path::Path;
use std::sync::LazyLock;

use ghand_core::HandModel;
use ghand_core::hand_model::mano::{ManoOptions, read_mano_bytes};
use ghand_data::untrusted::read_capture_text;
use libfuzzer_sys::fuzz_target;

/// A model in MANO's layout, though not of MANO's joints: captures that ask for MANO are read up to that.
static MODEL: LazyLock<HandModel> = LazyLock::new(|| {
    let bytes = include_bytes!("../corpus/pickle/protocol2.pkl");
    read_mano_bytes("right.pkl", bytes, None, &ManoOptions::default()).expect("the input is a model").model
});

fuzz_target!(|text: &str| {
    // Building a hand takes far longer than reading.
    if text.contains("procedural") {
        return;
    }
    if let Ok(capture) = read_capture_text(Path::new("/nowhere/capture.json"), text, Some(&MODEL)) {
        let joints = capture.hand_model.joint_count();
        assert!(capture.frames.iter().all(|f| f.pose.rotations.len() == joints));
        for view in capture.splits.values().flat_map(|split| &split.views) {
            let file = capture.image_file(view.camera, view.frame).expect("splits name cameras and frames that are there");
            assert!(file.starts_with("/nowhere"));
        }
    }
});

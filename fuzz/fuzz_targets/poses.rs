//! Any bytes, read as poses of any kind, give finite poses of the hand model or an error that names the file.
#![no_main]

use std::sync::LazyLock;

use ghand_core::HandModel;
use ghand_motion::PoseOptions;
use ghand_motion::pose_sequence::read_poses_bytes;
use ghand_test_support::procedural_hand::ProceduralHand;
use libfuzzer_sys::fuzz_target;

static HAND: LazyLock<HandModel> = LazyLock::new(|| {
    let hand = ProceduralHand { detail: 1, ..Default::default() };
    hand.build().expect("the built-in hand can be built")
});

fuzz_target!(|bytes: &[u8]| match read_poses_bytes("file", bytes, &HAND, &PoseOptions::default()) {
    Ok(sequence) => {
        for frame in &sequence.frames {
            assert_eq!(frame.pose.rotations.len(), HAND.joint_count());
            assert!(frame.pose.rotations.iter().all(|rotation| rotation.is_finite()));
        }
    }
    Err(error) => assert!(error.to_string().starts_with("file: ")),
});

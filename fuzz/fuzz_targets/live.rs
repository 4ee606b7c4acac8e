//! Any lines, read as the packets of a stream of live poses, give finite poses of the hand model or errors that name
//! the packet.
#![no_main]

use std::sync::LazyLock;

use ghand_core::HandModel;
use ghand_fuzz::read_live_packets;
use ghand_test_support::procedural_hand::ProceduralHand;
use libfuzzer_sys::fuzz_target;

static HAND: LazyLock<HandModel> = LazyLock::new(|| {
    let hand = ProceduralHand { detail: 1, ..Default::default() };
    hand.build().expect("the built-in hand can be built")
});

fuzz_target!(|bytes: &[u8]| {
    read_live_packets(bytes, &HAND);
});

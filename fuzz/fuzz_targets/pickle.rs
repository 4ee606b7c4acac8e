//! Any bytes, read as a MANO pickle, give a sound model or an error.
#![no_main]

use ghand_hand_model::files::mano::{ManoOptions, read_mano_bytes};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    if let Ok(file) = read_mano_bytes("left.pkl", bytes, Some(bytes), &ManoOptions::default()) {
        file.model.validate().expect("a model that was read is sound");
    }
});

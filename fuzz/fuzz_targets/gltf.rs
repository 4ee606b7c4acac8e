//! Any bytes, read as a glTF hand, give a sound model or an error.
#![no_main]

use ghand_hand_model::files::gltf::read_gltf_bytes;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    if let Ok(file) = read_gltf_bytes("hand.glb", bytes) {
        file.model.validate().expect("a model that was read is sound");
    }
});

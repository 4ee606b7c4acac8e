//! Any bytes, read as an archive of arrays and as a MANO model in one, give numbers or an error.
#![no_main]

use ghand_files::npz::Npz;
use ghand_hand_model::files::mano::{ManoOptions, read_mano_bytes};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    if let Ok(mut npz) = Npz::open(bytes) {
        for name in npz.names() {
            if let Ok(array) = npz.numbers(&name) {
                assert_eq!(array.values.len(), array.shape.iter().product::<usize>());
            }
        }
    }
    if let Ok(file) = read_mano_bytes("right.npz", bytes, None, &ManoOptions::default()) {
        file.model.validate().expect("a model that was read is sound");
    }
});

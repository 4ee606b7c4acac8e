//! Any bytes, read as each of InterHand2.6M's annotation files, are read or an error.
#![no_main]

use ghand_data::untrusted::read_interhand_annotations;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let _ = read_interhand_annotations(bytes);
});

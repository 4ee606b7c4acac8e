//! Any bytes, read as each of InterHand2.6M's annotation files, are read or an error.
#![no_main]

use ghand_capture::interhand::count_annotations;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let _ = count_annotations(bytes);
});

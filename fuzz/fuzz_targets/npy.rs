//! Any bytes as an `.npy` file in an archive, whose checksums are right, give numbers or an error.
#![no_main]

use std::io::{Cursor, Write};

use ghand_files::npz::Npz;
use ghand_hand_model::files::mano::{ManoOptions, read_mano_bytes};
use libfuzzer_sys::fuzz_target;
use zip::write::SimpleFileOptions;

fuzz_target!(|bytes: &[u8]| {
    let mut writer = zip::ZipWriter::new(Cursor::new(Vec::new()));
    let options = SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
    for name in ["v_template", "J_regressor", "f"] {
        writer.start_file(format!("{name}.npy"), options).expect("memory takes any file");
        writer.write_all(bytes).expect("memory takes any file");
    }
    let archive = writer.finish().expect("memory takes any file").into_inner();
    let mut npz = Npz::open(&archive).expect("the archive is sound");
    if let Ok(array) = npz.numbers("v_template") {
        assert_eq!(array.values.len(), array.shape.iter().product::<usize>());
    }
    let _ = read_mano_bytes("right.npz", &archive, None, &ManoOptions::default());
});

//! Runs the inputs of `fuzz/corpus`, and changes of them, through the readers of `fuzz/fuzz_targets`: the result is a
//! valid model or an error, never a panic.

use std::io::{Cursor, Write};
use std::path::Path;

use ghand_core::HandModel;
use ghand_files::npz::Npz;
use ghand_hand_model::files::gltf::read_gltf_bytes;
use ghand_hand_model::files::mano::{ManoOptions, read_mano_bytes};
use ghand_test_support::fuzz_corpus::{Content, changed, inputs};
use rand::SeedableRng;
use zip::write::SimpleFileOptions;

/// Changes of each input: some thousand for all readers, within a few seconds.
const CHANGES: usize = 2000;

fn run(target: &str, read: impl Fn(&[u8]) -> Option<HandModel>) -> (usize, usize) {
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(20);
    let mut read_as_they_are = 0;
    let mut count = 0;
    let check = |bytes: &[u8]| {
        let model = read(bytes);
        model.as_ref().inspect(|model| model.validate().expect("a model that was read is valid"));
        model.is_some()
    };
    for (path, bytes) in inputs(target) {
        println!("{}", path.display());
        read_as_they_are += usize::from(check(&bytes));
        for _ in 0..CHANGES {
            check(&changed(&bytes, Content::Binary, &mut random));
        }
        count += 1;
    }
    (read_as_they_are, count)
}

#[test]
fn pickles_of_the_corpus_and_changes_of_them_give_a_valid_model_or_an_error() {
    let read =
        |bytes: &[u8]| Some(read_mano_bytes("left.pkl", bytes, Some(bytes), &ManoOptions::default()).ok()?.model);
    let (sound, inputs) = run("pickle", read);
    assert!(sound >= 4 && inputs > sound, "{sound} of {inputs} inputs of the corpus are valid");
}

#[test]
fn archives_of_the_corpus_and_changes_of_them_give_a_valid_model_or_an_error() {
    let read = |bytes: &[u8]| {
        if let Ok(mut npz) = Npz::open(bytes) {
            for name in npz.names() {
                if let Ok(array) = npz.numbers(&name) {
                    assert_eq!(array.values.len(), array.shape.iter().product::<usize>());
                }
            }
        }
        Some(read_mano_bytes("right.npz", bytes, None, &ManoOptions::default()).ok()?.model)
    };
    let (sound, inputs) = run("npz", read);
    assert!(sound >= 2 && inputs > sound, "{sound} of {inputs} inputs of the corpus are valid");
}

#[test]
fn arrays_of_the_corpus_and_changes_of_them_in_an_archive_give_numbers_or_an_error() {
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(21);
    for (path, bytes) in inputs("npy") {
        println!("{}", path.display());
        for k in 0..CHANGES {
            let bytes = if k == 0 { bytes.clone() } else { changed(&bytes, Content::Binary, &mut random) };
            // The archive is written again, so that its checksums are correct.
            let mut writer = zip::ZipWriter::new(Cursor::new(Vec::new()));
            let options = SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
            for name in ["v_template", "f"] {
                writer.start_file(format!("{name}.npy"), options).unwrap();
                writer.write_all(&bytes).unwrap();
            }
            let archive = writer.finish().unwrap().into_inner();
            if let Ok(array) = Npz::open(&archive).unwrap().numbers("v_template") {
                assert_eq!(array.values.len(), array.shape.iter().product::<usize>());
            }
            let model = read_mano_bytes("right.npz", &archive, None, &ManoOptions::default());
            assert!(model.unwrap_err().to_string().starts_with("right.npz: "));
        }
    }
}

#[test]
fn gltf_files_of_the_corpus_and_changes_of_them_give_a_valid_model_or_an_error() {
    let (sound, inputs) = run("gltf", |bytes| Some(read_gltf_bytes("hand.glb", bytes).ok()?.model));
    assert!(sound >= 6 && inputs > sound, "{sound} of {inputs} inputs of the corpus are valid");
}

#[test]
fn shapes_of_the_corpus_are_read_or_rejected_with_one_sentence() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/corpus/gltf");
    let read =
        |name: &str| read_gltf_bytes("hand.glb", &std::fs::read(folder.join(name)).unwrap()).map_err(|e| e.to_string());
    let sound = [
        ("two_targets.glb", 2, 0),
        ("targets_without_joint_shifts.glb", 2, 1),
        ("sparse_target.glb", 2, 0),
        ("no_targets.glb", 0, 0),
        ("pose_correctives.glb", 2, 0),
    ];
    for (name, shapes, warnings) in sound {
        let file = read(name).unwrap();
        assert_eq!((file.model.shape_count(), file.warnings.len()), (shapes, warnings), "{name}");
        assert_eq!(file.model.pose_directions.is_empty(), name != "pose_correctives.glb");
    }
    let rejected = [
        ("target_of_another_count.glb", "targets[0].POSITION: has 3 entries for 4 positions"),
        ("normalized_target.glb", "glTF allows only floats in a morph target"),
        ("three_hundred_targets.glb", "300 morph targets, at most 256 are read"),
        ("joint_shifts_too_short.glb", "shape[\"taller\"].joint_shift: has 1 rows for 2 joints"),
        ("target_not_finite.glb", "targets[0].POSITION: entry 0 is not finite"),
    ];
    for (name, expected) in rejected {
        let message = read(name).unwrap_err();
        assert!(message.contains(expected), "{name}: {message}");
    }
}

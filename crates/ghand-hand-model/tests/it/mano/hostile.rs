//! Damaged and hostile files: a clear sentence, in little time and memory.

use std::time::{Duration, Instant};

use ghand_core::Side;
use ghand_hand_model::HandModelError;
use ghand_hand_model::files::mano::{ManoFile, ManoOptions, read_mano, read_mano_bytes};

use ghand_test_support::mano_files::hands::{Entries, Hand, as_npz, as_pickle, set};
use ghand_test_support::mano_files::python::{
    Array, Py, array, chumpy_selection, dictionary, npy, pickle, string, zip,
};

fn read(bytes: &[u8]) -> Result<ManoFile, HandModelError> {
    // The side is given to save the time to guess it.
    read_mano_bytes("some/file", bytes, None, &ManoOptions { side: Some(Side::Right), ..Default::default() })
}

fn assert_refused(bytes: &[u8], words: &[&str]) {
    let message = read(bytes).expect_err("it must be rejected").to_string();
    // File, field, and what to do.
    let remedies = ["download", "re-save", "save it", "store", "write", "pass", "bind", "must", "copy"];
    assert!(message.starts_with("some/file: ") && remedies.iter().any(|r| message.contains(r)), "{message}");
    for word in words {
        assert!(message.contains(word), "wanted {word}, got {message}");
    }
    assert!(message.len() < 400 && !message.contains('\n'), "{message}");
}

fn changed(key: &'static str, value: Py) -> Entries {
    let mut entries = Hand::small().published();
    set(&mut entries, key, value);
    entries
}

fn numbers(code: &'static str, shape: &[usize], values: &[f64]) -> Py {
    Py::Array(array(code, shape, false, values))
}

/// The small hand in every layout.
fn small_files() -> Vec<Vec<u8>> {
    let entries = Hand::small().published();
    vec![as_pickle(&entries), as_npz(&entries, false), as_npz(&entries, true)]
}

#[test]
fn a_file_truncated_anywhere_is_rejected() {
    for bytes in small_files() {
        assert!(read(&bytes).is_ok());
        for length in 0..bytes.len() {
            assert!(read(&bytes[..length]).is_err(), "cut at {length} of {}", bytes.len());
        }
    }
}

#[test]
fn a_file_with_any_byte_changed_gives_a_valid_model_or_an_error() {
    for bytes in small_files() {
        assert!(read(&bytes).is_ok());
        let mut bytes = bytes;
        // Of each valid model, an atlas is built, which takes long. All bytes are changed in the reader's own test.
        for at in (0..bytes.len()).step_by(ghand_test_support::cases(601, 11)) {
            for flip in [0xff, 0x01] {
                bytes[at] ^= flip;
                if let Ok(file) = read(&bytes) {
                    file.model.validate().unwrap();
                }
                bytes[at] ^= flip;
            }
        }
    }
}

#[test]
fn classes_that_no_model_needs_are_named_and_not_executed() {
    let folder = tempfile::tempdir().unwrap();
    let trace = folder.path().join("run");
    let command = string(&format!("touch {}", trace.display()));
    let mut entries = Hand::small().published();
    entries.push(("x", Py::Call("posix", "system", vec![command])));
    assert_refused(&as_pickle(&entries), &["pickle", "posix.system", "npz"]);
    // In an object of an archive, and by name from the stack (protocol 4).
    let entries = changed("J_regressor", Py::Call("os", "system", vec![string("true")]));
    assert_refused(&as_npz(&entries, true), &["J_regressor", "os.system"]);
    assert_refused(b"\x80\x04\x8c\x08builtins\x8c\x04eval\x93.", &["builtins.eval"]);
    assert!(!trace.exists());
}

#[test]
fn lengths_depth_and_sharing_take_little_memory_and_time() {
    let begin = Instant::now();
    let long = |code: u8| [&[0x80, 5, code][..], &(1u64 << 40).to_le_bytes(), b"."].concat();
    for code in [0x8e, 0x96, 0x8d] {
        assert_refused(&long(code), &["pickle", "truncated"]);
    }
    let deep = 1_000_000;
    let repeat = |head: &[u8], body: &[u8], tail: &[u8]| [b"\x80\x02", head, &body.repeat(deep), tail].concat();
    // A million marks; nested lists, tuples and dictionaries; one list inside itself.
    assert_refused(&repeat(b"", b"(", b"."), &["damaged"]);
    assert_refused(&repeat(b"", b"]", &[&b"a".repeat(deep - 1)[..], b"."].concat()), &["dictionary"]);
    assert_refused(&repeat(b"N", b"\x85", b"."), &["dictionary"]);
    assert_refused(&repeat(b"}", b"K\x01}", &[&b"s".repeat(deep)[..], b"."].concat()), &["v_template"]);
    assert_refused(b"\x80\x02]q\x00h\x00a.", &["dictionary"]);
    assert_refused(b"\x80\x02}q\x00U\x0av_templateh\x00s.", &["v_template", "dictionary"]);
    // Each tuple contains the previous one twice: 2^64 leaves.
    assert_refused(&repeat(b"N", b"2\x86", b"."), &["dictionary"]);
    assert_refused(&repeat(b"N", b"N0", b"."), &["dictionary"]);
    assert_refused(&[b"\x80\x02".to_vec(), b"N0".repeat(1 << 22)].concat(), &["instructions"]);
    // A selection from itself, and an array whose shape is the array.
    let itself = b"\x80\x02}U\x0av_templatecchumpy.reordering\nSelect\n)\x81q\x00}(U\x01ah\x00U\x04idxsh\x00ubs.";
    assert_refused(itself, &["v_template", "wrapped"]);
    let shape = b"\x80\x02}U\x0av_templatecnumpy.core.multiarray\n_reconstruct\n)Rq\x00\
        (K\x01h\x00\x85cnumpy\ndtype\nU\x02f8\x85R\x89U\x00tbs.";
    assert_refused(shape, &["v_template", "shape"]);
    assert!(begin.elapsed() < Duration::from_secs(5), "{:?}", begin.elapsed());
}

#[test]
fn shapes_that_do_not_match_are_named() {
    let small = Hand::small();
    let shapes = |rows, count| array("<f8", &[rows, 3, count], false, &vec![0.0; rows * 3 * count]);
    let cases = [
        ("v_template", numbers("<f8", &[15], &small.vertices), "[15], expected (V, 3)"),
        ("v_template", numbers("<f8", &[0, 3], &[]), "[0, 3]"),
        ("f", numbers("<u4", &[9], &small.faces), "(F, 3)"),
        ("f", numbers("<u4", &[0, 3], &[]), "(F, 3)"),
        ("weights", numbers("<f8", &[3, 5], &small.weights), "[3, 5], expected (5, 3)"),
        ("posedirs", Py::Array(shapes(5, 17)), "expected (5, 3, 18)"),
        ("shapedirs", chumpy_selection(shapes(4, 20), 10), "[4, 3, 10], expected (5, 3, n_s)"),
        ("hands_mean", numbers("<f8", &[3], &[0.0; 3]), "expected (6)"),
        ("hands_components", numbers("<f8", &[2, 3], &[0.0; 6]), "expected (c, 6)"),
        ("kintree_table", numbers("<i4", &[3], &[-1., 0., 1.]), "expected (2, n_b)"),
        ("J_regressor", numbers("<f8", &[3, 4], &[0.0; 12]), "[3, 4], expected (3, 5)"),
    ];
    for (key, value, words) in cases {
        let entries = changed(key, value);
        assert_refused(&as_pickle(&entries), &[key, words]);
        assert_refused(&as_npz(&entries, false), &[key, words]);
    }
    for key in ["v_template", "f", "weights", "kintree_table", "J_regressor", "shapedirs", "posedirs"] {
        let mut entries = small.published();
        entries.retain(|(name, _)| *name != key);
        assert_refused(&as_pickle(&entries), &[key, "missing"]);
        assert_refused(&as_npz(&entries, false), &[key, "missing"]);
    }
}

#[test]
fn invalid_numbers_are_named() {
    let small = Hand::small();
    let with = |at: usize, value: f64, values: &[f64]| {
        let mut values = values.to_vec();
        values[at] = value;
        values
    };
    let weights = |at, value| numbers("<f8", &[5, 3], &with(at, value, &small.weights));
    let tree = |values: &[f64]| numbers("<i8", &[2, 3], values);
    let cases = [
        ("weights", weights(3, f64::NAN), "NaN at [1, 0]"),
        ("weights", weights(3, f64::INFINITY), "inf at [1, 0]"),
        ("weights", weights(0, 0.0), "vertex 0 sum to 0"),
        ("weights", weights(4, 0.8), "vertex 1 sum to 1.05"),
        ("weights", weights(4, -0.75), "vertex 1 has the weight -0.75"),
        ("v_template", numbers("<f8", &[5, 3], &with(4, f64::NAN, &small.vertices)), "NaN at [1, 1]"),
        ("f", numbers("<i4", &[3, 3], &with(8, 5.0, &small.faces)), "vertex 5 of 5"),
        ("f", numbers("<i4", &[3, 3], &with(8, -1.0, &small.faces)), "vertex -1 of 5"),
        ("f", numbers("<f8", &[3, 3], &with(8, 0.5, &small.faces)), "vertex 0.5 of 5"),
        ("kintree_table", tree(&[-1., 2., 1., 0., 1., 2.]), "joint 1 the parent 2"),
        ("kintree_table", tree(&[-1., 1., 1., 0., 1., 2.]), "joint 1 the parent 1"),
        ("kintree_table", tree(&[0., 0., 1., 0., 1., 2.]), "joint 0 the parent 0"),
        ("kintree_table", tree(&[-1., -1., 1., 0., 1., 2.]), "joint 1 the parent -1"),
        ("kintree_table", tree(&[-1., 0., 1., 0., 2., 1.]), "joints must be numbered in order"),
        ("J_regressor", numbers("<f8", &[3, 5], &with(0, f64::NAN, &[0.2; 15])), "NaN at [0, 0]"),
        ("J_regressor", numbers("<f8", &[3, 5], &[0.0; 15]), "no entry for joint 0"),
    ];
    for (key, value, words) in cases {
        assert_refused(&as_pickle(&changed(key, value.clone())), &[key, words]);
        assert_refused(&as_npz(&changed(key, value), true), &[key, words]);
    }
}

#[test]
fn invalid_arrays_are_named() {
    let flat = |code, values: &[f64]| numbers(code, &[values.len()], values);
    let sparse = |starts: &[f64], indices: &[f64], data: &[f64]| {
        let state = dictionary(vec![
            ("_shape", Py::Tuple(vec![Py::Int(3), Py::Int(5)])),
            ("indptr", flat("<i4", starts)),
            ("indices", flat("<i4", indices)),
            ("data", flat("<f8", data)),
        ]);
        Py::Instance("scipy.sparse.csc", "csc_matrix", Box::new(state))
    };
    let select = |picks: &[f64], shape: &[i64]| {
        let x = Py::Instance("chumpy.ch", "Ch", Box::new(dictionary(vec![("x", numbers("<f8", &[15], &[0.0; 15]))])));
        let shape = shape.iter().map(|n| Py::Int(*n)).collect();
        let state = dictionary(vec![("a", x), ("idxs", flat("<i8", picks)), ("preferred_shape", Py::Tuple(shape))]);
        Py::Instance("chumpy.reordering", "Select", Box::new(state))
    };
    let bytes =
        |code, length: usize| Py::Array(Array { code, shape: vec![5, 3], fortran: false, bytes: vec![0; length] });
    let huge = Py::Array(Array { code: "<f8", shape: vec![1 << 40, 3], fortran: false, bytes: vec![] });
    let cases = [
        ("J_regressor", sparse(&[0., 1.], &[0.], &[1.]), "3 x 5 sparse matrix with 1 values, 1 indices and 2 starts"),
        ("J_regressor", sparse(&[0., 1., 1., 1., 1., 1.], &[3.], &[1.]), "the index 3"),
        ("J_regressor", sparse(&[0., 1., 1., 1., 1., 1.], &[-1.], &[1.]), "the index -1"),
        ("J_regressor", sparse(&[0., 1., 0., 1., 1., 1.], &[0.], &[1.]), "starts are not in order"),
        ("J_regressor", sparse(&[0., 2., 2., 2., 2., 2.], &[0.], &[1.]), "starts are not in order"),
        ("J_regressor", sparse(&[1., 1., 1., 1., 1., 1.], &[0.], &[1.]), "starts are not in order"),
        ("J_regressor", sparse(&[0., 1., 1., 1., 1., 1.], &[0.], &[f64::NAN]), "NaN at [0, 0]"),
        ("v_template", select(&[15.0; 15], &[5, 3]), "number 15 of 15"),
        ("v_template", select(&[0.0; 15], &[4, 3]), "15 numbers for the shape [4, 3]"),
        ("v_template", select(&[0.0; 15], &[1 << 40, 1 << 40]), "15 numbers for the shape"),
        ("v_template", select(&[0.0; 15], &[-5, -3]), "has an invalid shape"),
        ("v_template", string("no array"), "is text"),
        ("v_template", sparse(&[0.; 6], &[], &[]), "sparse"),
        ("v_template", Py::List(vec![Py::Int(1)]), "is a list"),
        ("v_template", bytes("|O8", 120), "objects"),
        ("v_template", bytes("<c8", 30), "c8"),
        ("v_template", bytes("<c16", 240), "c16"),
        ("v_template", bytes("|S8", 120), "text"),
        ("v_template", bytes("<f8", 119), "119 bytes"),
        ("v_template", huge, "at most 33554432 numbers"),
    ];
    for (key, value, words) in cases {
        assert_refused(&as_pickle(&changed(key, value)), &[key, words]);
    }
}

#[test]
fn archives_that_are_too_large_when_unpacked_are_rejected() {
    // Half a gigabyte of zeros in half a megabyte, and a shape that does not fit into any memory.
    let mut bomb = npy(&numbers("<f8", &[5, 3], &Hand::small().vertices));
    bomb.resize((1 << 29) + 1, 0);
    let files = |bytes: Vec<u8>| vec![("v_template.npy".to_owned(), bytes)];
    let begin = Instant::now();
    let archive = zip(&files(bomb), true);
    assert!(archive.len() < 1 << 20);
    let writing = begin.elapsed();
    assert_refused(&archive, &["v_template", "too large when unpacked"]);
    assert!(begin.elapsed() < 2 * writing + Duration::from_secs(5));
    let shape = Py::Array(Array { code: "<f8", shape: vec![1 << 60, 3], fortran: false, bytes: vec![] });
    assert_refused(&zip(&files(npy(&shape)), true), &["v_template", "at most 33554432 numbers"]);
}

#[test]
fn npy_headers_of_other_than_plain_arrays_are_rejected() {
    let header = |version: [u8; 2], text: &str| {
        let mut bytes = [b"\x93NUMPY".as_slice(), &version].concat();
        bytes.extend((text.len() as u16).to_le_bytes());
        if version[0] > 1 {
            bytes.extend([0, 0]);
        }
        bytes.extend(text.bytes());
        zip(&[("v_template.npy".to_owned(), [bytes, vec![0; 120]].concat())], false)
    };
    let good = "{'descr': '<f8', 'fortran_order': False, 'shape': (5, 3), }";
    for version in [[1, 0], [2, 0], [3, 0]] {
        // This one is read: the next key is missing.
        assert_refused(&header(version, good), &["f: is missing"]);
    }
    let python_two = "{'shape': (5L, 3L), 'descr': \"<f8\", 'fortran_order': True}\n";
    assert_refused(&header([1, 0], python_two), &["f: is missing"]);
    let unreadable = [
        ([4, 0], good),
        ([1, 0], ""),
        ([1, 0], "{}"),
        ([1, 0], "{'descr': '<f8', 'fortran_order': False, 'shape': (5, 3), 'more': 1}"),
        ([1, 0], "{'descr': [('a', '<f8')], 'fortran_order': False, 'shape': (5, 3), }"),
        ([1, 0], "{'descr': '<f8', 'fortran_order': 0, 'shape': (5, 3), }"),
        ([1, 0], "{'descr': '<f8', 'fortran_order': False, 'shape': (5, -3), }"),
        ([1, 0], "{'descr': '<f8', 'fortran_order': False, 'shape': (99999999999999999999, 3), }"),
        ([1, 0], "{'descr': '<f8', 'fortran_order': False, 'shape': (5, 3), } x"),
        ([1, 0], "{'descr': '<f8', 'descr': '<f8', 'fortran_order': False, 'shape': (5, 3), }"),
        ([1, 0], "((((((((((((((((((("),
    ];
    for (version, text) in unreadable {
        assert_refused(&header(version, text), &["v_template", "not a readable .npy file"]);
    }
    let wrong_length = "{'descr': '<f8', 'fortran_order': False, 'shape': (4, 3), }";
    assert_refused(&header([1, 0], wrong_length), &["v_template", "120 bytes"]);
}

#[test]
fn files_that_are_not_models_are_reported_as_such() {
    for bytes in [&b""[..], b"<html>", b"\x93NUMPY\x01\x00", b"\x1f\x8b", b"version https://git-lfs"] {
        assert_refused(bytes, &["neither a pickle nor an .npz"]);
    }
    assert_refused(&pickle(&Py::List(vec![])), &["dictionary"]);
    assert_refused(b"PK\x03\x04", &["npz"]);
    let missing = read_mano(std::path::Path::new("no/such/file.pkl"), &ManoOptions::default()).unwrap_err();
    assert!(missing.to_string().starts_with("no/such/file.pkl: cannot read"), "{missing}");
}

/// A row of `count` joints of SMPL's hierarchy, as `kintree_table` has it.
fn body_tree(count: usize) -> Py {
    let body = [-1.0, 0., 0., 0., 1., 2., 3., 4., 5., 6., 7., 8., 9., 9., 9., 12., 13., 14., 16., 17., 18., 19.];
    let parents = (0..count).map(|k| body.get(k).copied().unwrap_or(20.0 + (k % 2) as f64));
    let values: Vec<f64> = parents.chain((0..count).map(|k| k as f64)).collect();
    numbers("<i8", &[2, count], &values)
}

#[test]
fn whole_bodies_are_refused_by_name() {
    for (name, vertices, joints) in [
        ("SMPL (6890 vertices, 24 joints)", 6890, 24),
        ("SMPL-H (6890 vertices, 52 joints)", 6890, 52),
        ("SMPL-X (10475 vertices, 55 joints)", 10475, 55),
        ("SMPL-X (20 vertices, 55 joints)", 20, 55),
        ("SMPL or a model made from it (10475 vertices, 75 joints)", 10475, 75),
    ] {
        let mut entries = changed("kintree_table", body_tree(joints));
        set(&mut entries, "v_template", numbers("<f8", &[vertices, 3], &vec![0.1; 3 * vertices]));
        for bytes in [as_pickle(&entries), as_npz(&entries, true)] {
            assert_refused(&bytes, &["is a whole body", name, "MANO_RIGHT.pkl"]);
        }
    }
    // A rig of 24 joints that is not a body's is left to the other checks.
    let chain: Vec<f64> = (0..24).map(|k| f64::from(k) - 1.0).chain((0..24).map(f64::from)).collect();
    assert_refused(&as_pickle(&changed("kintree_table", numbers("<i8", &[2, 24], &chain))), &["weights"]);
}

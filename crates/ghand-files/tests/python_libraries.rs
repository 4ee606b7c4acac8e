//! Files that PyTorch 2.15 and joblib 1.6 wrote, and changed copies of them.
#![allow(clippy::unwrap_used, clippy::indexing_slicing, reason = "tests")]

use std::path::{Path, PathBuf};

use ghand_files::Value;
use ghand_files::npz::NumericArray;

/// Rows of the tensor that most entries are views or copies of.
const ROWS: [[f64; 4]; 3] = [[-4.5, -3.5, -2.5, -1.5], [-0.5, 0.5, 1.5, 2.5], [3.5, 4.5, 5.5, 6.5]];
const TENSOR_FILES: [&str; 2] = ["tensors.pt", "tensors_before_1_6.pt"];

fn path(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(name)
}

fn bytes(name: &str) -> Vec<u8> {
    std::fs::read(path(name)).unwrap()
}

fn read(name: &str) -> Value {
    Value::read(&path(name)).unwrap()
}

fn array(shape: &[usize], values: &[f64]) -> Value {
    Value::Numbers(NumericArray { shape: shape.to_vec(), values: values.to_vec() })
}

fn turned() -> Value {
    let values: Vec<f64> = (0..4).flat_map(|column| ROWS.map(|row| row[column])).collect();
    array(&[4, 3], &values)
}

#[test]
fn tensors_of_all_types_and_strides_are_read_in_both_formats() {
    let plain = ROWS.concat();
    for file in TENSOR_FILES {
        let value = read(file);
        let is = |name: &str, expected: Value| assert_eq!(value.get(name), Some(&expected), "{file}: {name}");
        is("plain", array(&[3, 4], &plain));
        is("turned", turned());
        is("column", array(&[3], &[-3.5, 0.5, 4.5]));
        is("part", array(&[2, 2], &[-0.5, 1.5, 3.5, 5.5]));
        is("wide", array(&[2, 3], &[1.5; 6]));
        is("half", array(&[3, 4], &plain));
        is("brain", array(&[3, 4], &plain));
        let thirds: Vec<f64> = plain.iter().map(|v| v / 3.0).collect();
        is("double", array(&[3, 4], &thirds));
        is("long", array(&[6], &[-2.0, -1.0, 0.0, 1.0, 2.0, 3.0]));
        is("int8", array(&[2], &[-1.0, 2.0]));
        is("uint8", array(&[2], &[200.0, 3.0]));
        is("uint16", array(&[2], &[65535.0, 1.0]));
        is("bool", array(&[2], &[1.0, 0.0]));
        is("number", array(&[], &[2.5]));
        is("empty", array(&[0, 3], &[]));
        is("parameter", array(&[2], &[0.5, -0.5]));
        is("array", array(&[2, 2], &[1.0, 2.0, 3.0, 4.0]));
        is("size", array(&[2], &[3.0, 4.0]));
        is("text", Value::Text("x".into()));
        let second = value.get("nested").and_then(Value::items).unwrap()[1].clone();
        assert_eq!(second.get("a"), Some(&array(&[4], &ROWS[1])));
    }
}

#[test]
fn tensors_in_ordinary_pickles_are_read() {
    for file in ["tensors.pkl", "tensors_protocol2.pkl"] {
        let value = read(file);
        assert_eq!(value.get("plain"), Some(&array(&[3, 4], &ROWS.concat())), "{file}");
        assert_eq!(value.get("turned"), Some(&turned()), "{file}");
    }
    let value = read("tensors.pkl");
    assert_eq!(value.get("half"), Some(&array(&[3, 4], &ROWS.concat())));
    assert_eq!(value.get("parameter"), Some(&array(&[2], &[0.5, -0.5])));
    assert_eq!(value.get("number"), Some(&array(&[], &[2.5])));
}

#[test]
fn tensors_without_plain_numbers_are_named_and_the_others_are_read() {
    let value = read("unreadable_tensors.pt");
    assert_eq!(value.get("pose"), Some(&array(&[3, 4], &ROWS.concat())));
    for (name, what) in [
        ("quantised", "quantised tensor; save tensor.dequantize()"),
        ("complex", "complex numbers"),
        ("sparse", "sparse or nested tensor; save tensor.to_dense()"),
        ("f8", "floats of 8 bits; save tensor.float()"),
    ] {
        let Some(Value::Unreadable(problem)) = value.get(name) else { panic!("{name}: {:?}", value.get(name)) };
        assert!(problem.contains(what), "{name}: {problem}");
    }
}

#[test]
fn the_byte_order_of_a_file_is_that_of_its_storages() {
    // The four bytes of the storage of 1.5, in the other order, and the mark of that order.
    let mut bytes = bytes("tensors.pt");
    let value = 1.5f32.to_le_bytes();
    let before = Value::from_bytes(&bytes).unwrap();
    assert_eq!(before.get("wide"), Some(&array(&[2, 3], &[1.5; 6])));
    let mut parts = zip::ZipArchive::new(std::io::Cursor::new(std::mem::take(&mut bytes))).unwrap();
    let mut writer = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    for index in 0..parts.len() {
        let mut file = parts.by_index(index).unwrap();
        let name = file.name().unwrap().to_string();
        let mut data = Vec::new();
        std::io::Read::read_to_end(&mut file, &mut data).unwrap();
        if name.ends_with("byteorder") {
            data = b"big".to_vec();
        } else if data == value {
            data.reverse();
        }
        writer.start_file(name, zip::write::SimpleFileOptions::default()).unwrap();
        std::io::Write::write_all(&mut writer, &data).unwrap();
    }
    let turned = Value::from_bytes(&writer.finish().unwrap().into_inner()).unwrap();
    assert_eq!(turned.get("wide"), Some(&array(&[2, 3], &[1.5; 6])));
    assert_ne!(turned.get("plain"), before.get("plain"));
}

#[test]
fn arrays_of_joblib_are_read_plain_and_compressed() {
    let rows = [-2.5, -1.5, -0.5, 0.5, 1.5, 2.5];
    for file in ["arrays.joblib", "arrays_zlib.joblib", "arrays_gzip.joblib"] {
        let value = read(file);
        let is = |name: &str, expected: Value| assert_eq!(value.get(name), Some(&expected), "{file}: {name}");
        is("c", array(&[2, 3], &rows));
        is("f", array(&[2, 3], &rows));
        is("turned", array(&[3, 2], &[-2.5, 0.5, -1.5, 1.5, -0.5, 2.5]));
        is("i", array(&[3], &[0.0, 1.0, 2.0]));
        is("number", array(&[], &[1.5]));
        is("one", array(&[], &[7.0]));
        is("texts", Value::List(vec![Value::Text("a".into()), Value::Text("bc".into())]));
        is("tensor", array(&[3, 4], &ROWS.concat()));
        let frames = value.get("frames").and_then(Value::items).unwrap();
        assert_eq!(frames[1].get("x"), Some(&array(&[3], &rows[3..])));
    }
    let problem = Value::read(&path("arrays_xz.joblib")).unwrap_err().to_string();
    assert!(problem.contains("compressed by xz") && problem.contains("joblib.dump"), "{problem}");
}

/// A pickle of a tensor with this offset, shape, strides and number of elements, over a storage of six floats.
fn tensor(offset: &str, shape: &str, strides: &str, count: u8) -> Vec<u8> {
    let text = |text: &str| [b"X", &(text.len() as u32).to_le_bytes()[..], text.as_bytes()].concat();
    let tuple = |numbers: &str| {
        let numbers: String = numbers.split_whitespace().map(|n| format!("L{n}L\n")).collect();
        format!("({numbers}t").into_bytes()
    };
    let reference =
        [&b"("[..], &text("storage"), b"ctorch\nFloatStorage\n", &text("0"), &text("cpu"), &[b'K', count], b"tQ"];
    let reference = reference.concat();
    let offset = format!("L{offset}L\n").into_bytes();
    let parts = [
        &b"\x80\x02ctorch._utils\n_rebuild_tensor_v2\n("[..],
        &reference,
        &offset,
        &tuple(shape),
        &tuple(strides),
        b"\x89}tR.",
    ];
    let mut writer = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    let floats: Vec<u8> = (0..6).flat_map(|k| f32::from(k as u8).to_le_bytes()).collect();
    for (name, data) in [("a/data.pkl", parts.concat()), ("a/data/0", floats)] {
        writer.start_file(name, zip::write::SimpleFileOptions::default()).unwrap();
        std::io::Write::write_all(&mut writer, &data).unwrap();
    }
    writer.finish().unwrap().into_inner()
}

#[test]
fn hostile_views_are_refused_and_odd_ones_are_read() {
    let value = |offset, shape, strides| Value::from_bytes(&tensor(offset, shape, strides, 6));
    assert_eq!(value("1", "2 2", "2 1").unwrap(), array(&[2, 2], &[1.0, 2.0, 3.0, 4.0]));
    // The stride of an axis of length 1 is arbitrary.
    assert_eq!(value("5", "1 1", "9223372036854775807 9").unwrap(), array(&[1, 1], &[5.0]));
    assert_eq!(value("0", "0", "7").unwrap(), array(&[0], &[]));
    for (offset, shape, strides, problem) in [
        ("0", "7", "1", "beyond its storage"),
        ("6", "1", "1", "beyond its storage"),
        ("0", "2", "6", "beyond its storage"),
        ("0", "2 2", "3", "more axes than strides"),
        ("-1", "2", "1", "invalid offset"),
        ("0", "2", "-1", "invalid shape"),
        ("9223372036854775807", "2", "1", "beyond its storage"),
        ("0", "2 2", "9223372036854775807 9223372036854775807", "beyond its storage"),
        ("0", "1000000 1000000", "0 0", "numbers"),
        ("0", "9223372036854775807", "0", "numbers"),
    ] {
        let found = value(offset, shape, strides).unwrap_err().to_string();
        assert!(found.contains(problem), "{offset} {shape} {strides}: {found}");
    }
    let longer = Value::from_bytes(&tensor("0", "2", "1", 7)).unwrap_err().to_string();
    assert!(longer.contains("shorter than it says"), "{longer}");
}

#[test]
fn cut_and_changed_files_are_errors_or_values_but_never_a_panic() {
    let names = ["tensors.pt", "tensors_before_1_6.pt", "tensors.pkl", "arrays.joblib", "arrays_zlib.joblib"];
    let mut errors = 0;
    for name in names {
        let bytes = bytes(name);
        for at in 0..bytes.len() {
            let mut changed = bytes.clone();
            changed[at] ^= 0x81;
            errors += usize::from(Value::from_bytes(&changed).is_err());
            errors += usize::from(Value::from_bytes(&bytes[..at]).is_err());
        }
    }
    assert!(errors > 1000, "{errors}");
}

#[test]
fn what_compressed_files_expand_to_is_bounded() {
    let mut packed = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::best());
    let zeros = vec![b' '; 1 << 20];
    for _ in 0..513 {
        std::io::Write::write_all(&mut packed, &zeros).unwrap();
    }
    let problem = Value::from_bytes(&packed.finish().unwrap()).unwrap_err().to_string();
    assert!(problem.contains("larger than 512 MiB when unpacked"), "{problem}");
}

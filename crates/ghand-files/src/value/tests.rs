use std::fs::File;
use std::io::{Cursor, Write};

use super::*;

fn json(text: &str) -> Value {
    Value::from_bytes(text.as_bytes()).unwrap()
}

fn array(shape: &[usize], values: &[f64]) -> Value {
    Value::Numbers(NumericArray { shape: shape.to_vec(), values: values.to_vec() })
}

fn problem(bytes: &[u8]) -> String {
    Value::from_bytes(bytes).unwrap_err().to_string()
}

#[test]
fn rows_of_equal_shape_become_one_array() {
    assert_eq!(json("[[1,2,3],[4,5,6]]"), array(&[2, 3], &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]));
    assert_eq!(json("[[[1]],[[2]]]"), array(&[2, 1, 1], &[1.0, 2.0]));
    assert_eq!(json("[true,false,2]"), array(&[3], &[1.0, 0.0, 2.0]));
    let ragged = json("[[1,2],[3]]");
    assert_eq!(ragged, Value::List(vec![array(&[2], &[1.0, 2.0]), array(&[1], &[3.0])]));
    assert_eq!(ragged.items().unwrap().len(), 2);
    assert_eq!(json("[[1,2],null]"), Value::List(vec![array(&[2], &[1.0, 2.0]), Value::Nothing]));
    assert_eq!(json("[]"), Value::List(vec![]));
    let map = json(r#"{"a":{"b":[7]},"c":"x","d":null}"#);
    assert_eq!(map.get("a").and_then(|a| a.get("b")).and_then(Value::number), Some(7.0));
    assert_eq!((map.get("c").and_then(Value::text), map.get("d")), (Some("x"), Some(&Value::Nothing)));
}

#[test]
fn missing_numbers_and_those_that_only_python_writes_are_nan() {
    for text in ["[null,1]", "[1,null]", "[NaN,1]", "[1, -Infinity]", "[1,Infinity]", "[null,null]"] {
        let value = json(text);
        let array = value.numbers().unwrap();
        assert!(array.shape == [2] && array.values.iter().any(|v| v.is_nan()), "{text}");
    }
    let Value::Map(entries) = json(r#"{"NaN \" -Infinity": "NaN", "n": NaN}"#) else { panic!("a map") };
    assert_eq!(entries[0], ("NaN \" -Infinity".into(), Value::Text("NaN".into())));
    assert_eq!(entries[1].1, Value::Nothing);
}

#[test]
fn damaged_or_endless_input_is_a_clear_error() {
    assert!(problem(b"{\"a\":1,\"a\":2}").contains("\"a\" occurs twice"));
    assert!(problem(b"{\"a\":[1,2").contains("ends too early"));
    assert!(problem(b"{} x").contains("trailing"));
    assert!(problem(b"hello").contains("neither JSON"));
    assert!(problem(b"").contains("is empty"));
    assert!(problem(&b"[".repeat(100_000)).contains("recursion"));
    let many = format!("[{}0]", "\"\",".repeat((1 << 22) + 1));
    assert!(problem(many.as_bytes()).contains("has more than 4194304 values"));
    // A list that contains itself would be read forever.
    assert!(problem(b"\x80\x02]q\x00(h\x00h\x00e.").contains("deep"));
    assert!(problem(b"cos\nsystem\n.").contains("os.system"));
}

#[test]
fn json_lines_are_a_list_of_their_values_and_a_broken_line_is_named() {
    assert_eq!(json("[1,2]\n[3,4]\n"), array(&[2, 2], &[1.0, 2.0, 3.0, 4.0]));
    let Value::List(frames) = json("\n{\"a\":1}\r\n\n{\"a\":NaN}\n{\"b\":[2]}") else { panic!("a list") };
    assert_eq!(frames.len(), 3);
    assert_eq!((frames[0].get("a").and_then(Value::number), frames[1].get("a")), (Some(1.0), Some(&Value::Nothing)));
    // A single line is the value itself.
    assert_eq!(json("{\"a\":1}\n").get("a").and_then(Value::number), Some(1.0));
    let cut = problem(b"{\"a\":1}\n{\"a\":2}\n{\"a\":");
    assert!(cut.contains("line 3: ") && cut.contains("ends too early"), "{cut}");
    assert!(problem(b"{\"a\":1} {\"a\":2}").contains("trailing"));
}

#[test]
fn typed_arrays_of_javascript_are_arrays_and_other_maps_stay_maps() {
    assert_eq!(json(r#"{"0":1.5,"1":2,"2":-3}"#), array(&[3], &[1.5, 2.0, -3.0]));
    for text in [r#"{"0":1}"#, r#"{"1":1,"0":2}"#, r#"{"0":1,"1":[2]}"#, r#"{"0":1,"2":2}"#, r#"{"0":1,"01":2}"#] {
        assert!(matches!(json(text), Value::Map(_)), "{text}");
    }
}

#[test]
fn memory_is_bounded_for_any_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("huge.json");
    // A sparse file: 2 GiB that take no disk space.
    File::create(&path).unwrap().set_len(2 << 30).unwrap();
    assert!(Value::read(&path).unwrap_err().to_string().contains("larger than 512 MiB"));
    let budget = budget::Budget::new();
    assert!(budget.numbers(1 << 25).is_ok() && budget.numbers(1).is_err());
}

#[test]
fn pickles_of_plain_values_are_read() {
    // {'a': [1, 2.5, None], 'b': (u'x', True), 3: {}} of protocol 2.
    let bytes = b"\x80\x02}(U\x01a](K\x01G\x40\x04\0\0\0\0\0\0NeU\x01bX\x01\0\0\0x\x88\x86K\x03}u.";
    let value = Value::from_bytes(bytes).unwrap();
    let a = value.get("a").and_then(Value::numbers).unwrap();
    assert!(a.values[..2] == [1.0, 2.5] && a.values[2].is_nan());
    assert_eq!(value.get("b"), Some(&Value::List(vec![Value::Text("x".into()), array(&[], &[1.0])])));
    assert_eq!(value.get("3"), Some(&Value::Map(vec![])));
}

#[test]
fn files_of_other_formats_are_named_with_what_converts_them() {
    let cases: [(&[u8], &str, &str); 38] = [
        (b"\x89HDF\r\n\x1a\n\0\0", "HDF5", "h5py"),
        (b"MATLAB 5.0 MAT-file, Platform", "MATLAB", "loadmat"),
        (b"MATLAB 7.3 MAT-file", "MATLAB 7.3", "h5py"),
        (b"Kaydara FBX Binary  \0", "FBX", "Blender"),
        (b"; FBX 7.3.0 project file", "FBX", "Blender"),
        (b"HIERARCHY\nROOT Hips\n", "BVH", "Blender"),
        (b"PXR-USDC\0", "USD", "Blender"),
        (b"#usda 1.0\n", "USD", "Blender"),
        (b"PAR1\x15", "Parquet", "pandas"),
        (b"ARROW1\0\0", "Arrow", "pandas"),
        (b"#ROSBAG V2.0\n", "ROS", "rosbags"),
        (b"\x89MCAP0\r\n", "ROS", "mcap"),
        (b"SQLite format 3\0", "SQLite", "numpy.savez"),
        (b"\0\0\0\x20ftypisom", "video", "tracker"),
        (b"\0\0\0\x18ftypheic", "image", "tracker"),
        (b"\x1a\x45\xdf\xa3", "video", "tracker"),
        (b"\x89PNG\r\n\x1a\n", "image", "tracker"),
        (b"\xff\xd8\xff\xe0", "image", "tracker"),
        (b"RIFF\0\0\0\0AVI ", "video", "tracker"),
        (b"glTF\x02\0\0\0", "glTF", "--hand-model"),
        (b"ply\nformat ascii 1.0\n", "mesh", "rotations or landmarks"),
        (b"\x83\xa6frames\x90", "MessagePack", "msgpack"),
        (b"\xde\0\x11\xd9\x04pose\x90", "MessagePack", "msgpack"),
        (b"\x02\0\0\0\0\0\0\0{}", "safetensors", "load_file"),
        (b"frame,x,y,z\n0,0.1,0.2,0.3\n", "CSV", "read_csv"),
        (b"camera;x;y\n1;2;3\n", "CSV", "read_csv"),
        (b"(a),b\n1,2\n", "CSV", "read_csv"),
        (b"0.1 0.2 0.3\n0.4 0.5 0.6\n", "rows of numbers", "loadtxt"),
        (b"# comment\n1\n2\n", "rows of numbers", "loadtxt"),
        (b"fps: 30\npose:\n  - [0, 0, 0]\n", "YAML", "safe_load"),
        (b"---\ncamera: 1\n", "YAML", "safe_load"),
        (b"camera: 1\n", "YAML", "safe_load"),
        (b"<?xml version=\"1.0\"?>", "XML", "ElementTree"),
        (b"<!DOCTYPE html><html>", "web page", "download"),
        (b"version https://git-lfs.github.com/spec/v1\noid", "Git LFS", "git lfs pull"),
        (b"BZh91AY&SY", "bzip2", "bunzip2"),
        (b"\x28\xb5\x2f\xfd\0", "zstd", "unzstd"),
        (b"\x1f\x8b\x08\0", "gzip", "write the file again"),
    ];
    for (bytes, what, remedy) in cases {
        let problem = problem(bytes);
        assert!(problem.contains(what) && problem.contains(remedy), "{:?}: {problem}", String::from_utf8_lossy(bytes));
    }
    let prose = ["hello", "BMW", "camera poses follow", "x^2"];
    assert!(prose.iter().all(|text| problem(text.as_bytes()).contains("neither JSON")));
}

#[test]
fn compressed_files_are_read_as_what_is_in_them() {
    for text in ["[[1,2],[3,4]]", "{\"pose\":[1]}"] {
        let mut gzip = flate2::write::GzEncoder::new(vec![], flate2::Compression::default());
        let mut zlib = flate2::write::ZlibEncoder::new(vec![], flate2::Compression::default());
        gzip.write_all(text.as_bytes()).unwrap();
        zlib.write_all(text.as_bytes()).unwrap();
        for packed in [gzip.finish().unwrap(), zlib.finish().unwrap()] {
            assert_eq!(Value::from_bytes(&packed).unwrap(), json(text));
            assert!(problem(&packed[..packed.len() - 3]).contains("damaged"));
        }
    }
}

#[test]
fn zip_archives_of_other_files_name_the_first() {
    for name in ["poses/0001.json", "xl/workbook.xml"] {
        let mut writer = zip::ZipWriter::new(Cursor::new(Vec::new()));
        writer.start_file(name, zip::write::SimpleFileOptions::default()).unwrap();
        writer.write_all(b"{}").unwrap();
        let problem = problem(&writer.finish().unwrap().into_inner());
        assert!(problem.contains(name) && problem.contains("unpack it"), "{problem}");
    }
}

fn npy(code: &str, shape: &str, data: &[u8]) -> Vec<u8> {
    let header = format!("{{'descr': '{code}', 'fortran_order': False, 'shape': {shape}, }}\n");
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    bytes.extend(data);
    bytes
}

#[test]
fn archives_are_read_with_texts_and_halves_and_mark_unreadable_entries() {
    let mut writer = zip::ZipWriter::new(Cursor::new(Vec::new()));
    let options = zip::write::SimpleFileOptions::default();
    // 1, -2, the smallest number above 0, infinity.
    let halves = [0x3c00u16, 0xc000, 0x0001, 0x7c00].map(u16::to_le_bytes).concat();
    let texts: Vec<u8> = "abcd".chars().flat_map(|c| u32::from(c).to_le_bytes()).collect();
    for (name, bytes) in [
        ("half", npy("<f2", "(4,)", &halves)),
        ("texts", npy("<U2", "(2,)", &texts)),
        ("complex", npy("<c8", "(1,)", &[0; 8])),
    ] {
        writer.start_file(format!("{name}.npy"), options).unwrap();
        writer.write_all(&bytes).unwrap();
    }
    let value = Value::from_bytes(&writer.finish().unwrap().into_inner()).unwrap();
    assert_eq!(value.get("half"), Some(&array(&[4], &[1.0, -2.0, 2f64.powi(-24), f64::INFINITY])));
    assert_eq!(value.get("texts"), Some(&Value::List(vec![Value::Text("ab".into()), Value::Text("cd".into())])));
    assert!(matches!(value.get("complex"), Some(Value::Unreadable(_))));
    assert_eq!(Value::from_bytes(&npy("<f2", "(2,)", &halves[..4])).unwrap(), array(&[2], &[1.0, -2.0]));
}

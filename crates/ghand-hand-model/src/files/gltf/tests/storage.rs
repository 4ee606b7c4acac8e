//! All the ways in which a file may store its numbers, including harmful ones.

use std::fs::File;

use base64::Engine;
use base64::prelude::{BASE64_STANDARD, BASE64_STANDARD_NO_PAD};
use glam::DVec2;

use super::*;

/// The small hand as a .gltf file in its own folder, with its buffer at `uri`.
struct LooseHand {
    folder: tempfile::TempDir,
    bytes: Vec<u8>,
}

impl LooseHand {
    fn new(uri: &str) -> LooseHand {
        let hand = SmallHand::new().replace(r#""byteLength":432}"#, &format!(r#""byteLength":432,"uri":"{uri}"}}"#));
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("small.gltf"), &hand.json).unwrap();
        LooseHand { folder, bytes: hand.bytes }
    }

    fn put(&self, name: &str) -> File {
        let path = self.folder.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(&path, &self.bytes).unwrap();
        File::options().write(true).open(path).unwrap()
    }

    fn read(&self) -> Result<HandModel, HandModelError> {
        Ok(read_gltf(&self.folder.path().join("small.gltf"), None)?.model)
    }
}

/// The surface and the joints; names of files differ.
fn content(model: HandModel) -> (Vec<DVec3>, Vec<DVec3>, Vec<f64>) {
    (model.vertices, model.joints, model.weights)
}

#[test]
fn buffers_within_the_file_are_decoded() {
    let bytes = SmallHand::new().bytes;
    for data in [BASE64_STANDARD.encode(&bytes), BASE64_STANDARD_NO_PAD.encode(&bytes)] {
        for kind in ["application/octet-stream", "application/gltf-buffer", ""] {
            let model = LooseHand::new(&format!("data:{kind};base64,{data}")).read().unwrap();
            assert_eq!(content(model), content(SmallHand::new().read().unwrap()));
        }
    }
}

#[test]
fn names_of_buffers_may_be_percent_encoded_and_in_folders_below() {
    for (uri, name) in [("my%20hand.bin", "my hand.bin"), ("h%C3%A4nd.bin", "h\u{e4}nd.bin"), ("./a/b.bin", "a/b.bin")]
    {
        let hand = LooseHand::new(uri);
        hand.put(name);
        assert_eq!(content(hand.read().unwrap()), content(SmallHand::new().read().unwrap()), "{uri}");
    }
}

#[test]
fn only_the_declared_part_of_a_huge_buffer_is_read() {
    let hand = LooseHand::new("huge.bin");
    // Takes no disk space: the file is sparse except for its beginning.
    hand.put("huge.bin").set_len(10 << 30).unwrap();
    let start = std::time::Instant::now();
    hand.read().unwrap();
    // Reading ten gigabytes would take longer.
    assert!(start.elapsed().as_secs_f64() < 1.0);
}

#[test]
fn buffers_that_no_accessor_needs_may_be_missing() {
    let hand = SmallHand::new().replace(r#""byteLength":432}"#, r#""byteLength":432},{"byteLength":9,"uri":"no.bin"}"#);
    hand.read().unwrap();
    // A second buffer cannot be the GLB's either.
    let message = SmallHand::new()
        .replace(r#""byteLength":432}"#, r#""byteLength":432},{"byteLength":432}"#)
        .replace(r#"{"buffer":0,"byteOffset":240"#, r#"{"buffer":1,"byteOffset":240"#)
        .read()
        .unwrap_err()
        .to_string();
    assert!(message.contains("buffer 1: has no data"), "{message}");
}

/// The small hand with its UVs stored sparsely: entries 1 and 4 replaced, in the base accessor or among zeros.
fn sparse(base: &str, index_type: u32) -> SmallHand {
    let mut hand = SmallHand::new();
    let size = match index_type {
        5121 => 1,
        5123 => 2,
        _ => 4,
    };
    for index in [1u32, 4] {
        hand.bytes.extend(&index.to_le_bytes()[..size]);
    }
    hand.bytes.resize(440, 0);
    for value in [0.125f32, 0.25, 0.375, 0.5] {
        hand.bytes.extend(value.to_le_bytes());
    }
    let accessor = format!(
        r#"{{{base}"componentType":5126,"count":6,"type":"VEC2","sparse":{{"count":2,
            "indices":{{"bufferView":5,"componentType":{index_type}}},"values":{{"bufferView":6}}}}}}"#
    );
    hand.replace(r#""byteLength":432}"#, r#""byteLength":456}"#)
        .replace(
            r#""byteOffset":240,"byteLength":192}"#,
            r#""byteOffset":240,"byteLength":192},
                {"buffer":0,"byteOffset":432,"byteLength":8},{"buffer":0,"byteOffset":440,"byteLength":16}"#,
        )
        .replace(r#"{"bufferView":1,"componentType":5126,"count":6,"type":"VEC2"}"#, &accessor)
}

#[test]
fn sparse_accessors_replace_entries_of_others_or_of_zeros() {
    for index_type in [5121, 5123, 5125] {
        let mut expected = SmallHand::new().read().unwrap().uvs;
        (expected[1], expected[4]) = (DVec2::new(0.125, 0.25), DVec2::new(0.375, 0.5));
        assert_eq!(sparse(r#""bufferView":1,"#, index_type).read().unwrap().uvs, expected);
        for k in [0, 2, 3, 5] {
            expected[k] = DVec2::ZERO;
        }
        assert_eq!(sparse("", index_type).read().unwrap().uvs, expected);
    }
}

#[test]
fn damaged_and_endless_storage_is_rejected() {
    let zeros = || sparse("", 5121);
    let mut beyond = zeros();
    beyond.bytes[433] = 6;
    let many_sets: String = (1..70).map(|k| format!(r#""JOINTS_{k}":2,"WEIGHTS_{k}":3,"#)).collect();
    let small = SmallHand::new;
    let cases = [
        (beyond, "TEXCOORD_0: replaces entry 6 of 6"),
        (zeros().replace(r#""count":6,"type":"VEC2""#, r#""count":99999999999,"type":"VEC2""#), "more than any hand"),
        (zeros().replace(r#""sparse":{"count":2"#, r#""sparse":{"count":99999999999"#), "beyond its buffer"),
        (zeros().replace(r#""sparse":{"count":2"#, r#""sparse":{"count":18446744073709551615"#), "beyond its buffer"),
        (zeros().replace(r#""componentType":5121}"#, r#""componentType":5126}"#), "componentType"),
        (zeros().replace(r#""bufferView":6"#, r#""bufferView":7"#), "bufferView"),
        (small().replace(r#""JOINTS_0":2,"#, &format!(r#"{many_sets}"JOINTS_0":2,"#)), "more than 64 sets"),
    ];
    for (hand, expected) in cases {
        let message = hand.read().map(|_| ()).unwrap_err().to_string();
        assert!(message.contains(expected) && message.contains("small.glb"), "wanted '{expected}', got '{message}'");
    }
    // A declared length below that of the header itself.
    let mut glb = small().glb();
    glb[8..12].copy_from_slice(&11u32.to_le_bytes());
    assert!(read_bytes(&glb).unwrap_err().to_string().contains("header is damaged"));
}

#[test]
fn joints_in_a_cycle_are_rejected() {
    let circle = SmallHand::new().replace(r#"{"name":"tip","#, r#"{"name":"tip","children":[4],"#);
    let message = circle.read().unwrap_err().to_string();
    assert!(message.contains("small.glb: "), "{message}");
    // Above the root, among nodes that are not joints.
    let above = SmallHand::new().replace(
        r#"{"name":"root","children":[3],"translation":[1,0,0]}"#,
        r#"{"name":"root","children":[3],"translation":[1,0,0]},
        {"children":[6]},{"children":[5,4]}"#,
    );
    assert_eq!(above.read().unwrap().parents, [None, Some(0), Some(1)]);
}

#[test]
fn a_file_with_any_number_or_name_changed_never_panics() {
    let numbers = ["0", "7", "5121", "65535", "4294967295", "18446744073709551615", "-1", "0.5", "1e999", "null"];
    for hand in [sparse(r#""bufferView":1,"#, 5123), sparse("", 5121)] {
        let json = hand.json.clone();
        let is_digit = |at: usize| json.as_bytes().get(at).is_some_and(u8::is_ascii_digit);
        for start in (1..json.len()).filter(|&at| is_digit(at) && !is_digit(at - 1)) {
            let end = (start..).find(|&at| !is_digit(at)).unwrap();
            for number in numbers {
                let json = format!("{}{number}{}", &json[..start], &json[end..]);
                let _ = SmallHand { json, bytes: hand.bytes.clone() }.read();
            }
        }
        let quotes: Vec<usize> = json.match_indices('"').map(|(at, _)| at).collect();
        for pair in quotes.chunks_exact(2) {
            for name in ["x", "POSITION", "extensions"] {
                let json = format!("{}{name}{}", &json[..pair[0] + 1], &json[pair[1]..]);
                let _ = SmallHand { json, bytes: hand.bytes.clone() }.read();
            }
        }
    }
}

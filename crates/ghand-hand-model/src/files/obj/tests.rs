use std::path::Path;

use ghand_core::HandModel;
use ghand_test_support::shared;
use glam::{DVec2, DVec3};

use super::*;
use crate::HandModelError;
use crate::files::gltf::read_gltf;
use ghand_test_support::procedural_hand::ProceduralHand;

const MODEL: [[u32; 3]; 2] = [[0, 1, 2], [0, 2, 3]];

fn read_text(text: impl AsRef<[u8]>) -> Result<UvLayout, HandModelError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("uv.obj");
    std::fs::write(&path, text).unwrap();
    read_obj_uvs(&path, 4, &MODEL)
}

const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0.25 0\nvt 1 0\nvt 1 1\nvt 0.25 0.75\n";

fn square() -> UvLayout {
    let uvs = [(0.25, 1.0), (1.0, 1.0), (1.0, 0.0), (0.25, 0.25)].map(|(u, v)| DVec2::new(u, v)).to_vec();
    UvLayout { uvs, faces: MODEL.to_vec(), face_uvs: MODEL.to_vec() }
}

#[test]
fn all_notations_of_faces_are_read_alike_with_v_from_the_top() {
    let faces = [
        "f 1/1 2/2 3/3\nf 1/1 3/3 4/4\n",
        "f 1/1/1 2/2/1 3/3/1 4/4/1\n",
        "f -4/-4 -3/-3 -2/-2 -1/-1 # a comment\n",
        "g a\nusemtl b\nf 1/1 2/2\\\n 3/3 \\\n4/4\n",
        "f 1/1// 2/2 3/3 4/4",
    ];
    for text in faces.map(|f| format!("{SQUARE}{f}")) {
        assert_eq!(read_text(&text).unwrap(), square(), "{text}");
        assert_eq!(read_text(text.replace('\n', "\r\n").replace("\\\r\n", "\\\n")).unwrap(), square());
        assert_eq!(read_text(text.replace("\\\n", "\\\r\n")).unwrap(), square());
    }
    // A name in an encoding other than UTF-8.
    let mut latin = b"o H\xe4nd\n".to_vec();
    latin.extend(format!("{SQUARE}f 1/1 2/2 3/3 4/4\n").bytes());
    assert_eq!(read_text(latin).unwrap(), square());
}

#[test]
fn unusable_files_are_rejected_with_line_and_remedy() {
    let quad = "f 1/1 2/2 3/3 4/4\n";
    let cases = [
        (String::new(), "vertices: 0, the hand model has 4"),
        (format!("v 0 0 0\n{SQUARE}{quad}"), "vertices: 5, the hand model has 4; export the UVs of this model's"),
        (SQUARE.into(), "faces: there are none"),
        (format!("{SQUARE}f 1 2 3\n"), "line 9: corner '1' has no UV point; export the mesh with UVs"),
        (format!("{SQUARE}f 1//1 2//1 3//1\n"), "line 9: corner '1//1' has no UV point"),
        (format!("{SQUARE}{quad}f 1/1 2/2\n"), "line 10: a face needs three corners"),
        (format!("{SQUARE}f\n"), "line 9: a face without corners"),
        (format!("{SQUARE}f 0/1 2/2 3/3\n"), "line 9: '0' does not refer to a point"),
        (format!("{SQUARE}f 1/-5 2/2 3/3\n"), "line 9: '-5' does not refer to a point"),
        (
            format!("{SQUARE}f 1/1 2/2 9223372036854775807/3\n"),
            "line 9: '9223372036854775807' does not refer to a point",
        ),
        (format!("{SQUARE}f -9223372036854775808/1 2/2 3/3\n"), "does not refer to a point"),
        (format!("{SQUARE}f 1/1 2/2 5/3\n"), "line 9: refers to vertex 5 of 4"),
        (format!("{SQUARE}f 1/1 2/2 3/4294967296\n"), "line 9: refers to UV point 4294967296 of 4"),
        (format!("{SQUARE}f 1/1 x/2 3/3\n"), "line 9: 'x' is not an index"),
        (format!("{SQUARE}vt 0.5\n{quad}"), "line 9: a UV point needs two numbers"),
        (format!("{SQUARE}vt 0.5 up\n{quad}"), "line 9: 'up' is not a number"),
        (format!("{SQUARE}vt 0.5 NaN\n{quad}"), "line 9: UV NaN is not in 0 to 1; unwrap"),
        (format!("{SQUARE}vt 1.5 0\n{quad}"), "line 9: UV 1.5 is not in 0 to 1"),
        (format!("{SQUARE}f 2/2 4/4 3/3\nf 2/2 4/4 1/1\nf 2/2 4/4 2/2\n"), "faces: only 4 of 9 edges are the hand"),
        (format!("{SQUARE}f 4/4 3/3 2/2 1/1\nf 1/1 4/4 3/3\n"), "have the opposite winding"),
        (format!("{SQUARE}f {}\n", "z".repeat(5000)), "line 9: 'zzzz"),
    ];
    for (text, expected) in cases {
        let message = read_text(&text).unwrap_err().to_string();
        assert!(message.contains(expected) && message.contains("uv.obj"), "wanted '{expected}', got '{message}'");
        assert!(message.len() < 300, "{message}");
    }
    let message = read_obj_uvs(Path::new("no/such.obj"), 4, &MODEL).unwrap_err().to_string();
    assert!(message.contains("no/such.obj"), "{message}");
}

#[test]
fn a_file_of_many_gigabytes_is_rejected_before_it_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("huge.obj");
    // Takes no disk space: the file is sparse.
    std::fs::File::create(&path).unwrap().set_len(10 << 30).unwrap();
    let message = read_obj_uvs(&path, 4, &MODEL).unwrap_err().to_string();
    assert!(message.contains("huge.obj: size: is larger than 64 MiB"), "{message}");
}

#[test]
fn a_file_with_any_byte_changed_never_panics() {
    let text = format!("{SQUARE}f -4/-4/1 2/2 3/3\\\n 4/4\n").into_bytes();
    for at in 0..text.len() {
        for value in [0, b'-', b'/', b'9', b'\\', b'\n', 255] {
            let mut damaged = text.clone();
            damaged[at] = value;
            let _ = read_text(&damaged);
        }
    }
}

/// The nearest number with nine digits.
fn close(a: f64, b: f64) -> bool {
    (a - b).abs() <= 5e-9 * a.abs().max(1e-12) * 1.000_001
}

/// Numbers of the lines that begin with `key`.
fn numbers(text: &str, key: &str) -> Vec<Vec<f64>> {
    let values = |line: &str| line.split_whitespace().skip(1).map(|w| w.parse().unwrap()).collect();
    text.lines().filter(|line| line.split_whitespace().next() == Some(key)).map(values).collect()
}

#[test]
fn a_written_file_is_read_back_with_the_same_seams() {
    let model = ProceduralHand { detail: 1, ..Default::default() }.build().unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hand.obj");
    let positions: Vec<DVec3> = model.vertices.iter().map(|p| *p * 3.0 + DVec3::new(1e-7, -250.0, 0.0)).collect();
    write_obj(&path, &model, &positions).unwrap();
    let back = read_obj_uvs(&path, model.vertices.len(), &model.faces).unwrap();
    assert_eq!((&back.faces, &back.face_uvs), (&model.faces, &model.face_uvs));
    // Nine digits of 1 - v.
    assert!(back.uvs.iter().zip(&model.uvs).all(|(a, b)| a.distance(*b) < 1e-9));
    let text = std::fs::read_to_string(&path).unwrap();
    let vertices = numbers(&text, "v");
    assert_eq!(vertices.len(), positions.len());
    for (found, p) in vertices.iter().zip(&positions) {
        assert!(close(p.x, found[0]) && close(p.y, found[1]) && close(p.z, found[2]), "{p} became {found:?}");
    }
    assert!(!text.contains("e-"), "an exponent, which not all readers know");
}

/// The generic hand, if it is beside the checkout.
fn generic_hand() -> Option<HandModel> {
    shared("assets/generic-hand/right.glb").map(|path| read_gltf(&path).unwrap())
}

/// Vertex, UV point of each corner of the faces, counted from 0.
fn corners(text: &str) -> Vec<(usize, usize)> {
    let words = text.lines().filter_map(|line| line.strip_prefix("f ")).flat_map(|line| line.split_whitespace());
    let index = |word: &str| word.parse::<usize>().unwrap() - 1;
    words.map(|word| word.split_once('/').unwrap()).map(|(v, vt)| (index(v), index(vt))).collect()
}

#[test]
fn a_welded_rig_is_written_in_the_order_of_its_file() {
    let Some(model) = generic_hand() else { return };
    let text = obj_text(&model, &model.vertices).unwrap();
    let vertices = numbers(&text, "v");
    assert!(vertices.len() > model.vertices.len() && vertices.len() == model.source_vertices.len());
    for (found, &source) in vertices.iter().zip(&model.source_vertices) {
        let p = model.vertices[source as usize];
        assert!(close(p.x, found[0]) && close(p.y, found[1]) && close(p.z, found[2]));
    }
    // Each corner has the vertex of the file that has its UV, too.
    let expected: Vec<(usize, usize)> = model.face_uvs.iter().flatten().map(|&i| (i as usize, i as usize)).collect();
    assert_eq!(corners(&text), expected);
}

#[test]
fn a_rig_with_another_atlas_still_joins_the_right_points() {
    let Some(mut model) = generic_hand() else { return };
    model.uvs.reverse();
    let last = model.uvs.len() as u32 - 1;
    model.face_uvs.iter_mut().flatten().for_each(|i| *i = last - *i);
    let text = obj_text(&model, &model.vertices).unwrap();
    for ((vertex, uv), (&expected, &expected_uv)) in
        corners(&text).into_iter().zip(model.faces.iter().flatten().zip(model.face_uvs.iter().flatten()))
    {
        assert_eq!((model.source_vertices[vertex], uv), (expected, expected_uv as usize));
    }
}

#[test]
fn names_cannot_break_out_of_the_comment() {
    let mut model = ProceduralHand { detail: 1, ..Default::default() }.build().unwrap();
    model.name = "hand\nv 9 9 9\r\\".into();
    let text = obj_text(&model, &model.vertices).unwrap();
    assert_eq!(numbers(&text, "v").len(), model.vertices.len());
    let message = obj_text(&model, &model.vertices[1..]).unwrap_err().to_string();
    assert!(message.contains("positions"), "{message}");
}

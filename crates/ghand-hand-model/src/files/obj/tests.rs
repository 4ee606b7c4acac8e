use ghand_core::HandModel;
use ghand_test_support::shared;
use glam::{DVec2, DVec3};

use super::*;
use crate::files::gltf::read_gltf;
use ghand_test_support::procedural_hand::ProceduralHand;

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
fn a_written_file_has_the_models_points_and_seams() {
    let model = ProceduralHand { detail: 1, ..Default::default() }.build().unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hand.obj");
    let positions: Vec<DVec3> = model.vertices.iter().map(|p| *p * 3.0 + DVec3::new(1e-7, -250.0, 0.0)).collect();
    write_obj(&path, &model, &positions).unwrap();
    let text = std::fs::read_to_string(&path).unwrap();
    let index = |i: &u32| *i as usize;
    let vertices = model.faces.iter().flatten().map(index);
    assert_eq!(corners(&text), vertices.zip(model.face_uvs.iter().flatten().map(index)).collect::<Vec<_>>());
    let uvs = numbers(&text, "vt");
    assert_eq!(uvs.len(), model.uvs.len());
    // Nine digits of 1 - v.
    assert!(uvs.iter().zip(&model.uvs).all(|(a, b)| DVec2::new(a[0], 1.0 - a[1]).distance(*b) < 1e-9));
    let vertices = numbers(&text, "v");
    assert_eq!(vertices.len(), positions.len());
    for (found, p) in vertices.iter().zip(&positions) {
        assert!(close(p.x, found[0]) && close(p.y, found[1]) && close(p.z, found[2]), "{p} became {found:?}");
    }
    assert!(!text.contains("e-"), "an exponent, which not all readers know");
}

/// The generic hand, if it is beside the checkout.
fn generic_hand() -> Option<HandModel> {
    shared("assets/generic-hand/right.glb").map(|path| read_gltf(&path, None).unwrap().model)
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

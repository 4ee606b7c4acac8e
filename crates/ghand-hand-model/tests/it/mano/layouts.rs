//! Files of every layout are read back to the last bit.

use ghand_core::posing::shape_hand;
use ghand_core::{HandModel, PoseSpace, Side};
use ghand_hand_model::files::mano::{JOINT_NAMES, ManoFile, ManoOptions, PARENTS, read_mano, read_mano_bytes};
use glam::DVec3;

use ghand_test_support::mano_files::hands::{Entries, Hand, as_npz, as_pickle, set};
use ghand_test_support::mano_files::model::write_mano;
use ghand_test_support::mano_files::python::{Py, array, dictionary, pickle, string};
use ghand_test_support::procedural_hand::ProceduralHand;

fn read(bytes: &[u8]) -> ManoFile {
    read_mano_bytes("right.pkl", bytes, None, &ManoOptions::default()).unwrap()
}

fn vectors(values: &[f64]) -> Vec<DVec3> {
    values.as_chunks().0.iter().map(|v| DVec3::from_array(*v)).collect()
}

/// `(V, 3, count)` to `[count][V]`.
fn transposed(values: &[f64], count: usize) -> Vec<DVec3> {
    let part = |vertex: usize, axis: usize, k: usize| values[(3 * vertex + axis) * count + k];
    let vertices = values.len() / (3 * count).max(1);
    (0..count).flat_map(|k| (0..vertices).map(move |i| DVec3::from_array([0, 1, 2].map(|a| part(i, a, k))))).collect()
}

/// `assert_eq` on f64 does not distinguish 0 and -0; bits do.
fn bits(values: &[DVec3]) -> Vec<[u64; 3]> {
    values.iter().map(|v| v.to_array().map(f64::to_bits)).collect()
}

fn assert_is(model: &HandModel, hand: &Hand) {
    assert_eq!(bits(&model.vertices), bits(&vectors(&hand.vertices)));
    let faces: Vec<u32> = hand.faces.iter().map(|i| *i as u32).collect();
    assert_eq!(model.faces.as_flattened(), faces);
    assert_eq!(model.parents, hand.parents);
    assert_eq!(model.weights, hand.weights);
    assert_eq!(model.joint_regressor, hand.regressor);
    assert_eq!(bits(&model.shape_directions), bits(&transposed(&hand.selected_shapes(), hand.shapes.1)));
    let pose_count = 9 * (hand.parents.len() - 1);
    assert_eq!(bits(&model.pose_directions), bits(&transposed(&hand.pose_directions, pose_count)));
    let space = model.pose_space.as_ref().unwrap();
    assert_eq!(bits(&space.mean), bits(&vectors(&hand.mean)));
    assert_eq!(bits(&space.components), bits(&vectors(&hand.components)));
    let shaped = shape_hand(model, &vec![0.0; hand.shapes.1]).unwrap();
    assert_eq!(bits(&model.joints), bits(&shaped.joints));
}

#[test]
fn the_published_layout_is_read_to_the_last_bit() {
    let hand = Hand::procedural(200, (20, 10));
    let file = read(&as_pickle(&hand.published()));
    assert_is(&file.model, &hand);
    assert_eq!(file.model.joint_names, JOINT_NAMES);
    assert_eq!(file.model.parents, PARENTS);
    assert_eq!((file.model.shape_count(), file.model.side), (10, Side::Right));
    assert_eq!((file.has_left_shape_bug, file.warnings), (false, vec![]));
}

#[test]
fn a_pickle_without_chumpy_is_read_to_the_last_bit() {
    for used in [0, 1, 20] {
        let hand = Hand::procedural(200, (20, used));
        let file = read(&as_pickle(&hand.plain()));
        assert_is(&file.model, &hand);
        assert_eq!(file.warnings, Vec::<String>::new());
    }
}

#[test]
fn archives_are_read_to_the_last_bit_stored_or_deflated() {
    let hand = Hand::procedural(200, (20, 10));
    // The regressor and the shape directions of the published layout are objects, stored in the archive as pickles.
    for entries in [hand.published(), hand.plain()] {
        for deflate in [false, true] {
            assert_is(&read(&as_npz(&entries, deflate)).model, &hand);
        }
    }
}

#[test]
fn every_part_of_a_model_is_read_to_the_last_bit() {
    let folder = tempfile::tempdir().unwrap();
    for (left, name) in [(false, "right.npz"), (true, "left.npz")] {
        let mut model = ProceduralHand { detail: 1, left, ..Default::default() }.build().unwrap();
        if left {
            let mean = (0..15).map(|k| DVec3::new(0.01 * f64::from(k), -0.02, 0.3)).collect();
            let components = (0..30).map(|k| DVec3::new(0.1, 0.2, f64::from(k))).collect();
            model.pose_space = Some(PoseSpace { mean, components });
        }
        let path = folder.path().join(name);
        write_mano(&path, &model);
        let found = read_mano(&path, &ManoOptions::default()).unwrap();
        assert_eq!(found.warnings, Vec::<String>::new());
        let space = PoseSpace { mean: vec![DVec3::ZERO; 15], components: vec![] };
        let expected = HandModel {
            name: found.model.name.clone(),
            uvs: found.model.uvs.clone(),
            face_uvs: found.model.face_uvs.clone(),
            // MANO's directions have no names.
            shape_names: vec![],
            pose_space: model.pose_space.clone().or(Some(space)),
            ..model
        };
        assert!(found.model == expected, "{name}");
        assert_eq!(found.model.side == Side::Left, left);
    }
}

#[test]
fn the_format_follows_from_the_content_not_the_extension() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hand.npz");
    let hand = Hand::procedural(200, (20, 10));
    std::fs::write(&path, as_pickle(&hand.published())).unwrap();
    assert_is(&read_mano(&path, &ManoOptions::default()).unwrap().model, &hand);
}

#[test]
fn all_number_types_orders_and_byte_orders_are_read() {
    let hand = Hand::small();
    let (v, n) = (hand.vertex_count(), hand.parents.len());
    let mut entries = hand.published();
    set(&mut entries, "v_template", Py::Array(array(">f8", &[v, 3], false, &hand.vertices)));
    set(&mut entries, "weights", Py::Array(array("<f4", &[v, n], false, &hand.weights)));
    set(&mut entries, "f", Py::Array(array("<i8", &[3, 3], true, &hand.faces)));
    set(&mut entries, "kintree_table", Py::Array(array("<i4", &[2, 3], true, &[-1., 0., 1., 0., 1., 2.])));
    for bytes in [as_pickle(&entries), as_npz(&entries, true)] {
        assert_is(&read(&bytes).model, &hand);
    }
}

#[test]
fn rigs_with_other_joints_get_numbered_names() {
    let hand = Hand::small();
    let model = read(&as_pickle(&hand.published())).model;
    assert_is(&model, &hand);
    assert_eq!(model.joint_names, ["joint0", "joint1", "joint2"]);
}

#[test]
fn a_regressor_stored_by_rows_and_out_of_order_is_the_same() {
    let hand = Hand::small();
    let flat = |code, values: &[f64]| Py::Array(array(code, &[values.len()], false, values));
    // By rows, with the entries of the second row in descending order, and the shape under its older name.
    let state = dictionary(vec![
        ("shape", Py::Tuple(vec![Py::Int(3), Py::Int(5)])),
        ("indptr", flat("<i8", &[0., 2., 4., 5.])),
        ("indices", flat("<i4", &[0., 3., 4., 1., 2.])),
        ("data", flat("<f8", &[0.5, 0.5, 0.75, 0.25, 1.0])),
    ]);
    let mut entries = hand.published();
    set(&mut entries, "J_regressor", Py::Instance("scipy.sparse._csr", "csr_matrix", Box::new(state)));
    assert_is(&read(&as_pickle(&entries)).model, &hand);
}

#[test]
fn weights_that_sum_to_one_are_kept_exactly_and_others_normalised() {
    let hand = Hand::small();
    let mut weights = hand.weights.clone();
    weights[3..6].copy_from_slice(&[0.2502, 0.75, -1e-10]);
    let mut entries = hand.published();
    set(&mut entries, "weights", Py::Array(array("<f8", &[5, 3], true, &weights)));
    let model = read(&as_pickle(&entries)).model;
    let sum = 0.2502 + 0.75;
    assert_eq!(model.vertex_weights(1), [0.2502 / sum, 0.75 / sum, 0.0]);
    weights[3..6].copy_from_slice(model.vertex_weights(1));
    assert_eq!(model.weights, weights);
}

type Change<'a> = &'a dyn Fn(&mut Entries);

#[test]
fn unusual_files_are_read_with_a_warning() {
    let hand = Hand::procedural(200, (20, 10));
    let warnings_of = |change: Change| {
        let mut entries = hand.published();
        change(&mut entries);
        read(&as_pickle(&entries)).warnings
    };
    let cases: [(Change, &str); 5] = [
        (&|e| set(e, "bs_type", string("euler")), "bs_type is \"euler\""),
        (&|e| set(e, "bs_style", string("dqs")), "bs_style is \"dqs\""),
        (&|e| set(e, "J", Py::Array(array("<f8", &[16, 3], false, &[0.5; 48]))), "J is up to"),
        (&|e| set(e, "J", Py::Array(array("<f8", &[3], false, &[0.0; 3]))), "J has the shape [3]"),
        (&|e| set(e, "J", string("none")), "J cannot be read"),
    ];
    for (change, wanted) in cases {
        let warnings = warnings_of(change);
        assert!(warnings.len() == 1 && warnings[0].contains(wanted), "wanted {wanted}, got {warnings:?}");
    }
}

#[test]
fn unused_keys_may_have_any_readable_value() {
    let mut entries = Hand::small().published();
    entries.push(("hands_coeffs", Py::List(vec![string("any"), Py::Int(-7)])));
    entries.push(("note", Py::Call("__builtin__", "set", vec![Py::List(vec![])])));
    assert_is(&read(&pickle(&dictionary(entries))).model, &Hand::small());
}

//! Files written by Python itself, in every protocol; see `tests/data/mano/make.py`.

use std::path::Path;

use ghand_core::{HandModel, Side};
use ghand_files::npz::Npz;
use ghand_hand_model::files::mano::{ManoOptions, read_mano};
use glam::DVec3;

fn folder() -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/mano")
}

/// Number `k` of the arrays with consecutive numbers.
fn third(k: usize) -> f64 {
    (k + 1) as f64 / 3.0
}

fn assert_is_the_hand(model: &HandModel) {
    let thirds = |i: usize| DVec3::new(third(3 * i), third(3 * i + 1), third(3 * i + 2));
    let vertices: Vec<DVec3> = (0..4).map(|i| thirds(i) * thirds(i)).collect();
    assert_eq!(model.vertices, vertices);
    assert_eq!(model.faces, [[0, 1, 2], [0, 2, 3]]);
    assert_eq!(model.weights, [1., 0., 0.5, 0.5, 0.25, 0.75, 0., 1.]);
    assert_eq!(model.parents, [None, Some(0)]);
    assert_eq!(model.joint_regressor, [vec![(0, 0.25), (1, 0.75)], vec![(2, 0.5), (3, 0.5)]]);
    let direction =
        |k: usize, count: usize, i: usize| DVec3::from_array([0, 1, 2].map(|axis| third((3 * i + axis) * count + k)));
    // The first two of three directions.
    let shapes: Vec<DVec3> = (0..2).flat_map(|k| (0..4).map(move |i| direction(k, 3, i))).collect();
    assert_eq!(model.shape_directions, shapes);
    let poses: Vec<DVec3> = (0..9).flat_map(|k| (0..4).map(move |i| direction(k, 9, i))).collect();
    assert_eq!(model.pose_directions, poses);
    let space = model.pose_space.as_ref().unwrap();
    assert_eq!(space.mean, [thirds(0)]);
    assert_eq!(space.components, [0, 1, 2].map(thirds));
}

#[test]
fn pickles_of_all_protocols_and_archives_are_read_to_the_last_bit() {
    let pickles = (0..=5).map(|protocol| format!("protocol{protocol}.pkl"));
    for name in pickles.chain(["stored.npz".into(), "deflated.npz".into()]) {
        let options = ManoOptions { side: Some(Side::Right), ..Default::default() };
        let file = read_mano(&folder().join(&name), &options).unwrap();
        assert_is_the_hand(&file.model);
        assert_eq!(file.warnings, Vec::<String>::new(), "{name}");
    }
}

#[test]
fn arrays_of_an_archive_are_listed_and_read_by_name() {
    let bytes = std::fs::read(folder().join("deflated.npz")).unwrap();
    let mut npz = Npz::open(&bytes).unwrap();
    let names = npz.names();
    assert!(names.len() == 11 && npz.contains("weights") && !npz.contains("other"), "{names:?}");
    let array = npz.numbers("v_template").unwrap();
    assert_eq!(array.shape, [4, 3]);
    assert_eq!(array.values, (0..12).map(|k| third(k) * third(k)).collect::<Vec<f64>>());
    assert!(npz.numbers("other").unwrap_err().to_string().contains("not in the archive"));
    assert!(npz.numbers("bs_type").unwrap_err().to_string().contains("text"));
}

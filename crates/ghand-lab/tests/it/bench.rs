//! `ghand-lab bench` and the options of the laboratory.

use ghand_render::{AdapterChoice, Gpu};

use crate::common::failing_driver::FailingDriver;
use crate::common::{assert_one_sentence, run, save_avatar};

const LAB: &str = env!("CARGO_BIN_EXE_ghand-lab");

#[test]
fn avatars_are_posed_in_turns() {
    let folder = tempfile::tempdir().unwrap();
    save_avatar(folder.path());
    let output = run(LAB, folder.path(), &["bench", "pose", "hand.ghand", "hand.ghand", "--frames", "2", "--json"]);
    let times: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(times.as_array().unwrap().len(), 2);
    assert!(times[1]["pose_ms"]["median"].as_f64().unwrap() > 0.0);
}

#[test]
fn training_steps_are_timed_without_a_number_of_gaussians() {
    let folder = tempfile::tempdir().unwrap();
    let output = run(LAB, folder.path(), &["bench", "train", "--iterations", "1", "--size", "96x128", "--json"]);
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(report["gaussians"], 10_815);
}

#[test]
fn too_little_device_memory_is_one_sentence_that_names_the_request() {
    let gpu = Gpu::new(&AdapterChoice::from_env()).unwrap();
    let Some(driver) = FailingDriver::new(&gpu) else { return };
    let folder = tempfile::tempdir().unwrap();
    // Larger than the blocks that allocators request; with gradients, which are not computed in bands.
    let arguments = ["bench", "splat", "--scene", "hand", "--n", "1000", "--size", "8000x4000"];
    let output = driver.run(LAB, folder.path(), &arguments, ("REFUSE_FROM", "300000000"));
    assert_one_sentence(&output, &["too little memory", "8000 x 4000 pixels", "smaller images"]);
}

#[test]
fn options_that_do_not_apply_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    for (line, option) in [
        ("ablate --capture none --out a --seed 4", "--seed"),
        ("ablate --capture none --out a --equal iterations --max-time 3m", "--max-time"),
        ("bench splat --scene none.ply --n 30", "--n"),
    ] {
        let output = run(LAB, folder.path(), &line.split(' ').collect::<Vec<_>>());
        assert_one_sentence(&output, &[option]);
    }
}

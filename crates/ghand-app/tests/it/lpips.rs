//! LPIPS in `train` and `ghand evaluate`, as a user runs them: with the built-in weights, and with a file's.

use std::path::Path;
use std::process::Output;

use crate::common::{UNALIGNED, assert_one_sentence, assert_trained, run, small_capture};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::{Value, json};

const TRAIN: &str = env!("CARGO_BIN_EXE_train");
const GHAND: &str = env!("CARGO_BIN_EXE_ghand");

/// A file of AlexNet with random weights, written without the library that reads it.
fn save_weights(path: &Path) {
    let convolutions =
        [(0, [64, 3, 11]), (3, [192, 64, 5]), (6, [384, 192, 3]), (8, [256, 384, 3]), (10, [256, 256, 3])];
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut header = json!({"__metadata__": {"lpips_backbone": "alex"}});
    let mut data = Vec::<u8>::new();
    let mut add = |name: String, shape: &[usize], least: f32, most: f32| {
        let start = data.len();
        (0..shape.iter().product()).for_each(|_| data.extend(rng.random_range(least..most).to_le_bytes()));
        header[name] = json!({"dtype": "F32", "shape": shape, "data_offsets": [start, data.len()]});
    };
    for (index, [outputs, inputs, kernel]) in convolutions {
        let most = (6.0 / (inputs * kernel * kernel) as f32).sqrt();
        add(format!("features.{index}.weight"), &[outputs, inputs, kernel, kernel], -most, most);
        add(format!("features.{index}.bias"), &[outputs], -0.1, 0.1);
    }
    for (tap, channels) in [64, 192, 384, 256, 256].into_iter().enumerate() {
        add(format!("linear.{tap}"), &[channels], 0.0, 1.0);
    }
    let header = header.to_string().into_bytes();
    std::fs::write(path, [&(header.len() as u64).to_le_bytes()[..], &header, &data].concat()).unwrap();
}

fn train(folder: &Path, out: &str, more: &[&str]) -> Output {
    let options = ["--capture", "capture", "--out", out];
    run(TRAIN, folder, &[&options[..], &UNALIGNED, more].concat())
}

fn evaluate(folder: &Path, out: &str, more: &[&str]) -> Output {
    run(GHAND, folder, &[&["evaluate", "run/avatar.ghand", "--capture", "capture", "--out", out], more].concat())
}

fn metrics(folder: &Path, out: &str) -> Value {
    serde_json::from_slice(&std::fs::read(folder.join(out).join("metrics.json")).unwrap()).unwrap()
}

#[test]
fn lpips_is_a_figure_with_built_in_weights_and_with_those_of_a_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    small_capture(&path.join("capture"));
    save_weights(&path.join("alex.safetensors"));

    let [said, told] = assert_trained(&train(path, "run", &["--lpips", "alex.safetensors"]));
    assert!(said.contains("LPIPS: backbone `alex`, from alex.safetensors\n"), "{said}{told}");
    assert!(said.contains("LPIPS (alex)\n"), "{said}");
    let with = metrics(path, "run");
    assert_eq!(with["lpips_backbone"], "alex");
    for value in [&with["lpips"], &with["floor"]["lpips"]] {
        assert!(value.as_f64().is_some_and(|value| value > 0.0), "{with}");
    }

    let [said, told] = assert_trained(&train(path, "built-in", &[]));
    let lines = |text: &str| text.lines().filter(|line| line.contains("LPIPS")).count();
    assert_eq!([lines(&said), lines(&told)], [1, 0], "{said}{told}");
    let built_in = metrics(path, "built-in");
    assert!(built_in["lpips"].as_f64().is_some_and(|value| value > 0.0 && value < 1.0), "{built_in}");
    assert!(built_in["lpips"] != with["lpips"], "{built_in}");
    let avatar = |out: &str| std::fs::read(path.join(out).join("avatar.ghand")).unwrap();
    assert!(avatar("run") != avatar("built-in"), "the weights have no effect on training");
    assert_trained(&train(path, "without", &["--set", "lpips_weight=0"]));
    assert!(avatar("without") != avatar("built-in"), "LPIPS has no effect on training");

    let output = evaluate(path, "again", &["--lpips", "alex.safetensors"]);
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success() && output.stderr.is_empty() && said.contains("LPIPS (alex)\n"), "{said}");
    let again = metrics(path, "again");
    assert_eq!([&again["lpips"], &again["floor"]["lpips"]], [&with["lpips"], &with["floor"]["lpips"]]);
    let output = evaluate(path, "other", &[]);
    assert!(output.status.success() && output.stderr.is_empty());
    assert!(metrics(path, "other")["lpips"] != with["lpips"]);
}

#[test]
fn an_unusable_file_of_weights_is_one_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    small_capture(&path.join("capture"));
    assert_trained(&train(path, "run", &[]));
    save_weights(&path.join("alex.safetensors"));
    let bytes = std::fs::read(path.join("alex.safetensors")).unwrap();
    std::fs::write(path.join("short.safetensors"), &bytes[..bytes.len() / 2]).unwrap();
    for (file, problem) in [
        ("missing.safetensors", "cannot read the LPIPS weights"),
        ("short.safetensors", "truncated"),
        ("run/avatar.ghand", "features.0.weight: is missing"),
        ("capture/capture.json", "is not a safetensors file"),
        ("capture", "it is a folder"),
    ] {
        assert_one_sentence(&train(path, "out", &["--lpips", file]), &["--lpips", file, problem]);
        assert_one_sentence(&evaluate(path, "out", &["--lpips", file]), &["--lpips", file, problem]);
        assert!(!path.join("out").exists());
    }
}

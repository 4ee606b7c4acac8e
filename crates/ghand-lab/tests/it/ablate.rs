//! `ghand-lab ablate` on a small capture.

use crate::common::{assert_one_sentence, listing, run, small_capture};

const GHAND: &str = env!("CARGO_BIN_EXE_ghand-lab");

#[test]
fn arms_are_trained_once_and_compared() {
    let folder = tempfile::tempdir().unwrap();
    small_capture(&folder.path().join("capture"));
    let small = ["--capture", "capture", "--set", "uv_resolution=32", "--set", "light=off"];
    let ablate = |more: &[&str]| run(GHAND, folder.path(), &[&["ablate"][..], &small, more].concat());
    let baseline = if cfg!(feature = "networks") { "network-baseline" } else { "direct-baseline" };
    let arms = format!("direct-hgbs,direct-full-paper,{baseline}");
    let some = ["--arms", &arms, "--seeds", "2", "--equal", "iterations", "--set", "iterations=30", "--out", "out"];
    let output = ablate(&some);
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success(), "{said}{}", String::from_utf8_lossy(&output.stderr));
    assert!(said.contains(&format!("{baseline}, seed 2, equal iterations")), "{said}");
    let files = ["ablation-iterations.png", "ablation.json", "ablation.md", "runs"];
    assert_eq!(listing(&folder.path().join("out")), files);
    assert_eq!(listing(&folder.path().join("out/runs")).len(), 6);
    let text = std::fs::read_to_string(folder.path().join("out/ablation.json")).unwrap();
    let report: serde_json::Value = serde_json::from_str(&text).unwrap();
    let figures = report["equal_iterations"].as_array().unwrap();
    let names: Vec<&str> = figures.iter().map(|arm| arm["arm"].as_str().unwrap()).collect();
    assert_eq!(names, [baseline, "direct-hgbs", "direct-full-paper"]);
    assert_eq!((&figures[2]["against"], &figures[2]["seeds"]), (&"direct-hgbs".into(), &2.into()));
    assert!(figures[2]["gain"]["mean"].is_number() && report["equal_time"].is_null());
    // Nothing is trained twice.
    let again = ablate(&some);
    assert!(!String::from_utf8_lossy(&again.stdout).contains("seed 1"), "it trained again");
    assert_eq!(std::fs::read_to_string(folder.path().join("out/ablation.json")).unwrap(), text);
    let other = ["--arms", "direct-hgbs", "--seeds", "1", "--equal", "iterations", "--out", "out"];
    assert_one_sentence(&ablate(&other), &["iterations-direct-hgbs-1.json", "other settings"]);
    assert_one_sentence(&ablate(&["--arms", "hgbs", "--out", "out"]), &["--arms", "direct-hgbs"]);
}

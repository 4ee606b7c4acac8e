//! `ghand capture` makes captures.

use std::collections::BTreeMap;
use std::path::Path;

use crate::common::{assert_one_sentence, listing, run, run_in};
use ghand_test_support::long;

const GHAND: &str = env!("CARGO_BIN_EXE_ghand");
const SMALL: [&str; 10] =
    ["--views", "2", "--train-frames", "2", "--test-views", "1", "--test-frames", "1", "--size", "160x240"];

/// Makes a small capture and returns the output.
fn make(folder: &Path, name: &str, more: &[&str]) -> String {
    let output = run(GHAND, folder, &[&["capture", "--out", name], more, &SMALL[..]].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// Contents of all files below a folder.
fn contents(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut files = BTreeMap::new();
    for name in listing(folder) {
        let path = folder.join(&name);
        if path.is_dir() {
            files.extend(contents(&path).into_iter().map(|(k, v)| (format!("{name}/{k}"), v)));
        } else {
            files.insert(name, std::fs::read(path).unwrap());
        }
    }
    files
}

#[test]
fn a_capture_is_made_the_same_each_time_and_differs_by_identity() {
    let folder = tempfile::tempdir().unwrap();
    let said = make(folder.path(), "a", &["--pose-noise", "0"]);
    assert!(said.contains("5 images of 160 x 240") && said.contains("train --capture a"), "{said}");
    make(folder.path(), "b", &["--pose-noise", "0"]);
    make(folder.path(), "c", &["--pose-noise", "0", "--identity", "3"]);
    let [a, b, c] = ["a", "b", "c"].map(|name| contents(&folder.path().join(name)));
    assert_eq!(a.keys().collect::<Vec<_>>(), c.keys().collect::<Vec<_>>());
    assert!(a == b && a != c);
    assert!(a["truth.json"] == c["truth.json"], "the same motion");
    assert_eq!(listing(folder.path()), ["a", "b", "c"], "no other files remain");
    // The image shows skin over black.
    let image = image::load_from_memory(&a["images/cam00/0000.png"]).unwrap().into_rgb8();
    let skin = image.pixels().filter(|p| p.0[0] > p.0[2] && p.0[0] > 60).count();
    assert!((2000..20000).contains(&skin), "{skin} pixels of skin");
}

#[test]
fn harder_captures_differ_by_what_their_options_say() {
    if !long() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    make(folder.path(), "plain", &[]);
    make(folder.path(), "masks", &["--mask-noise", "1.5"]);
    make(folder.path(), "bias", &["--pose-bias", "3"]);
    make(folder.path(), "light", &["--light", "side"]);
    make(folder.path(), "hand", &["--side", "left", "--twist", "4", "--abduction", "3"]);
    let [plain, masks, bias, light, hand] =
        ["plain", "masks", "bias", "light", "hand"].map(|name| contents(&folder.path().join(name)));
    let differing = |other: &BTreeMap<String, Vec<u8>>| -> Vec<String> {
        plain.iter().filter(|(name, bytes)| other[*name] != **bytes).map(|(name, _)| name.clone()).collect()
    };
    let of_kind =
        |names: &[String], kind: &str| names.iter().filter(|name| name.starts_with(kind)).count() == names.len();
    let masks = differing(&masks);
    let light = differing(&light);
    assert!(masks.len() == 4 && of_kind(&masks, "masks/"), "{masks:?}");
    assert!(light.len() == 5 && of_kind(&light, "images/"), "{light:?}");
    assert_eq!(differing(&bias), ["capture.json"]);
    assert!(String::from_utf8_lossy(&hand["capture.json"]).replace(' ', "").contains("\"side\":\"left\""));
    assert!(hand["truth.json"] != plain["truth.json"]);
}

#[test]
fn a_capture_that_cannot_be_made_is_one_sentence_and_leaves_no_files() {
    let folder = tempfile::tempdir().unwrap();
    let fails = |arguments: &[&str], parts: &[&str]| {
        assert_one_sentence(&run(GHAND, folder.path(), &[&["capture"], arguments].concat()), parts);
    };
    fails(&["--out", "a", "--views", "0"], &["views", "0"]);
    fails(&["--out", "a", "--pose-noise", "inf"], &["pose_noise", "inf"]);
    fails(&["--out", "a", "--mask-noise", "20"], &["mask_noise", "20", "10"]);
    fails(&["--out", "a", "--size", "5000x400"], &["5000"]);
    assert_eq!(listing(folder.path()), Vec::<String>::new());
    std::fs::create_dir(folder.path().join("mine")).unwrap();
    std::fs::write(folder.path().join("mine/file"), "precious").unwrap();
    fails(&["--out", "mine"], &["mine", "not empty"]);
    fails(&["--out", "mine/file/a"], &["mine/file"]);
    assert_eq!(std::fs::read(folder.path().join("mine/file")).unwrap(), b"precious");
}

#[test]
fn footage_needs_ffmpeg_and_its_own_options() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("bin")).unwrap();
    let fails = |arguments: &[&str], parts: &[&str]| {
        let all = [&["capture", "--out", "a"], arguments].concat();
        let nowhere = folder.path().join("bin");
        assert_one_sentence(&run_in(GHAND, folder.path(), &all, &[("PATH", nowhere.to_str().unwrap())]), parts);
    };
    let missing = ["videos need ffmpeg", "not installed", "apt-get install ffmpeg"];
    fails(&["--footage", "--size", "64x64", "--seconds", "0.2"], &missing);
    fails(&["--footage", "--train-frames", "3"], &["--footage", "--train-frames"]);
    fails(&["--footage", "--moving", "--views", "2"], &["--moving", "--views"]);
    fails(&["--seconds", "3"], &["--footage"]);
    fails(&["--footage", "--size", "65x64"], &["65 x 64", "even"]);
    assert_eq!(listing(folder.path()), ["bin"]);
}

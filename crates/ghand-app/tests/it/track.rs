//! `ghand track`: landmarks of pictures as a file that poses are read from.

use std::path::Path;

use serde_json::Value;

use crate::common::{assert_one_sentence, listing, run};

const GHAND: &str = env!("CARGO_BIN_EXE_ghand");

/// A folder with that many pictures of a right hand, and one without a hand in between.
fn pictures(folder: &Path, count: usize) {
    let hand = Path::new(env!("CARGO_MANIFEST_DIR")).join("../ghand-tracker/tests/data/hand.png");
    let pictures = folder.join("pictures");
    std::fs::create_dir(&pictures).unwrap();
    for k in 0..count {
        let path = pictures.join(format!("p{k}.png"));
        if k == 1 {
            image::RgbImage::new(image::open(&hand).unwrap().width(), image::open(&hand).unwrap().height())
                .save(path)
                .unwrap();
        } else {
            std::fs::copy(&hand, path).unwrap();
        }
    }
}

fn json(path: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

#[test]
fn world_landmarks_are_poses_with_gaps() {
    let folder = tempfile::tempdir().unwrap();
    pictures(folder.path(), 3);
    let output = run(GHAND, folder.path(), &["track", "pictures", "--out", "hands.json"]);
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success() && said.contains("hand in 2 of 3 pictures"), "{said}");
    let file = json(&folder.path().join("hands.json"));
    let counts: Vec<usize> =
        file["frames"].as_array().unwrap().iter().map(|f| f["worldLandmarks"].as_array().unwrap().len()).collect();
    assert_eq!((counts, &file["frames"][2]["id"]), (vec![1, 0, 1], &Value::from("p2")));
    let output =
        run(GHAND, folder.path(), &["pose", "--pose", "hands.json", "--file-fps", "10", "--out", "poses.json"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(json(&folder.path().join("poses.json"))["frames"].as_array().unwrap().len(), 3);
}

#[test]
fn landmarks_in_images_are_ghands_own() {
    let folder = tempfile::tempdir().unwrap();
    pictures(folder.path(), 1);
    let line = ["track", "pictures/p0.png", "--camera", "cam3", "--out", "hands.json", "--hands", "1"];
    assert!(run(GHAND, folder.path(), &line).status.success());
    let file = json(&folder.path().join("hands.json"));
    let points = file["frames"][0]["image_landmarks"]["cam3"].as_array().unwrap();
    assert!(points.len() == 21 && points.iter().all(|point| point[0].as_f64().unwrap() > 2.0), "{points:?}");
    assert!(["left", "right"].contains(&file["side"].as_str().unwrap()));
    assert_eq!(file["tracker"], "mediapipe");
}

#[test]
fn what_cannot_be_tracked_leaves_no_file() {
    let folder = tempfile::tempdir().unwrap();
    pictures(folder.path(), 2);
    std::fs::write(folder.path().join("empty.mp4"), b"").unwrap();
    let before = listing(folder.path());
    for (line, parts) in [
        (vec!["none.mp4", "--out", "a.json"], vec!["none.mp4", "cannot be read"]),
        (vec!["empty.mp4", "--out", "a.json"], vec!["empty.mp4", "is empty"]),
        (vec!["pictures/p1.png", "--out", "a.json"], vec!["no hand was found", "pictures/p1.png"]),
        (vec!["pictures", "--out", "a.txt"], vec!["--out a.txt", ".json"]),
        (vec!["pictures/p0.png", "empty.mp4", "--out", "a.json"], vec!["one video at a time"]),
        (vec!["pictures/p0.png", "--out", "pictures/p0.png"], vec!["--out pictures/p0.png", "this command reads"]),
    ] {
        let output = run(GHAND, folder.path(), &[vec!["track"], line.clone()].concat());
        assert_one_sentence(&output, &parts);
        assert_eq!(listing(folder.path()), before, "{line:?}");
    }
}

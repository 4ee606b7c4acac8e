//! No command replaces what it reads.

use crate::common::{assert_one_sentence, run, save_avatar, small_capture};
use image::Rgb32FImage;

const GHAND: &str = env!("CARGO_BIN_EXE_ghand");
const TRAIN: &str = env!("CARGO_BIN_EXE_train");
const VIEWER: &str = env!("CARGO_BIN_EXE_viewer");

#[test]
fn an_output_that_is_an_input_is_refused_by_any_of_its_names() {
    let place = tempfile::tempdir().unwrap();
    let folder = place.path();
    save_avatar(folder);
    small_capture(&folder.join("S"));
    let at = |name: &str| folder.join(name);
    assert!(run(GHAND, folder, &["export", "builtin", "--out", "hand.glb"]).status.success());
    assert!(run(GHAND, folder, &["export", "hand.ghand", "--out", "scene.ply"]).status.success());
    assert!(run(GHAND, folder, &["pose", "--pose", "fist", "--out", "fist.json"]).status.success());
    Rgb32FImage::new(40, 30).save(at("w.exr")).unwrap();
    std::fs::copy(at("hand.ghand"), at("hand.png")).unwrap();
    std::fs::hard_link(at("hand.glb"), at("linked.glb")).unwrap();
    std::fs::create_dir(at("sub")).unwrap();
    #[cfg(unix)]
    std::os::unix::fs::symlink(at("hand.glb"), at("symbolic.glb")).unwrap();
    let image = std::fs::read_dir(at("S/images")).unwrap().next().unwrap().unwrap();
    let image = std::fs::read_dir(image.path()).unwrap().next().unwrap().unwrap().path();
    let kept = ["hand.ghand", "hand.glb", "scene.ply", "fist.json", "w.exr", "hand.png", "S/capture.json"];
    let before: Vec<Vec<u8>> = kept.iter().map(|name| std::fs::read(at(name)).unwrap()).collect();
    let image_before = std::fs::read(&image).unwrap();
    let sheet = format!("ghand inspect S --sheet {}", image.display());
    for (line, part) in [
        ("ghand bake hand.ghand --out sub/../hand.ghand", "hand.ghand"),
        ("ghand bake hand.ghand --out fist.ghand", "fist.json exists already"),
        ("ghand bake hand.ghand --poses S --out S/capture.ghand", "S/capture.json"),
        ("ghand export hand.glb --out hand.glb", "hand.glb, which"),
        ("ghand export hand.glb --out linked.glb", "hand.glb, which"),
        #[cfg(unix)]
        ("ghand export symbolic.glb --out hand.glb", "symbolic.glb, which"),
        ("ghand pose --hand-model hand.glb --out ./hand.glb", "hand.glb, which"),
        ("ghand pose --pose fist.json --out fist.json", "fist.json, which"),
        ("ghand pose --pose S --out S/capture.json", "a folder that this command reads"),
        ("ghand render hand.png --turntable 1 --out hand.png", "hand.png, which"),
        ("ghand render hand.ghand --turntable 1 --light w.exr --out w.exr", "w.exr, which"),
        ("ghand splat scene.ply --camera c.json --weights w.exr --gradients g.safetensors --out w.exr", "w.exr, which"),
        (&sheet, "a folder that this command reads"),
        ("viewer hand.png --screenshot hand.png", "hand.png, which"),
        ("train --capture S --out S", "the folder of the capture"),
        ("train --capture S/capture.json --out sub/../S", "the folder of the capture"),
        ("ghand evaluate hand.ghand --capture S --out S", "the folder of the capture"),
    ] {
        let words: Vec<&str> = line.split_whitespace().collect();
        let program = match words[0] {
            "ghand" => GHAND,
            "train" => TRAIN,
            _ => VIEWER,
        };
        assert_one_sentence(&run(program, folder, &words[1..]), &[part]);
    }
    for (name, before) in kept.iter().zip(before) {
        assert_eq!(std::fs::read(at(name)).unwrap(), before, "{name}");
    }
    assert_eq!(std::fs::read(image).unwrap(), image_before);
    for picture in ["a.jpg", "a.exr", "a"] {
        let output = run(VIEWER, folder, &["hand.ghand", "--screenshot", picture]);
        assert_one_sentence(&output, &[picture, "must end in .png"]);
    }
}

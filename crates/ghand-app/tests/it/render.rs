//! `ghand render` as a user runs it.

use crate::common::{assert_one_sentence, listing, run, save_avatar};
use ghand_avatar::{Avatar, AvatarLight, Light};
use ghand_core::light::directions;
use ghand_hand_model::surface::sample_surface;
use image::{ImageBuffer, Rgb, RgbImage};

const GHAND: &str = env!("CARGO_BIN_EXE_ghand");

/// A camera 0.6 m in front of the back of the hand, fingers up, as written in a capture.json.
const CAMERA: &str = r#"{"id":"c","width":96,"height":64,"intrinsics":[[120,0,48],[0,120,32],[0,0,1]],
    "rotation":[[0,0,1],[0,1,0],[-1,0,0]],"translation":[0,0.1,0.6]}"#;

fn open(path: &std::path::Path) -> RgbImage {
    image::open(path).unwrap().into_rgb8()
}

/// Fraction of the pixels that differ from the background.
fn coverage(picture: &RgbImage, background: [u8; 3]) -> f64 {
    let count = picture.pixels().filter(|p| p.0 != background).count();
    count as f64 / f64::from(picture.width() * picture.height())
}

/// Rows of zeros as JSON.
fn rows(count: usize) -> String {
    vec!["[0,0,0]"; count].join(",")
}

#[test]
fn a_turntable_shows_the_hand_from_all_sides() {
    let folder = tempfile::tempdir().unwrap();
    save_avatar(folder.path());
    let arguments =
        ["render", "hand.ghand", "--turntable", "2", "--size", "120x160", "--out", "a/b", "--pose", "relaxed"];
    let output = run(GHAND, folder.path(), &arguments);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let names = ["frame-0000_view-00.png", "frame-0000_view-01.png"];
    assert_eq!(listing(&folder.path().join("a/b")), [names[0], names[1], "render.json"]);
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(said.contains("a/b: 2 pictures of 120 x 160 pixels") && said.contains(names[1]), "{said}");
    let pictures = names.map(|name| format!("a/b/{name}")).map(|p| open(&folder.path().join(p)));
    for picture in &pictures {
        assert_eq!(picture.dimensions(), (120, 160));
        let covered = coverage(picture, [0, 0, 0]);
        assert!((0.1..0.8).contains(&covered), "the hand covers {covered} of the picture");
    }
    assert_ne!(pictures[0], pictures[1]);
}

#[test]
fn every_frame_or_the_requested_frame_of_a_pose_file_is_rendered() {
    let folder = tempfile::tempdir().unwrap();
    save_avatar(folder.path());
    let frame = |id: &str, y: f64| format!(r#"{{"id":"{id}","pose":[{}],"translation":[0,{y},0]}}"#, rows(16));
    let json = format!(r#"{{"fps":30,"frames":[{},{}]}}"#, frame("first", 0.0), frame("second", 0.02));
    std::fs::write(folder.path().join("poses.json"), json).unwrap();
    std::fs::write(folder.path().join("camera.json"), CAMERA).unwrap();
    let shared = ["render", "hand.ghand", "--pose", "poses.json", "--camera", "camera.json", "--background", "1,0,0"];
    let all = run(GHAND, folder.path(), &[&shared[..], &["--out", "all"]].concat());
    assert!(all.status.success(), "{}", String::from_utf8_lossy(&all.stderr));
    assert_eq!(listing(&folder.path().join("all")), ["frame-0000.png", "frame-0001.png", "render.json"]);
    let one = run(GHAND, folder.path(), &[&shared[..], &["--out", "one", "--frame", "second"]].concat());
    assert!(one.status.success());
    // The frame has the same name when rendered alone, so that pictures of two renders can be compared.
    assert_eq!(listing(&folder.path().join("one")), ["frame-0001.png", "render.json"]);
    let list: serde_json::Value =
        serde_json::from_slice(&std::fs::read(folder.path().join("one/render.json")).unwrap()).unwrap();
    assert_eq!(list["pictures"][0], serde_json::json!({"file": "frame-0001.png", "frame": 1, "id": "second"}));
    let [first, second] = ["all/frame-0000.png", "all/frame-0001.png"].map(|p| open(&folder.path().join(p)));
    assert_eq!((first.dimensions(), first.get_pixel(0, 0).0), ((96, 64), [255, 0, 0]));
    assert!(first != second && second == open(&folder.path().join("one/frame-0001.png")));
    // 0.02 m down at 0.6 m through 120 pixels: the picture moves 4 pixels down.
    let shifted = image::imageops::crop_imm(&first, 0, 0, 96, 60).to_image();
    let lower = image::imageops::crop_imm(&second, 0, 4, 96, 60).to_image();
    let equal =
        shifted.pixels().zip(lower.pixels()).filter(|(a, b)| a.0.iter().zip(b.0).all(|(a, b)| a.abs_diff(b) <= 30));
    assert!(equal.count() > 96 * 60 * 95 / 100);
}

#[test]
fn a_motion_is_rendered_at_its_rate() {
    let folder = tempfile::tempdir().unwrap();
    save_avatar(folder.path());
    let arguments = ["render", "hand.ghand", "--pose", "grasp", "--fps", "2", "--turntable", "1", "--size", "64x64"];
    let output = run(GHAND, folder.path(), &[&arguments[..], &["--out", "out"]].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let names = listing(&folder.path().join("out"));
    assert_eq!(names.len(), 6);
    let [open_hand, fist] =
        ["out/frame-0000_view-00.png", "out/frame-0002_view-00.png"].map(|name| open(&folder.path().join(name)));
    assert!(coverage(&fist, [0, 0, 0]) < 0.9 * coverage(&open_hand, [0, 0, 0]), "the hand does not close");
}

#[test]
fn bad_input_is_one_sentence_and_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let avatar = save_avatar(folder.path());
    let write = |name: &str, contents: &[u8]| std::fs::write(folder.path().join(name), contents).unwrap();
    let bytes = std::fs::read(&avatar).unwrap();
    write("cut.ghand", &bytes[..bytes.len() / 2]);
    write("text.ghand", b"not an avatar");
    write("broken.json", b"{\"frames\":[");
    write("short.json", format!(r#"{{"frames":[{{"id":"7","pose":[{}]}}]}}"#, rows(14)).as_bytes());
    let names = r#"["wrist","elbow"]"#;
    write(
        "other.json",
        format!(r#"{{"hand_model":{{"joints":{names}}},"frames":[{{"id":"7","pose":[{}]}}]}}"#, rows(2)).as_bytes(),
    );
    write("good.json", format!(r#"{{"frames":[{{"id":"7","pose":[{}]}}]}}"#, rows(16)).as_bytes());
    write("camera.json", CAMERA.as_bytes());
    write("mirror.json", CAMERA.replace("[0,1,0]", "[0,-1,0]").as_bytes());
    write("file", b"");
    let before = listing(folder.path());

    let turntable = ["--turntable", "1", "--size", "32x32"];
    let check = |arguments: &[&str], parts: &[&str]| {
        let out = if arguments.contains(&"--out") { &[][..] } else { &["--out", "out"][..] };
        let output = run(GHAND, folder.path(), &[&["render"], arguments, out].concat());
        assert_one_sentence(&output, parts);
        assert_eq!(listing(folder.path()), before, "{arguments:?}");
    };
    let with = |first: &[&'static str]| [first, &turntable].concat();
    check(&with(&["hand.ghand", "--same-tracker"]), &["--same-tracker", "\"rest\"", "of no tracker"]);
    check(
        &with(&["hand.ghand", "--pose", "good.json", "--same-tracker"]),
        &["--same-tracker", "hand.ghand", "does not know", "train it again"],
    );
    check(&with(&["missing.ghand"]), &["missing.ghand"]);
    check(&with(&["cut.ghand"]), &["cut.ghand", "truncated"]);
    check(&with(&["text.ghand"]), &["text.ghand"]);
    check(&with(&["hand.ghand", "--pose", "missing.json"]), &["missing.json"]);
    check(&with(&["hand.ghand", "--pose", "broken.json"]), &["broken.json"]);
    check(&with(&["hand.ghand", "--pose", "short.json"]), &["short.json", "\"7\"", "14 rows", "expected 16"]);
    check(&with(&["hand.ghand", "--pose", "other.json"]), &["other.json", "index1"]);
    check(&with(&["hand.ghand", "--pose", "good.json", "--frame", "8"]), &["good.json", "\"8\""]);
    check(&with(&["hand.ghand", "--pose", "salute"]), &["salute", "thumbs-up", "fist"]);
    check(&with(&["hand.ghand", "--adapter", "no such"]), &["no such", "adapter"]);
    check(&with(&["hand.ghand", "--out", "file"]), &["file"]);
    check(&with(&["hand.ghand", "--background", "2,0,0"]), &["--background"]);
    check(&["hand.ghand", "--camera", "missing.json"], &["missing.json"]);
    check(&["hand.ghand", "--camera", "broken.json"], &["broken.json"]);
    check(&["hand.ghand", "--camera", "mirror.json"], &["mirror.json", "rotation"]);
    check(&["hand.ghand"], &["--camera", "--turntable", "--orbit"]);
    check(&with(&["hand.ghand", "--out", "out.jpg"]), &["--out out.jpg", ".png"]);
    check(&with(&["hand.ghand", "--out", "a.png", "--format", "exr"]), &["a.png", "--format is exr"]);
    check(&["hand.ghand", "--turntable", "2", "--out", "a.png"], &["--out a.png", "there are 2"]);
    check(&["hand.ghand", "--pose", "grasp", "--turntable", "2", "--out", "a.gif"], &["--turntable", "--orbit"]);
    check(&["hand.ghand", "--pose", "grasp", "--fps", "60", "--orbit", "--out", "a.gif"], &["at most 50", "--fps"]);
    check(&["hand.ghand", "--pose", "fist", "--orbit"], &["--orbit", "--turntable"]);
    check(&["hand.ghand", "--pose", "grasp", "--orbit", "0"], &["--orbit"]);
    check(&["hand.ghand", "--camera", "camera.json:d"], &["camera.json: id", "\"c\""]);
    check(&["hand.ghand", "--turntable", "0"], &["--turntable"]);
}

/// Saves an avatar whose light comes from one side only.
fn save_lit_avatar(folder: &std::path::Path) {
    let mut avatar = Avatar::load(&save_avatar(folder)).unwrap();
    let samples = sample_surface(&avatar.model, avatar.config.uv_resolution).unwrap();
    let coefficients = directions().map(|d| [if d.x > 0.7 { 6.0 } else { 0.1 }; 3]).to_vec();
    let light = Light { coefficients, ..Light::studio() };
    avatar.light = Some(AvatarLight::new(light, None, &samples));
    avatar.save(&folder.join("lit.ghand")).unwrap();
}

/// Writes a panorama that is bright on one side.
fn write_panorama(path: &std::path::Path, width: u32, brightness: f32) {
    let lamp = |x, _| Rgb([if x < width / 4 { brightness } else { 0.1 }; 3]);
    ImageBuffer::<Rgb<f32>, Vec<f32>>::from_fn(width, 16, lamp).save(path).unwrap();
}

#[test]
fn an_avatar_is_rendered_in_other_light() {
    let folder = tempfile::tempdir().unwrap();
    save_lit_avatar(folder.path());
    write_panorama(&folder.path().join("sky.exr"), 32, 5.0);
    write_panorama(&folder.path().join("sky.hdr"), 32, 5.0);
    let render = |name: &str, light: &[&str]| {
        let arguments = ["render", "lit.ghand", "--turntable", "1", "--size", "96x128", "--out", name];
        let output = run(GHAND, folder.path(), &[&arguments[..], light].concat());
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        open(&folder.path().join(name))
    };
    let plain = render("plain.png", &[]);
    assert_eq!(plain, render("capture.png", &["--light", "capture"]));
    let others = [
        render("turned.png", &["--light-turn", "-120"]),
        render("studio.png", &["--light", "studio"]),
        render("exr.png", &["--light", "sky.exr"]),
        render("turned_exr.png", &["--light", "sky.exr", "--light-turn", "90"]),
    ];
    for (k, other) in others.iter().enumerate() {
        assert!(*other != plain, "{k}");
        assert!(others[..k].iter().all(|before| before != other), "{k}");
        assert!((coverage(other, [0, 0, 0]) - coverage(&plain, [0, 0, 0])).abs() < 0.02, "light moves nothing");
    }
    // Radiance in .hdr has eight bits.
    let hdr = render("hdr.png", &["--light", "sky.hdr"]);
    let far = hdr.as_raw().iter().zip(others[2].as_raw()).filter(|(a, b)| a.abs_diff(**b) > 4).count();
    assert!(far * 50 < hdr.as_raw().len(), "{far}");
}

#[test]
fn what_is_no_light_is_named() {
    let folder = tempfile::tempdir().unwrap();
    save_lit_avatar(folder.path());
    write_panorama(&folder.path().join("square.exr"), 16, 5.0);
    write_panorama(&folder.path().join("dark.exr"), 32, -5.0);
    write_panorama(&folder.path().join("endless.exr"), 32, f32::INFINITY);
    std::fs::write(folder.path().join("broken.hdr"), b"#?RADIANCE\nnothing").unwrap();
    std::fs::write(folder.path().join("picture.jpg"), b"").unwrap();
    let cases: [(&str, &[&str], &[&str]); 8] = [
        ("hand.ghand", &["--light", "studio"], &["--light", "--set light=transfer"]),
        ("lit.ghand", &["--light", "square.exr"], &["square.exr", "16 x 16", "twice as wide as high"]),
        ("lit.ghand", &["--light", "dark.exr"], &["dark.exr", "radiance of -5"]),
        ("lit.ghand", &["--light", "endless.exr"], &["endless.exr", "radiance of inf"]),
        ("lit.ghand", &["--light", "broken.hdr"], &["broken.hdr"]),
        ("lit.ghand", &["--light", "none.exr"], &["none.exr", "cannot read the panorama"]),
        ("lit.ghand", &["--light", "picture.jpg"], &["picture.jpg", ".exr or .hdr"]),
        ("lit.ghand", &["--light", "sunset"], &["`sunset` must be `capture`, `studio`"]),
    ];
    for (avatar, light, parts) in cases {
        let arguments = [&["render", avatar, "--turntable", "1", "--out", "out.png"], light].concat();
        assert_one_sentence(&run(GHAND, folder.path(), &arguments), parts);
        assert!(!folder.path().join("out.png").exists());
    }
}

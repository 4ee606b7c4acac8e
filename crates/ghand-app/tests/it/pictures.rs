//! Pictures and films as files: the outputs of `render`, `splat`, `pose` and `export`.

use std::path::Path;
use std::process::{Command, Stdio};

use crate::common::{assert_one_sentence, listing, run, run_in, save_avatar};
use image::{DynamicImage, RgbImage, Rgba32FImage, RgbaImage};

const GHAND: &str = env!("CARGO_BIN_EXE_ghand");

fn open(folder: &Path, name: &str) -> DynamicImage {
    image::open(folder.join(name)).unwrap()
}

/// Runs the program, which must succeed, and returns its output.
fn said(folder: &Path, arguments: &[&str]) -> String {
    let output = run(GHAND, folder, arguments);
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    assert!(output.stderr.is_empty(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// Largest and mean difference of two pictures' 8-bit values.
fn difference(a: &DynamicImage, b: &DynamicImage) -> (u8, f64) {
    let (a, b) = (a.to_rgba8().into_raw(), b.to_rgba8().into_raw());
    assert_eq!(a.len(), b.len());
    let apart: Vec<u8> = a.iter().zip(&b).map(|(a, b)| a.abs_diff(*b)).collect();
    (apart.iter().copied().max().unwrap(), apart.iter().map(|d| f64::from(*d)).sum::<f64>() / apart.len() as f64)
}

/// Display values of an EXR's linear light; straight colours if they are multiplied by alpha.
fn encoded(light: &DynamicImage, premultiplied: bool) -> Rgba32FImage {
    let encode = |v: f32| if v <= 0.003_130_8 { 12.92 * v } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 };
    let mut picture = light.to_rgba32f();
    for image::Rgba([r, g, b, a]) in picture.pixels_mut() {
        let part = if premultiplied { a.max(1e-6) } else { 1.0 };
        for value in [r, g, b] {
            *value = encode(*value / part);
        }
    }
    picture
}

#[test]
fn one_picture_can_be_a_file_with_an_extension_in_any_case() {
    let folder = tempfile::tempdir().unwrap();
    save_avatar(folder.path());
    let render = ["render", "hand.ghand", "--pose", "fist", "--turntable", "1", "--size", "64x64", "--out"];
    let text = said(folder.path(), &[&render[..], &["deep/er/hand.PNG"]].concat());
    assert_eq!(text, "deep/er/hand.PNG: 64 x 64 pixels\n");
    said(folder.path(), &[&render[..], &["hand.exr"]].concat());
    assert_eq!(listing(&folder.path().join("deep/er")), ["hand.PNG"]);
    let png = image::load_from_memory(&std::fs::read(folder.path().join("deep/er/hand.PNG")).unwrap()).unwrap();
    assert_eq!(png.color(), image::ColorType::Rgb8);
    let exr = open(folder.path(), "hand.exr");
    assert_eq!(exr.color(), image::ColorType::Rgba32F);
    assert!(difference(&png, &DynamicImage::from(DynamicImage::from(encoded(&exr, false)).to_rgb8())).0 <= 1);
    said(folder.path(), &["pose", "--picture", "new/mesh.Exr", "--size", "32x32", "--out", "new/mesh.OBJ"]);
    assert_eq!(listing(&folder.path().join("new")), ["mesh.Exr", "mesh.OBJ"]);
}

#[test]
fn a_picture_with_a_transparent_background_composites_over_any_colour() {
    let folder = tempfile::tempdir().unwrap();
    save_avatar(folder.path());
    let commands: [&[&str]; 2] = [
        &["render", "hand.ghand", "--turntable", "1", "--size", "64x96", "--out"],
        &["pose", "--pose", "fist", "--size", "64x96", "--picture"],
    ];
    for command in commands {
        for (ending, bound) in [("png", 2), ("exr", 1)] {
            let name = |kind: &str| format!("{kind}.{ending}");
            let with = |kind: &str, background: &str| {
                said(folder.path(), &[command, &[&name(kind), "--background", background]].concat());
                open(folder.path(), &name(kind))
            };
            let clear = with("clear", "transparent");
            assert!(clear.color().has_alpha());
            let floats = if ending == "exr" { encoded(&clear, true) } else { clear.into_rgba32f() };
            let partly = floats.pixels().filter(|p| (0.1..0.9).contains(&p.0[3])).count();
            assert!(floats.get_pixel(0, 0).0[3] == 0.0 && partly > 20, "{partly} pixels are partly covered");
            for (text, color) in [("1,0,0.6", [1.0, 0.0, 0.6]), ("0,1,0", [0.0, 1.0, 0.0])] {
                let over = RgbaImage::from_fn(64, 96, |x, y| {
                    let p = floats.get_pixel(x, y).0;
                    let byte = |c: usize| ((p[3] * p[c] + (1.0 - p[3]) * color[c]) * 255.0).round() as u8;
                    image::Rgba([byte(0), byte(1), byte(2), 255])
                });
                let opaque = with("opaque", text);
                let opaque = if ending == "exr" { encoded(&opaque, false).into() } else { opaque };
                let opaque = DynamicImage::from(opaque.to_rgb8());
                let (worst, _) = difference(&opaque, &DynamicImage::from(over));
                assert!(worst <= bound, "{command:?} .{ending} over {text}: {worst}");
            }
        }
    }
}

#[test]
fn a_render_replaces_the_previous_one_and_no_other_file() {
    let folder = tempfile::tempdir().unwrap();
    save_avatar(folder.path());
    let render = ["render", "hand.ghand", "--size", "16x16", "--out", "out", "--turntable"];
    said(folder.path(), &[&render[..], &["3"]].concat());
    std::fs::write(folder.path().join("out/notes.txt"), b"mine").unwrap();
    let text = said(folder.path(), &[&render[..], &["1", "--format", "exr"]].concat());
    assert!(text.contains("3 pictures of an earlier render were removed"), "{text}");
    assert_eq!(listing(&folder.path().join("out")), ["frame-0000_view-00.exr", "notes.txt", "render.json"]);
    std::fs::remove_file(folder.path().join("out/render.json")).unwrap();
    let output = run(GHAND, folder.path(), &[&render[..], &["1", "--format", "exr"]].concat());
    assert_one_sentence(&output, &["out/frame-0000_view-00.exr", "not from an earlier render"]);
}

#[test]
fn a_motion_is_filmed_while_the_camera_goes_around() {
    let folder = tempfile::tempdir().unwrap();
    save_avatar(folder.path());
    let orbit = ["render", "hand.ghand", "--pose", "grasp", "--fps", "4", "--size", "48x48", "--orbit"];
    said(folder.path(), &[&orbit[..], &["--out", "pictures"]].concat());
    let names = listing(&folder.path().join("pictures"));
    assert_eq!((names.len(), names[0].as_str(), names[9].as_str()), (11, "frame-0000.png", "frame-0009.png"));
    // The hand is open in the first frame and, after a full turn, in the last; after a quarter turn it is seen from the
    // side.
    let width = |name: &str| {
        let picture = open(folder.path(), &format!("pictures/{name}")).into_rgb8();
        let columns = (0..48).filter(|x| (0..48).any(|y| picture.get_pixel(*x, y).0 != [0; 3])).count();
        assert!(columns > 5, "{name} is empty");
        columns
    };
    assert!(width("frame-0002.png") < width("frame-0000.png"));
    let text = said(folder.path(), &[&orbit[..], &["0.5", "--out", "films", "--format", "gif"]].concat());
    assert!(text.starts_with("films/grasp.gif: 10 pictures of 48 x 48 pixels"), "{text}");
    let mut options = gif::DecodeOptions::new();
    options.set_color_output(gif::ColorOutput::RGBA);
    let file = std::fs::File::open(folder.path().join("films/grasp.gif")).unwrap();
    let mut decoder = options.read_info(file).unwrap();
    let first = decoder.read_next_frame().unwrap().unwrap().clone();
    let shown = RgbaImage::from_raw(48, 48, first.buffer.into_owned()).unwrap();
    let rendered = open(folder.path(), "pictures/frame-0000.png");
    let (worst, mean) = difference(&DynamicImage::from(shown), &rendered);
    assert!(worst <= 16 && mean < 2.0, "{worst} {mean}");
    assert_eq!(
        (first.delay, 1 + std::iter::from_fn(|| decoder.read_next_frame().unwrap().map(|_| ())).count()),
        (25, 10)
    );
}

#[cfg(unix)]
#[test]
fn films_are_encoded_by_ffmpeg_and_its_absence_is_reported_with_a_remedy() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().unwrap();
    save_avatar(folder.path());
    let path = std::env::var("PATH").unwrap();
    let program = folder.path().join("bin/ffmpeg");
    std::fs::create_dir(folder.path().join("bin")).unwrap();
    let film = |out: &str, path: &str| {
        let arguments = ["render", "hand.ghand", "--turntable", "3", "--size", "30x20", "--out", out];
        run_in(GHAND, folder.path(), &arguments, &[("PATH", path)])
    };
    let alone = folder.path().join("bin");
    let missing = film("a.mp4", alone.to_str().unwrap());
    assert_one_sentence(&missing, &["need ffmpeg", "not installed", "apt-get install ffmpeg", ".gif"]);
    assert!(!folder.path().join("a.mp4").exists());

    // A replacement for ffmpeg: the film is its standard input.
    let pretend = |script: &str| {
        std::fs::write(&program, format!("#!/bin/sh\n{script}\n")).unwrap();
        std::fs::set_permissions(&program, std::fs::Permissions::from_mode(0o755)).unwrap();
    };
    let both = format!("{}:{path}", alone.display());
    pretend(r#"echo "$@" > arguments; for last; do :; done; cat > "$last""#);
    let output = film("films/a.MP4", &both);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let raw = std::fs::read(folder.path().join("films/a.MP4")).unwrap();
    assert_eq!(raw.len(), 3 * 30 * 20 * 4);
    said(folder.path(), &["render", "hand.ghand", "--turntable", "3", "--size", "30x20", "--out", "pictures"]);
    for (k, piped) in raw.chunks(30 * 20 * 4).enumerate() {
        let picture = open(folder.path(), &format!("pictures/frame-0000_view-{k:02}.png"));
        assert!(picture.to_rgba8().into_raw() == piped, "picture {k}");
    }
    let arguments = std::fs::read_to_string(folder.path().join("arguments")).unwrap();
    for part in ["-pixel_format rgba", "-video_size 30x20", "-framerate 1 ", "libx264", "yuv420p"] {
        assert!(arguments.contains(part), "{part} is not in: {arguments}");
    }
    // A failure is reported and leaves no file.
    pretend("echo 'Unknown encoder' >&2; exit 1");
    assert_one_sentence(&film("b.webm", &both), &["ffmpeg", "Unknown encoder"]);
    assert!(!folder.path().join("b.webm").exists());
}

#[test]
fn an_exported_avatar_looks_like_its_rendering() {
    let folder = tempfile::tempdir().unwrap();
    save_avatar(folder.path());
    let text = said(folder.path(), &["export", "hand.ghand", "--pose", "fist", "--out", "new/Fist.PLY"]);
    assert!(text.starts_with("new/Fist.PLY: ") && text.contains("Gaussians"), "{text}");
    let camera = concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples/camera.json");
    let shared = ["--camera", camera, "--size", "200x200", "--background", "0.3,0.3,0.9"];
    said(folder.path(), &[&["render", "hand.ghand", "--pose", "fist", "--out", "a.exr"], &shared[..]].concat());
    said(folder.path(), &[&["splat", "new/Fist.PLY", "--out", "b.exr"], &shared[..]].concat());
    said(folder.path(), &[&["render", "hand.ghand", "--pose", "open", "--out", "c.exr"], &shared[..]].concat());
    let [a, b, c] = ["a.exr", "b.exr", "c.exr"].map(|name| open(folder.path(), name));
    // A scene's pixels are the numbers that its Gaussians have.
    let [a, c] = [a, c].map(|light| encoded(&light, false).into_raw());
    let b = b.into_rgba32f().into_raw();
    let worst = |x: &[f32], y: &[f32]| x.iter().zip(y).map(|(x, y)| (x - y).abs()).fold(0.0, f32::max);
    // An opacity of 0.99999, and a contribution of 1/255 that is drawn by one of them only.
    assert!(worst(&a, &b) <= 1.1 / 255.0, "{}", worst(&a, &b));
    let mean = a.iter().zip(&b).map(|(a, b)| f64::from((a - b).abs())).sum::<f64>() / a.len() as f64;
    assert!(mean < 2e-5, "{mean}");
    assert!(worst(&a, &c) > 0.3, "the pose is not seen");
    let turntable = ["splat", "new/Fist.PLY", "--turntable", "2", "--size", "60x60", "--out", "views"];
    assert!(said(folder.path(), &turntable).contains("view-00.png to view-01.png"));
    for view in ["views/view-00.png", "views/view-01.png"] {
        let seen = open(folder.path(), view).into_rgb8().pixels().filter(|p| p.0 != [0; 3]).count();
        assert!((500..2800).contains(&seen), "{view}: {seen} of 3600 pixels");
    }
    let one = ["export", "hand.ghand", "--pose", "grasp", "--frame", "99999", "--out", "b.ply"];
    assert_one_sentence(&run(GHAND, folder.path(), &one), &["grasp", "99999"]);
    assert_one_sentence(&run(GHAND, folder.path(), &["export", "hand.ghand", "--out", "b.obj"]), &["b.obj", ".ply"]);
}

#[test]
fn the_example_camera_sees_the_whole_hand_and_cameras_of_captures_are_chosen_by_id() {
    let folder = tempfile::tempdir().unwrap();
    save_avatar(folder.path());
    let example = concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples/camera.json");
    let render = |camera: &str| {
        ["render", "hand.ghand", "--size", "100x100", "--out", "a.png", "--camera"]
            .map(String::from)
            .into_iter()
            .chain([camera.to_owned()])
            .collect::<Vec<_>>()
    };
    let picture = |camera: &str| {
        let arguments = render(camera);
        said(folder.path(), &arguments.iter().map(String::as_str).collect::<Vec<_>>());
        open(folder.path(), "a.png").into_rgb8()
    };
    let check = |seen: &RgbImage| {
        let is_hand = |x: u32, y: u32| seen.get_pixel(x, y).0 != [0; 3];
        let covered = (0..10_000).filter(|i| is_hand(i % 100, i / 100)).count();
        assert!((1000..6000).contains(&covered), "{covered} of 10000 pixels");
        let border = |k: u32| [(k, 0), (k, 99), (0, k), (99, k)];
        assert!((0..100).flat_map(border).all(|(x, y)| !is_hand(x, y)), "it is cut off");
    };
    let seen = picture(example);
    check(&seen);
    let built_in = ["pose", "--picture", "b.png", "--camera", example, "--size", "100x100", "--background", "0,0,0"];
    said(folder.path(), &built_in);
    check(&open(folder.path(), "b.png").into_rgb8());

    // The same camera in a capture, and one that is turned away.
    let camera = std::fs::read_to_string(example).unwrap();
    let away = camera.replace("\"front\"", "\"away\"").replace("0.6]", "-0.6]");
    std::fs::write(folder.path().join("capture.json"), format!(r#"{{"cameras":[{camera},{away}]}}"#)).unwrap();
    assert!(picture("capture.json:front") == seen);
    let arguments = render("capture.json:away");
    let output = run(GHAND, folder.path(), &arguments.iter().map(String::as_str).collect::<Vec<_>>());
    assert!(String::from_utf8_lossy(&output.stderr).contains("the hand is behind the camera"));
    assert!(open(folder.path(), "a.png").into_rgb8().pixels().all(|p| p.0 == [0; 3]));
    for (name, part) in [("capture.json:back", "\"back\""), ("capture.json", "choose one")] {
        for command in [
            &["render", "hand.ghand", "--out", "b.png", "--camera", name][..],
            &["pose", "--picture", "b.png", "--camera", name],
        ] {
            assert_one_sentence(&run(GHAND, folder.path(), command), &["capture.json: cameras", part, "front, away"]);
        }
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_stdout_is_an_error_and_a_closed_one_is_not() {
    let folder = tempfile::tempdir().unwrap();
    for arguments in [&["pose", "--pose", "fist", "--out", "a.obj"][..], &["render", "--help"]] {
        let start = |stdout: Stdio| {
            let mut command = Command::new(GHAND);
            command.current_dir(folder.path()).args(arguments).stdout(stdout).stderr(Stdio::piped());
            command.output().unwrap()
        };
        let full = std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
        assert_one_sentence(&start(full.into()), &["stdout", "space"]);
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        let closed = start(writer.into());
        assert!(closed.status.success() && closed.stderr.is_empty(), "{}", String::from_utf8_lossy(&closed.stderr));
    }
    assert!(folder.path().join("a.obj").exists(), "the work is done all the same");
}

//! `ghand splat` as a user runs it.

use std::path::Path;

use crate::common::{assert_one_sentence, listing, run};
use ghand_test_support::cases;
use image::Rgb32FImage;

const GHAND: &str = env!("CARGO_BIN_EXE_ghand");

const SIZE: [u32; 2] = [40, 30];
const CAMERA: &str = r#"{"id":"c","width":40,"height":30,"intrinsics":[[50,0,20],[0,50,15],[0,0,1]],
    "rotation":[[1,0,0],[0,1,0],[0,0,1]],"translation":[0,0,1]}"#;

/// Two Gaussians with harmonics of degree 1: numbers by Gaussian, in the order of the properties below.
fn numbers() -> Vec<Vec<f64>> {
    let mut first = vec![0.05, 0.02, 0.1, 0.5, -0.3, 0.2];
    first.extend((0..9).map(|k| 0.1 * f64::from(k) - 0.4));
    first.extend([1.0, -1.9, -3.6, -2.7, 0.9, 0.1, -0.3, 0.2]);
    let mut second = vec![-0.05, -0.03, 0.0, -0.2, 0.6, 0.4];
    second.extend((0..9).map(|k| 0.05 * f64::from(k)));
    second.extend([-0.5, -1.8, -2.6, -3.7, 0.3, -0.8, 0.4, 0.1]);
    vec![first, second]
}

fn ply(scene: &[Vec<f64>]) -> Vec<u8> {
    let mut names: Vec<String> = ["x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2"].map(String::from).to_vec();
    names.extend((0..9).map(|k| format!("f_rest_{k}")));
    names.extend(["opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"].map(String::from));
    let properties: String = names.iter().map(|name| format!("property float {name}\n")).collect();
    let header =
        format!("ply\nformat binary_little_endian 1.0\nelement vertex {}\n{properties}end_header\n", scene.len());
    let data = scene.iter().flatten().flat_map(|v| (*v as f32).to_le_bytes());
    header.into_bytes().into_iter().chain(data).collect()
}

fn set_up(folder: &Path) {
    std::fs::write(folder.join("scene.ply"), ply(&numbers())).unwrap();
    std::fs::write(folder.join("camera.json"), CAMERA).unwrap();
    weights().save(folder.join("w.exr")).unwrap();
}

/// Weights that change slowly over the picture: this keeps the effect of the alpha cut small, which finite differences
/// include and gradients do not.
fn weights() -> Rgb32FImage {
    Rgb32FImage::from_fn(SIZE[0], SIZE[1], |x, y| {
        image::Rgb([0.0, 1.0, 2.0].map(|c| (0.13 * x as f32 + 0.17 * y as f32 + c).sin()))
    })
}

/// Runs the command and returns the picture's floats.
fn render(folder: &Path, more: &[&str]) -> Vec<f32> {
    let arguments =
        ["splat", "scene.ply", "--camera", "camera.json", "--out", "out.exr", "--background", "0.2,0.3,0.4"];
    let output = run(GHAND, folder, &[&arguments[..], more].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let picture = image::open(folder.join("out.exr")).unwrap().into_rgba32f();
    assert_eq!(picture.dimensions(), (SIZE[0], SIZE[1]));
    picture.into_raw()
}

/// The weighted sum of the picture's red, green and blue.
fn weighted_sum(picture: &[f32]) -> f64 {
    let weights = weights();
    let pixels = picture.as_chunks::<4>().0.iter().zip(weights.pixels());
    pixels.map(|(p, w)| (0..3).map(|c| f64::from(p[c]) * f64::from(w.0[c])).sum::<f64>()).sum()
}

#[test]
fn a_scene_is_rendered_over_the_background_with_its_coverage() {
    let folder = tempfile::tempdir().unwrap();
    set_up(folder.path());
    let picture = render(folder.path(), &[]);
    assert_eq!(picture[..4], [0.2, 0.3, 0.4, 0.0]);
    let most = picture.iter().skip(3).step_by(4).copied().fold(0.0, f32::max);
    assert!((0.3..1.0).contains(&most), "{most}");
    let arguments = ["splat", "scene.ply", "--camera", "camera.json", "--out", "out.png"];
    assert!(run(GHAND, folder.path(), &arguments).status.success());
    assert_eq!(image::open(folder.path().join("out.png")).unwrap().into_rgb8().get_pixel(0, 0).0, [0, 0, 0]);
}

#[test]
fn the_gradient_is_that_of_the_stored_numbers() {
    let folder = tempfile::tempdir().unwrap();
    set_up(folder.path());
    render(folder.path(), &["--weights", "w.exr", "--gradients", "g.safetensors"]);
    let bytes = std::fs::read(folder.path().join("g.safetensors")).unwrap();
    let file = safetensors::SafeTensors::deserialize(&bytes).unwrap();
    let tensor = |name: &str, shape: &[usize]| -> Vec<f64> {
        let tensor = file.tensor(name).unwrap();
        assert_eq!(tensor.shape(), shape, "{name}");
        tensor.data().as_chunks::<4>().0.iter().map(|b| f64::from(f32::from_le_bytes(*b))).collect()
    };
    let sh = tensor("sh", &[2, 4, 3]);
    let parts = [
        (tensor("means", &[2, 3]), vec![0, 1, 2]),
        (tensor("opacity_logits", &[2]), vec![15]),
        (tensor("log_scales", &[2, 3]), vec![16, 17, 18]),
        (tensor("quats", &[2, 4]), vec![19, 20, 21, 22]),
        // Ordered by function; the file orders the harmonics beyond the first by channel.
        (sh, vec![3, 4, 5, 6, 9, 12, 7, 10, 13, 8, 11, 14]),
    ];
    for (gradient, columns) in parts {
        let largest = gradient.iter().fold(0.0, |m: f64, g| m.max(g.abs()));
        // Two renderings each; some of every part.
        for (k, analytic) in gradient.iter().enumerate().step_by(cases(5, 1)) {
            let gaussian = k / columns.len();
            let column = columns[k % columns.len()];
            let shifted = |h: f64| {
                let mut scene = numbers();
                scene[gaussian][column] += h;
                std::fs::write(folder.path().join("scene.ply"), ply(&scene)).unwrap();
                weighted_sum(&render(folder.path(), &[]))
            };
            // The loss at the alpha cut changes with the size: exact to several per cent, enough to distinguish
            // parameters.
            let numeric = (shifted(2e-3) - shifted(-2e-3)) / 4e-3;
            assert!(
                (analytic - numeric).abs() <= 0.1 * largest + 1e-3,
                "column {column}: {analytic} against {numeric}"
            );
        }
    }
}

#[test]
fn a_failed_rendering_is_one_sentence_and_leaves_no_file() {
    let folder = tempfile::tempdir().unwrap();
    set_up(folder.path());
    std::fs::write(folder.path().join("cut.ply"), &ply(&numbers())[..700]).unwrap();
    Rgb32FImage::new(7, 5).save(folder.path().join("small.exr")).unwrap();
    let before = listing(folder.path());
    let cases: [(&[&str], &str); 6] = [
        (&["scene.ply", "--camera", "camera.json", "--out", "out.jpg"], "out.jpg"),
        (&["absent.ply", "--camera", "camera.json", "--out", "out.png"], "absent.ply"),
        (&["cut.ply", "--camera", "camera.json", "--out", "out.png"], "cut.ply: data"),
        (&["scene.ply", "--camera", "scene.ply", "--out", "out.png"], "scene.ply: "),
        (&["scene.ply", "--camera", "camera.json", "--out", "out.exr", "--weights", "w.exr"], "--gradients"),
        (
            &[
                "scene.ply",
                "--camera",
                "camera.json",
                "--out",
                "o.exr",
                "--weights",
                "small.exr",
                "--gradients",
                "g.safetensors",
            ],
            "small.exr",
        ),
    ];
    for (arguments, expected) in cases {
        assert_one_sentence(&run(GHAND, folder.path(), &[&["splat"], arguments].concat()), &[expected]);
        assert_eq!(listing(folder.path()), before);
    }
}

/// Many Gaussians that are thinner than a pixel, with this comment.
fn thin(comment: &str) -> Vec<u8> {
    let size = (0.1f64 / 50.0).ln();
    let one = |k: usize| {
        let [x, y] = [k % 9, k / 9].map(|k| 0.06 * (k as f64 - 4.0));
        let mut numbers = vec![x, y, 0.0, 1.0, 1.0, 1.0];
        numbers.extend([0.0; 9]);
        numbers.extend([2.0, size, size, size, 1.0, 0.0, 0.0, 0.0]);
        numbers
    };
    let bytes = ply(&(0..81).map(one).collect::<Vec<_>>());
    let (format, rest) = bytes.split_at(b"ply\nformat binary_little_endian 1.0\n".len());
    [format, comment.as_bytes(), rest].concat()
}

#[test]
fn a_scene_that_says_so_is_antialiased() {
    let folder = tempfile::tempdir().unwrap();
    set_up(folder.path());
    let picture = |comment: &str, more: &[&str]| {
        std::fs::write(folder.path().join("scene.ply"), thin(comment)).unwrap();
        render(folder.path(), more)
    };
    let plain = picture("", &[]);
    let antialiased = picture("", &["--antialias"]);
    assert_ne!(plain, antialiased);
    for comment in ["comment SplatRenderMode: mip\n", "comment Generated by Postshot\ncomment antialiased 1\n"] {
        assert!(picture(comment, &[]) == antialiased, "{comment}");
    }
    for comment in ["comment SplatRenderMode: default\n", "comment antialiased 0\n", "comment mip\n"] {
        assert!(picture(comment, &[]) == plain, "{comment}");
    }
}

#[test]
fn pictures_of_nothing_and_suspicious_numbers_are_told() {
    let folder = tempfile::tempdir().unwrap();
    set_up(folder.path());
    let told = |camera: &str| {
        std::fs::write(folder.path().join("camera.json"), camera).unwrap();
        let arguments = ["splat", "scene.ply", "--camera", "camera.json", "--out", "out.png"];
        let output = run(GHAND, folder.path(), &arguments);
        assert!(output.status.success());
        String::from_utf8_lossy(&output.stderr).into_owned()
    };
    assert_eq!(told(CAMERA), "");
    let moved = |place: &str| CAMERA.replace("[0,0,1]}", &format!("{place}}}"));
    assert!(told(&moved("[0,0,-2]")).contains("behind the camera"));
    assert!(told(&moved("[30,0,1]")).contains("outside of the picture"));
    let scenes = [(0, 0.9, "logits"), (1, 0.002, "logarithms")];
    for (which, value, part) in scenes {
        let mut scene = numbers();
        for (k, gaussian) in scene.iter_mut().enumerate() {
            let columns = if which == 0 { 15..16 } else { 16..19 };
            gaussian[columns].iter_mut().for_each(|number| *number = value + 1e-3 * k as f64);
        }
        std::fs::write(folder.path().join("scene.ply"), ply(&scene)).unwrap();
        let told = told(CAMERA);
        assert!(told.contains(part) && told.contains("scene.ply") && told.trim().lines().count() == 1, "{told}");
    }
}

#[test]
fn scenes_in_formats_that_are_not_read_are_named() {
    let folder = tempfile::tempdir().unwrap();
    set_up(folder.path());
    for (name, bytes, part) in [
        ("a.sog", &b"PK\x03\x04 and more"[..], "SOG"),
        ("a.ksplat", b"\x01 and more", ".ksplat"),
        ("a.spz", b"NGSP\x04\0\0\0", "version 4"),
        ("b.spz", b"no such thing", "not that of an SPZ"),
        ("a.splat", b"too short", "32 for each"),
    ] {
        std::fs::write(folder.path().join(name), bytes).unwrap();
        for command in [&["splat", name, "--turntable", "1", "--out", "o.png"][..], &["inspect", name]] {
            assert_one_sentence(&run(GHAND, folder.path(), command), &[name, part]);
        }
    }
}

#[cfg(unix)]
#[test]
fn a_device_in_place_of_a_scene_or_an_avatar_is_not_read() {
    let folder = tempfile::tempdir().unwrap();
    set_up(folder.path());
    let splat = ["splat", "/dev/zero", "--camera", "camera.json", "--out", "out.png"];
    assert_one_sentence(&run(GHAND, folder.path(), &splat), &["/dev/zero", "not a file"]);
    let render = ["render", "/dev/zero", "--pose", "fist", "--turntable", "1", "--out", "pictures"];
    assert_one_sentence(&run(GHAND, folder.path(), &render), &["/dev/zero", "not a file"]);
}

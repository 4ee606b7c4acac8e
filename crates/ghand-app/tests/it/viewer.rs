//! `viewer` as a user runs it, without a display.

use std::fmt::Write;

use ghand_test_support::mano_files::model::write_mano;
use ghand_test_support::procedural_hand::ProceduralHand;

use crate::common::{assert_one_sentence, listing, run, save_avatar, small_capture};

const VIEWER: &str = env!("CARGO_BIN_EXE_viewer");

#[test]
fn a_screenshot_shows_panel_and_hand_without_a_display() {
    let folder = tempfile::tempdir().unwrap();
    save_avatar(folder.path());
    let arguments = ["hand.ghand", "--screenshot", "shot.png", "--size", "640x480", "--pose", "fist"];
    let output = run(VIEWER, folder.path(), &arguments);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(listing(folder.path()), ["hand.ghand", "shot.png"]);
    let picture = image::open(folder.path().join("shot.png")).unwrap().into_rgb8();
    assert_eq!(picture.dimensions(), (640, 480));
    // The hand is reddish and bright, the rest of the interface grey.
    let skin = picture.enumerate_pixels().filter(|(_, _, p)| p.0[0] > 120 && p.0[0] > p.0[2].saturating_add(30));
    let places: Vec<u32> = skin.map(|(x, _, _)| x).collect();
    // The pictures of the poses end before the panel's edge.
    let (view, panel): (Vec<u32>, Vec<u32>) = places.into_iter().partition(|x| *x >= 250);
    let covered = view.len() as f64 / f64::from(380 * 480);
    assert!((0.05..0.7).contains(&covered), "the hand covers {covered} of its panel");
    assert!(view.iter().all(|x| *x >= 260), "the hand is drawn over the panel");
    assert!(panel.len() > 1000, "the poses have no pictures: {} pixels", panel.len());
    let text = picture.enumerate_pixels().filter(|(x, _, p)| *x < 260 && p.0[0] > 140).count();
    assert!(text > 500, "the panel is empty: {text} bright pixels");
}

/// A scene as text: a red ball of this radius about (7, -3, 20) and, as in trained scenes, a few Gaussians far away.
fn ball(radius: f64) -> String {
    let properties = "x y z f_dc_0 f_dc_1 f_dc_2 opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3";
    let count = 400;
    let mut text = format!("ply\nformat ascii 1.0\nelement vertex {}\n", count + 10);
    properties.split(' ').for_each(|name| writeln!(text, "property float {name}").unwrap());
    text += "end_header\n";
    let mut add = |[x, y, z]: [f64; 3]| {
        let size = (0.1 * radius).ln();
        writeln!(text, "{x} {y} {z} 1.5 -1.5 -1.5 4 {size} {size} {size} 1 0 0 0").unwrap();
    };
    for k in 0..count {
        // Points of a spiral from pole to pole.
        let height = 2.0 * (f64::from(k) + 0.5) / f64::from(count) - 1.0;
        let turn = 2.4 * f64::from(k);
        let ring = (1.0 - height * height).sqrt();
        add([7.0 + radius * ring * turn.cos(), -3.0 + radius * height, 20.0 + radius * ring * turn.sin()]);
    }
    (0..10).for_each(|k| add([1e4 * radius, f64::from(k), -1e3 * radius]));
    text
}

#[test]
fn a_scene_fills_its_panel_despite_units_and_outliers() {
    let folder = tempfile::tempdir().unwrap();
    for radius in [0.002, 1.0, 300.0] {
        std::fs::write(folder.path().join("ball.ply"), ball(radius)).unwrap();
        let output = run(VIEWER, folder.path(), &["ball.ply", "--screenshot", "shot.png", "--size", "560x300"]);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let picture = image::open(folder.path().join("shot.png")).unwrap().into_rgb8();
        let red = picture.enumerate_pixels().filter(|(_, _, p)| p.0[0] > 120 && p.0[1] < 60 && p.0[2] < 60);
        let places: Vec<[u32; 2]> = red.map(|(x, y, _)| [x, y]).collect();
        // The panel of the picture begins at 260 and is 300 x 300.
        for (axis, low) in [(0, 260), (1, 0)] {
            let (first, last) = places.iter().fold((u32::MAX, 0), |(a, b), p| (a.min(p[axis]), b.max(p[axis])));
            assert!(first >= low && (200..300).contains(&(last - first)), "{radius}: {first} to {last}");
            assert!((first + last).abs_diff(2 * low + 300) < 30, "{radius}: {first} to {last} is not in the middle");
        }
        assert!(places.len() > 30_000, "{radius}: {} red pixels", places.len());
    }
}

#[test]
fn a_hand_model_is_shown_as_an_untrained_hand_that_can_be_posed() {
    let folder = tempfile::tempdir().unwrap();
    let model = ProceduralHand { detail: 1, ..Default::default() }.build().unwrap();
    write_mano(&folder.path().join("right.npz"), &model);
    let shot = |pose: &str| {
        let arguments = ["right.npz", "--screenshot", "shot.png", "--size", "500x240", "--pose", pose];
        let output = run(VIEWER, folder.path(), &arguments);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        image::open(folder.path().join("shot.png")).unwrap().into_rgb8()
    };
    let [flat, fist] = ["rest", "fist"].map(|pose| {
        shot(pose).enumerate_pixels().filter(|(x, _, p)| *x > 260 && p.0[0] > p.0[2].saturating_add(30)).count()
    });
    // Both are framed, and a fist is rounder.
    assert!(flat > 2000 && fist > flat, "{flat} pixels of a flat hand, {fist} of a fist");
}

#[test]
fn a_capture_is_seen_through_its_first_camera_in_the_pose_of_its_first_frame() {
    let folder = tempfile::tempdir().unwrap();
    small_capture(&folder.path().join("capture"));
    let shot = |arguments: &[&str]| {
        let arguments = [&["builtin", "--screenshot", "shot.png", "--size", "560x300"], arguments].concat();
        let output = run(VIEWER, folder.path(), &arguments);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let picture = image::open(folder.path().join("shot.png")).unwrap().into_rgb8();
        let is_skin = |x: u32, p: &image::Rgb<u8>| x > 262 && p.0[0] > p.0[2].saturating_add(30);
        picture.enumerate_pixels().filter(|(x, _, p)| is_skin(*x, p)).map(|(x, y, _)| [x, y]).collect::<Vec<_>>()
    };
    let alone = shot(&[]);
    let captured = shot(&["--capture", "capture"]);
    assert_ne!(alone, captured);
    assert!(captured.len() > 3000, "{} pixels of a hand", captured.len());
    // The capture's cameras look at its hand: so it is inside their upright picture, which has the window's height.
    let middle = captured.iter().map(|[x, _]| f64::from(*x)).sum::<f64>() / captured.len() as f64;
    assert!((middle - 410.0).abs() < 60.0, "{middle}");
    assert_one_sentence(
        &run(VIEWER, folder.path(), &["builtin", "--capture", "absent", "--screenshot", "a.png"]),
        &["absent"],
    );
}

#[test]
fn a_screenshot_has_the_theme_and_scale_that_were_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    save_avatar(folder.path());
    let shot = |arguments: &[&str]| {
        let arguments = [&["hand.ghand", "--screenshot", "shot.png"], arguments].concat();
        let output = run(VIEWER, folder.path(), &arguments);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        image::open(folder.path().join("shot.png")).unwrap().into_rgb8()
    };
    let dark = shot(&["--size", "600x400"]);
    let light = shot(&["--size", "600x400", "--theme", "light"]);
    assert!(dark.get_pixel(590, 5).0.iter().all(|v| *v < 60) && light.get_pixel(590, 5).0.iter().all(|v| *v > 200));
    // Twice as many pixels show the same.
    let fine = shot(&["--size", "1200x800", "--scale", "2"]);
    let [small, large] = [&dark, &image::imageops::resize(&fine, 600, 400, image::imageops::FilterType::Triangle)]
        .map(|picture| image::imageops::crop_imm(picture, 270, 0, 330, 400).to_image());
    let off = small.iter().zip(large.iter()).map(|(a, b)| f64::from(a.abs_diff(*b))).sum::<f64>() / small.len() as f64;
    assert!(off < 4.0, "{off}");
}

#[test]
fn without_an_argument_the_last_trained_avatar_or_an_untrained_hand_is_shown() {
    let folder = tempfile::tempdir().unwrap();
    let shot = |name: &str| {
        let output = run(VIEWER, folder.path(), &["--screenshot", name, "--size", "400x300"]);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        std::fs::read(folder.path().join(name)).unwrap()
    };
    let bare = shot("bare.png");
    let last = folder.path().join("out/train-2/avatar.ghand");
    std::fs::create_dir_all(last.parent().unwrap()).unwrap();
    std::fs::rename(save_avatar(folder.path()), &last).unwrap();
    assert_ne!(bare, shot("trained.png"));
}

#[test]
fn bad_input_is_one_sentence_and_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let bytes = std::fs::read(save_avatar(folder.path())).unwrap();
    std::fs::write(folder.path().join("cut.ghand"), &bytes[..bytes.len() / 2]).unwrap();
    let scene = ball(1.0);
    std::fs::write(folder.path().join("ball.ply"), &scene).unwrap();
    std::fs::write(folder.path().join("cut.ply"), &scene[..scene.len() / 2]).unwrap();
    std::fs::write(folder.path().join("empty.ply"), scene.replace("vertex 410", "vertex 0")).unwrap();
    std::fs::write(folder.path().join("notes.txt"), "to do").unwrap();
    let before = listing(folder.path());
    let check = |arguments: &[&str], parts: &[&str]| {
        assert_one_sentence(&run(VIEWER, folder.path(), arguments), parts);
        assert_eq!(listing(folder.path()), before, "{arguments:?}");
    };
    check(&["hand.ghand"], &["no display", "--screenshot"]);
    check(&["missing.ghand", "--screenshot", "a.png"], &["missing.ghand"]);
    check(&["cut.ghand", "--screenshot", "a.png"], &["cut.ghand", "truncated"]);
    check(&["hand.ghand", "--screenshot", "a.png", "--pose", "salute"], &["salute", "thumbs-up"]);
    check(&["hand.ghand", "--screenshot", "a.png", "--adapter", "no such"], &["no such", "adapter"]);
    check(&["hand.ghand", "--screenshot", "a.png", "--size", "64"], &["--size"]);
    check(&["cut.ply", "--screenshot", "a.png"], &["cut.ply: data"]);
    check(&["empty.ply", "--screenshot", "a.png"], &["empty.ply: Gaussians"]);
    check(&["missing.ply", "--screenshot", "a.png"], &["missing.ply"]);
    check(&["ball.ply", "--screenshot", "a.png", "--pose", "fist"], &["--pose", "ball.ply", "scene"]);
    check(&["notes.txt", "--screenshot", "a.png"], &["notes.txt", ".ghand", ".ply", ".glb"]);
    check(&[".", "--screenshot", "a.png"], &["folder"]);
}

//! `viewer` as a user runs it, without a display.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking; clippy knows that only inside of #[test]")]

mod common;

use common::{assert_one_sentence, listing, run, save_avatar};

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
    let covered = places.len() as f64 / f64::from(380 * 480);
    assert!((0.05..0.7).contains(&covered), "the hand covers {covered} of its panel");
    assert!(places.iter().all(|x| *x >= 260), "the hand is drawn over the panel");
    let text = picture.enumerate_pixels().filter(|(x, _, p)| *x < 260 && p.0[0] > 140).count();
    assert!(text > 500, "the panel is empty: {text} bright pixels");
}

#[test]
fn without_an_avatar_the_last_trained_one_is_shown_else_a_bare_hand() {
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
    let before = listing(folder.path());
    let check = |arguments: &[&str], parts: &[&str]| {
        assert_one_sentence(&run(VIEWER, folder.path(), arguments), parts);
        assert_eq!(listing(folder.path()), before, "{arguments:?}");
    };
    check(&["hand.ghand"], &["no display", "--screenshot"]);
    check(&["missing.ghand", "--screenshot", "a.png"], &["missing.ghand"]);
    check(&["cut.ghand", "--screenshot", "a.png"], &["cut.ghand", "cut short"]);
    check(&["hand.ghand", "--screenshot", "a.png", "--pose", "salute"], &["salute", "thumbs-up"]);
    check(&["hand.ghand", "--screenshot", "a.png", "--adapter", "no such"], &["no such", "adapter"]);
    check(&["hand.ghand", "--screenshot", "no/a.png", "--size", "64x64"], &["no/a.png"]);
    check(&["hand.ghand", "--screenshot", "a.png", "--size", "64"], &["--size"]);
}

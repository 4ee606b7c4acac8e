//! `ghand bake`, and what else does with a baked avatar.

use std::path::Path;

use crate::common::{assert_one_sentence, listing, run, save_avatar};
use ghand_avatar::deform::baked::Precision;
use ghand_avatar::{Avatar, Bake, PropertyTables};
use ghand_core::Pose;
use ghand_motion::motions::motion;
use ghand_render::{AdapterChoice, Gpu};
use ghand_test_support::long;

const GHAND: &str = env!("CARGO_BIN_EXE_ghand");

/// Saves an avatar whose shape and colour depend on the pose.
fn save_moving_avatar(folder: &Path) {
    let path = save_avatar(folder);
    let mut avatar = Avatar::load(&path).unwrap();
    let PropertyTables::Direct(tables) = &mut avatar.tables else { unreachable!() };
    let wave = |k: usize| (k as f32 * 0.37).sin();
    tables.shape_basis.iter_mut().enumerate().for_each(|(k, v)| *v += 0.002 * wave(k));
    tables.response.iter_mut().enumerate().for_each(|(k, v)| *v += 0.3 * wave(3 * k + 1));
    tables.appearance.iter_mut().enumerate().for_each(|(k, v)| *v += 0.2 * wave(k / 7));
    avatar.save(&path).unwrap();
}

fn bake(folder: &Path, arguments: &[&str]) -> std::process::Output {
    run(GHAND, folder, &[&["bake", "hand.ghand"], arguments].concat())
}

#[test]
fn an_avatar_is_baked_within_a_loss_and_drawn_like_it() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    save_moving_avatar(folder);
    let output = bake(folder, &["--out", "small.ghand", "--fit", "40", "--max-loss-db", "0.2"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let wanted = ["hand.ghand", "small.ghand", "small.json", "small.loss.png", "small.worst.png"];
    assert_eq!(listing(folder), wanted);
    let report: serde_json::Value = serde_json::from_slice(&std::fs::read(folder.join("small.json")).unwrap()).unwrap();
    let loss = report["loss"]["db"].as_f64().unwrap();
    assert!((0.0..=0.2).contains(&loss), "{loss}");
    let bytes = std::fs::metadata(folder.join("small.ghand")).unwrap().len();
    assert_eq!(report["bytes"].as_u64(), Some(bytes));
    assert!(bytes < std::fs::metadata(folder.join("hand.ghand")).unwrap().len() / 2, "{bytes}");
    let [kept, all] = [0, 1].map(|i| report["blocks"][i].as_u64().unwrap());
    assert!(kept > 0 && kept < all, "{kept} of {all} blocks");
    assert!(report["worst_pose"]["largest_mm"].as_f64().unwrap() > 0.0);

    // The programs take it as any avatar.
    for (avatar, out) in [("hand.ghand", "a.png"), ("small.ghand", "b.png")] {
        let arguments = ["render", avatar, "--pose", "fist", "--turntable", "1", "--size", "120x160", "--out", out];
        let output = run(GHAND, folder, &arguments);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    }
    let [a, b] = ["a.png", "b.png"].map(|name| image::open(folder.join(name)).unwrap().into_rgb8());
    let squares = a.as_raw().iter().zip(b.as_raw()).map(|(a, b)| (f64::from(*a) - f64::from(*b)).powi(2)).sum::<f64>();
    let psnr = -10.0 * (squares / a.as_raw().len() as f64 / 255.0f64.powi(2)).log10();
    assert!((38.0..90.0).contains(&psnr), "{psnr} dB");
    let output = run(GHAND, folder, &["inspect", "small.ghand"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let again = run(GHAND, folder, &["bake", "small.ghand", "--out", "y.ghand", "--fit", "40"]);
    assert_one_sentence(&again, &["small.ghand", "baked already"]);
}

#[test]
fn an_avatar_is_drawn_baked_and_baked_again_when_it_has_changed() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    save_moving_avatar(folder);
    let render = |out| {
        let arguments = ["render", "hand.ghand", "--baked", "--pose", "fist", "--turntable", "1", "--size", "60x80"];
        let output = run(GHAND, folder, &[&arguments[..], &["--out", out]].concat());
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        (String::from_utf8_lossy(&output.stdout).contains("baking"), std::fs::read(folder.join(out)).unwrap())
    };
    let (was_baked, first) = render("a.png");
    let baked = Avatar::load(&folder.join("hand.baked.ghand")).unwrap();
    assert!(was_baked && matches!(baked.tables, PropertyTables::Baked(_)));
    assert!(render("b.png") == (false, first));
    save_moving_avatar(folder);
    assert!(render("c.png").0);
}

#[test]
fn a_size_is_kept_and_the_same_seed_gives_the_same_file() {
    if !long() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    save_moving_avatar(folder);
    let arguments = |out| ["--out", out, "--fit", "40", "--max-mb", "0.25", "--precision", "f16"];
    for out in ["one.ghand", "two.ghand"] {
        let output = bake(folder, &arguments(out));
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    }
    let [one, two] = ["one.ghand", "two.ghand"].map(|name| std::fs::read(folder.join(name)).unwrap());
    assert!(one.len() <= 250_000 && one.len() > 150_000, "{}", one.len());
    assert!(one == two);
}

#[test]
fn what_cannot_be_baked_is_one_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    save_moving_avatar(folder);
    let few = ["--fit", "40"];
    let cases: [(&[&str], &[&str]); 6] = [
        (
            &["--out", "x.ghand", "--max-loss-db", "1e-9", "--rank", "1"],
            &["--max-loss-db", "cannot be reached", "the least loss is"],
        ),
        (&["--out", "x.ghand", "--max-mb", "0.001"], &["--max-mb 0.001", "too small", "without any component"]),
        (&["--out", "x.ghand", "--fit", "12"], &["too few", "--poses"]),
        (&["--out", "x.png"], &["--out x.png", ".ghand"]),
        (&["--out", "hand.ghand"], &["hand.ghand", "which this command reads"]),
        (&["--out", "hand.ghand/x.ghand"], &["--out hand.ghand/x.ghand", "cannot be written"]),
    ];
    for (arguments, parts) in cases {
        let with_few = if arguments.contains(&"--fit") { vec![] } else { few.to_vec() };
        let output = bake(folder, &[arguments, &with_few].concat());
        assert_one_sentence(&output, parts);
        assert_eq!(listing(folder), ["hand.ghand"], "{arguments:?}");
    }
}

#[test]
fn a_baked_avatar_shows_what_training_saw() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    save_moving_avatar(folder);
    let show = ["--show", "views", "--turntable", "1", "--size", "96x120"];
    let output = run(GHAND, folder, &[&["render", "hand.ghand", "--out", "a.png"][..], &show].concat());
    assert_one_sentence(&output, &["--show views", "train the avatar again"]);
    let mut avatar = Avatar::load(&folder.join("hand.ghand")).unwrap();
    avatar.seen = Some((0..avatar.template.len()).map(|p| 1.0 + (p % 7) as f32).collect());
    avatar.save(&folder.join("hand.ghand")).unwrap();
    let poses: Vec<Pose> =
        motion("tour", &avatar.model, 4.0).unwrap().unwrap().frames.into_iter().map(|f| f.pose).collect();
    let gpu = Gpu::new(&AdapterChoice::from_env()).unwrap();
    let bake = Bake::new(&gpu, &avatar, &poses, 3, |_| ()).unwrap();
    bake.avatar(bake.blocks(), Precision::U8).save(&folder.join("small.ghand")).unwrap();
    for (avatar, out) in [("hand.ghand", "a.png"), ("small.ghand", "b.png")] {
        let output = run(GHAND, folder, &[&["render", avatar, "--out", out][..], &show].concat());
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    }
    let [a, b] = ["a.png", "b.png"].map(|name| image::open(folder.join(name)).unwrap().into_rgb8());
    let difference: u64 = a.as_raw().iter().zip(b.as_raw()).map(|(a, b)| u64::from(a.abs_diff(*b))).sum();
    assert!(difference < 4 * a.as_raw().len() as u64, "{difference}");
    assert!(a.pixels().any(|p| p.0[1] > p.0[0] + 40), "green is seen often");
}

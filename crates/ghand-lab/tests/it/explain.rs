//! `ghand-lab explain` as a user runs it, on avatars whose properties are known.

use std::path::Path;

use crate::common::{assert_one_sentence, listing, run, save_avatar};
#[cfg(feature = "networks")]
use ghand_avatar::NetworkSizes;
use ghand_avatar::deform::baked::Precision;
use ghand_avatar::{Avatar, AvatarConfig, Bake, PropertyTables};
use ghand_core::Pose;
use ghand_core::residual_skeleton::ResidualSkeleton;
use ghand_core::skinning::ResidualWeights;
use ghand_files::claim::Claim;
use ghand_render::{AdapterChoice, Gpu};
use ghand_test_support::procedural_hand::ProceduralHand;
use glam::DVec3;
use serde_json::Value;

const LAB: &str = env!("CARGO_BIN_EXE_ghand-lab");
/// Bases of the planted avatar; its second one is known.
const BASES: usize = 2;
/// The joint with a residual weight.
const JOINT: usize = 5;

/// Writes an avatar with a second basis of 3 mm at one Gaussian, 1 mm elsewhere, whose coefficient is -2 at rest and in
/// every pose; and, if `residual`, a residual weight of 0.25 of one joint, whose residual joint is 4 mm away.
fn save_planted(folder: &Path, residual: bool) -> Avatar {
    let model = ProceduralHand { detail: 1, ..Default::default() }.build().unwrap();
    let config = AvatarConfig {
        uv_resolution: 48,
        shape_bases: BASES,
        residual_weights: ResidualWeights::Paper,
        residual_skeleton: ResidualSkeleton::Anchored,
        ..Default::default()
    };
    let mut avatar = Avatar::untrained(&model, &config, [0.8, 0.6, 0.5], 0).unwrap();
    let n = avatar.template.len();
    let PropertyTables::Direct(tables) = &mut avatar.tables else { unreachable!() };
    tables.shape_basis.fill(0.0);
    tables.shape_basis[3 * n..4 * n].fill(0.001);
    tables.shape_basis[3 * n] = 0.003;
    tables.response.fill(0.0);
    tables.response[1] = -2.0;
    if residual {
        tables.residual_weights[JOINT * n..(JOINT + 1) * n].fill(0.25);
        // The offset of Gaussian 0 is -6 mm along x.
        tables.regressor[JOINT * n] = -2.0 / 3.0;
    }
    avatar.save(&folder.join("planted.ghand")).unwrap();
    avatar
}

fn explain(folder: &Path, arguments: &[&str]) -> Value {
    let output = run(LAB, folder, &[&["explain"], arguments].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let out = arguments.iter().skip_while(|a| **a != "--out").nth(1).unwrap();
    serde_json::from_slice(&std::fs::read(folder.join(out).join("explain.json")).unwrap()).unwrap()
}

#[track_caller]
fn assert_near(value: &Value, expected: f64) {
    let value = value.as_f64().unwrap();
    assert!((value - expected).abs() < 1e-4 * expected.abs().max(1e-3), "{value} instead of {expected}");
}

#[test]
fn the_numbers_are_those_of_a_planted_avatar() {
    let folder = tempfile::tempdir().unwrap();
    let avatar = save_planted(folder.path(), true);
    let n = avatar.template.len() as f64;
    let report = explain(folder.path(), &["planted.ghand", "--out", "out"]);
    assert_eq!((&report["model"], &report["gaussians"]), (&Value::from("direct"), &Value::from(n as u64)));
    let bases = report["shape_bases"].as_array().unwrap();
    assert_eq!(bases.len(), BASES);
    assert_near(&bases[0]["max_length_mm"], 0.0);
    assert_near(&bases[1]["max_length_mm"], 3.0);
    assert_near(&bases[1]["mean_length_mm"], 1.0 + 2.0 / n);
    assert_near(&bases[1]["largest_coefficient"], 2.0);
    assert_near(&bases[1]["max_motion_over_poses_mm"], 0.0);
    assert!(report["most_pose_dependent_basis"].is_null());
    let coefficients = report["coefficients"].as_array().unwrap();
    assert_eq!(coefficients.len(), BASES * 12);
    for c in coefficients {
        let expected = if c["basis"] == 2 { -2.0 } else { 0.0 };
        ["mean", "min", "max"].iter().for_each(|key| assert_near(&c[*key], expected));
        assert_near(&c["standard_deviation"], 0.0);
    }
    let weights = report["residual_weights"].as_array().unwrap();
    assert_eq!(weights.len(), 1);
    assert_eq!(weights[0]["joint"], avatar.template.joint_names[JOINT].as_str());
    [("min", 0.25), ("max", 0.25), ("mean_size", 0.25)].iter().for_each(|(key, v)| assert_near(&weights[0][*key], *v));
    let skeleton = &report["residual_skeleton"];
    let joints = skeleton["joints"].as_array().unwrap();
    for (k, joint) in joints.iter().enumerate() {
        assert_near(&joint["offset_mm"], if k == JOINT { 4.0 } else { 0.0 });
    }
    // At rest every residual bone is the identity: a weight of a quarter moves each point by a quarter of its place.
    let rest = &report["moved_by_residual_terms"][0];
    let at = |p: usize| {
        let c = |c: usize| f64::from(avatar.template.rest[c * avatar.template.len() + p]);
        let offset = if p == 0 { -0.006 } else { -0.002 };
        250.0 * (c(0) + offset).hypot(c(1)).hypot(c(2))
    };
    let farthest = (0..avatar.template.len()).map(at).fold(0.0, f64::max);
    assert_eq!(rest["pose"], "rest");
    assert_near(&rest["max_mm"], farthest);

    let names = listing(&folder.path().join("out"));
    let pictures: Vec<&str> = report["pictures"].as_array().unwrap().iter().map(|p| p.as_str().unwrap()).collect();
    let mut expected = [&pictures[..], &["explain.json", "explain.png"]].concat();
    expected.sort_unstable();
    assert_eq!(names, expected);
    assert!(pictures.contains(&"basis-2.png") && pictures.contains(&"residual-skeleton.png"), "{pictures:?}");
    for name in names.iter().filter(|name| name.ends_with(".png")) {
        let picture = image::open(folder.path().join("out").join(name)).unwrap().into_rgb8();
        let drawn = picture.pixels().filter(|p| p.0 != [255; 3]).count();
        assert!(drawn > 2000, "{name} has only {drawn} pixels");
    }
}

#[test]
fn an_avatar_without_residual_terms_says_so_and_has_no_such_pictures() {
    let folder = tempfile::tempdir().unwrap();
    save_planted(folder.path(), false);
    let report = explain(folder.path(), &["planted.ghand", "--out", "out"]);
    assert!(report["residual_weights"].as_array().unwrap().is_empty() && report["residual_skeleton"].is_null());
    for pose in report["moved_by_residual_terms"].as_array().unwrap() {
        assert_near(&pose["max_mm"], 0.0);
    }
    let names = listing(&folder.path().join("out"));
    assert!(names.iter().all(|name| !name.contains("residual") && !name.contains("skinning")), "{names:?}");
}

#[cfg(feature = "networks")]
#[test]
fn networks_with_three_numbers_per_coefficient_and_poses_of_a_motion_are_explained() {
    let folder = tempfile::tempdir().unwrap();
    let model = ProceduralHand { detail: 1, ..Default::default() }.build().unwrap();
    let config = AvatarConfig {
        uv_resolution: 32,
        shape_bases: 3,
        coefficients: ghand_core::blend_shapes::CoefficientLayout::PerComponent,
        network: Some(NetworkSizes::quick()),
        ..Default::default()
    };
    Avatar::untrained(&model, &config, [0.5; 3], 0).unwrap().save(&folder.path().join("net.ghand")).unwrap();
    let report = explain(folder.path(), &["net.ghand", "--poses", "grasp", "--fps", "2", "--out", "a/b"]);
    assert_eq!(report["model"], "network");
    let poses = report["poses"].as_array().unwrap().len();
    assert!((2..=24).contains(&poses));
    assert_eq!(report["coefficients"].as_array().unwrap().len(), 3 * poses);
}

fn baked(avatar: &Avatar) -> Avatar {
    let gpu = Gpu::new(&AdapterChoice::from_env()).unwrap();
    let joints = avatar.template.joint_count();
    let bent = |k: usize| {
        let mut pose = Pose::rest(joints);
        pose.rotations[1 + k % (joints - 1)] = DVec3::splat(0.01 * (k + 1) as f64);
        pose
    };
    let poses: Vec<Pose> = (0..40).map(bent).collect();
    Bake::new(&gpu, avatar, &poses, 3, |_| ()).unwrap().avatar(3, Precision::U8)
}

#[test]
fn bad_input_is_one_sentence_and_nothing_is_overwritten_without_force() {
    let folder = tempfile::tempdir().unwrap();
    save_avatar(folder.path());
    std::fs::write(folder.path().join("text.ghand"), b"not an avatar").unwrap();
    std::fs::write(folder.path().join("file"), b"").unwrap();
    std::fs::create_dir(folder.path().join("used")).unwrap();
    std::fs::write(folder.path().join("used/explain.json"), b"mine").unwrap();
    std::fs::create_dir(folder.path().join("late")).unwrap();
    std::fs::write(folder.path().join("late/basis-1.png"), b"mine").unwrap();
    let before = listing(folder.path());
    let check = |arguments: &[&str], parts: &[&str]| {
        assert_one_sentence(&run(LAB, folder.path(), &[&["explain"], arguments].concat()), parts);
        assert_eq!(listing(folder.path()), before, "{arguments:?}");
    };
    check(&["missing.ghand", "--out", "out"], &["missing.ghand"]);
    check(&["text.ghand", "--out", "out"], &["text.ghand"]);
    check(&["hand.ghand", "--out", "file"], &["--out file", "not a folder"]);
    check(&["hand.ghand", "--out", "used"], &["used/explain.json", "--force"]);
    check(&["hand.ghand", "--out", "out", "--poses", "salute"], &["salute", "fist"]);
    check(&["hand.ghand", "--out", "out", "--poses", "none.json"], &["none.json"]);
    check(&["hand.ghand", "--out", "late"], &["late/basis-1.png", "--force"]);
    check(&["hand.ghand", "--out", "out", "--take", "1"], &["--take"]);
    let baked = baked(&Avatar::load(&folder.path().join("hand.ghand")).unwrap());
    baked.save(&folder.path().join("late/baked.ghand")).unwrap();
    check(&["late/baked.ghand", "--out", "out"], &["baked.ghand", "is baked"]);
    std::fs::remove_file(folder.path().join("late/baked.ghand")).unwrap();
    let claim = Claim::folder(&folder.path().join("late")).unwrap();
    check(&["hand.ghand", "--out", "late", "--force"], &["late: another command is writing there"]);
    drop(claim);
    assert_eq!(std::fs::read(folder.path().join("used/explain.json")).unwrap(), b"mine");
    assert_eq!(listing(&folder.path().join("late")), ["basis-1.png"]);
    explain(folder.path(), &["hand.ghand", "--out", "used", "--force"]);
}

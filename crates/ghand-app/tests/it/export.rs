//! `ghand export`: what other programs find in its files, and ghand itself.

use std::path::Path;

use crate::common::{assert_one_sentence, listing, run, save_avatar};
use ghand_avatar::scene_files::SplatScene;
use ghand_avatar::{Avatar, PropertyTables};
use ghand_core::posing::pose_hand;
use ghand_motion::PoseFrame;
use glam::{DQuat, DVec3};

const GHAND: &str = env!("CARGO_BIN_EXE_ghand");
const VIEWER: &str = env!("CARGO_BIN_EXE_viewer");

fn said(folder: &Path, arguments: &[&str]) -> String {
    let output = run(GHAND, folder, arguments);
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// The JSON and the buffer of a binary glTF file.
fn parts(path: &Path) -> (serde_json::Value, Vec<u8>) {
    let bytes = std::fs::read(path).unwrap();
    let json = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    (serde_json::from_slice(&bytes[20..20 + json]).unwrap(), bytes[28 + json..].to_vec())
}

#[test]
fn an_avatars_glb_has_a_skin_a_pose_and_motions() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    save_avatar(folder);
    let text = said(
        folder,
        &[
            "export",
            "hand.ghand",
            "--out",
            "a.glb",
            "--pose",
            "fist",
            "--motion",
            "wave",
            "--pose",
            "count",
            "--texture",
            "256",
            "--joint-names",
            "openxr",
        ],
    );
    assert!(text.contains("a texture of 256 texels, 2 motions"), "{text}");
    let (json, buffer) = parts(&folder.join("a.glb"));
    let names = |list: &str| -> Vec<&str> {
        json[list].as_array().unwrap().iter().map(|item| item["name"].as_str().unwrap()).collect()
    };
    assert_eq!(names("animations"), ["wave", "count"]);
    assert!(names("nodes").contains(&"XR_HAND_JOINT_INDEX_PROXIMAL_EXT"));
    // It opens in the fist: fingers are turned.
    assert!(
        json["nodes"].as_array().unwrap().iter().filter(|node| node["rotation"][3].as_f64() < Some(0.99)).count() > 8
    );
    // An avatar without a light has its colours as they are.
    assert!(json["materials"][0]["extensions"]["KHR_materials_unlit"].is_object());
    let view = &json["bufferViews"][json["images"][0]["bufferView"].as_u64().unwrap() as usize];
    let [begin, length] = ["byteOffset", "byteLength"].map(|name| view[name].as_u64().unwrap() as usize);
    let picture = image::load_from_memory(&buffer[begin..begin + length]).unwrap().into_rgb8();
    assert_eq!(picture.dimensions(), (256, 256));
    // All of one colour, as the avatar is, also beyond the charts.
    let [low, high] = [u8::min, u8::max].map(|f| picture.pixels().map(|p| p.0[0]).reduce(f).unwrap());
    assert!(high - low <= 1, "{low} to {high}");
    // ghand reads it as the hand that it is.
    assert!(said(folder, &["inspect", "a.glb"]).contains("XR_HAND_JOINT_INDEX_PROXIMAL_EXT"));
}

#[test]
fn ghand_plays_a_glb_with_gaussians_as_the_avatar_itself() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    save_avatar(folder);
    let text = said(folder, &["export", "hand.ghand", "--out", "a.glb", "--gaussians", "--texture", "256"]);
    assert!(text.contains("baking hand.ghand") && text.contains(" Gaussians, "), "{text}");
    let same = ["a.glb", "hand.baked.ghand"].map(|name| Avatar::load(&folder.join(name)).unwrap());
    assert!(same[0] == same[1] && matches!(same[0].tables, PropertyTables::Baked(_)));
    for (avatar, out) in [("hand.baked.ghand", "a.png"), ("a.glb", "b.png")] {
        said(folder, &["render", avatar, "--pose", "fist", "--turntable", "1", "--size", "90x90", "--out", out]);
    }
    let [a, b] = ["a.png", "b.png"].map(|name| std::fs::read(folder.join(name)).unwrap());
    assert_eq!(a, b);
    let described = said(folder, &["inspect", "a.glb"]);
    assert!(described.starts_with("a.glb: avatar of"), "{described}");
    // The window shows the file's name.
    let window = |avatar: &str, place: &str| {
        let place = folder.join(place);
        std::fs::create_dir(&place).unwrap();
        std::fs::copy(folder.join(avatar), place.join("hand.bin")).unwrap();
        let output = run(VIEWER, &place, &["hand.bin", "--size", "400x300", "--screenshot", "window.png"]);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        image::open(place.join("window.png")).unwrap().into_rgb8()
    };
    assert!(window("hand.baked.ghand", "c") == window("a.glb", "d"));
    // A file that is cut off is not an avatar any more, nor a hand.
    let whole = std::fs::read(folder.join("a.glb")).unwrap();
    std::fs::write(folder.join("cut.glb"), &whole[..whole.len() / 2]).unwrap();
    assert_one_sentence(&run(GHAND, folder, &["inspect", "cut.glb"]), &["cut.glb"]);
}

#[test]
fn a_motion_becomes_numbered_scenes_and_spz_has_the_same_gaussians() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    save_avatar(folder);
    let text = said(folder, &["export", "hand.ghand", "--motion", "wave", "--fps", "2", "--out", "w.ply"]);
    let frames = listing(folder).iter().filter(|name| name.starts_with("w-")).count();
    assert!(
        frames > 2 && text.starts_with("w-0000.ply to w-00") && text.contains(&format!("{frames} frames")),
        "{text}"
    );
    assert!(!folder.join("w.ply").exists());
    let scene = |name: &str| SplatScene::read(&folder.join(name)).unwrap();
    assert!(scene("w-0000.ply").table != scene("w-0001.ply").table);
    let one = ["export", "hand.ghand", "--motion", "wave", "--fps", "2", "--frame", "1"];
    said(folder, &[&one[..], &["--out", "one.ply", "--sh-degree", "3"]].concat());
    let padded = scene("one.ply");
    assert_eq!((padded.degree, padded.with_degree(0)), (3, scene("w-0001.ply")));
    said(folder, &[&one[..], &["--out", "one.SPZ"]].concat());
    let small = scene("one.SPZ");
    assert_eq!(small.count, padded.count);
    let far = small.means().zip(padded.means()).map(|(a, b)| a.distance(b)).fold(0.0, f64::max);
    assert!(far < 2e-6, "{far} m");
    let [own, zipped] = ["one.ply", "one.SPZ"].map(|name| std::fs::metadata(folder.join(name)).unwrap().len());
    assert!(zipped * 4 < own, "{zipped} of {own} bytes");
}

#[test]
fn a_page_for_spark_has_splats_bones_and_a_motion() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    save_avatar(folder);
    let text = said(folder, &["export", "hand.ghand", "--spark", "page", "--fps", "5", "--motion", "count"]);
    assert!(text.starts_with("page/index.html: ") && text.contains(" dB from ghand's pictures"), "{text}");
    assert_eq!(listing(&folder.join("page")), ["bones.bin", "hand.ply", "index.html", "motion.json"]);
    let read = |name: &str| std::fs::read(folder.join("page").join(name)).unwrap();
    let avatar = Avatar::load(&folder.join("hand.ghand")).unwrap();
    let n = avatar.template.len();
    assert_eq!(SplatScene::read(&folder.join("page/hand.ply")).unwrap().count, n);
    let bones = read("bones.bin");
    assert_eq!(bones.len(), 8 * n);
    for splat in bones.chunks_exact(8) {
        assert!(splat[..4].iter().all(|bone| usize::from(*bone) < avatar.template.joint_count()));
        assert_eq!(splat[4..].iter().map(|weight| u32::from(*weight)).sum::<u32>(), 255);
    }
    let motion: serde_json::Value = serde_json::from_slice(&read("motion.json")).unwrap();
    assert_eq!(motion["fps"], 5.0);
    assert_eq!(motion["bones"].as_array().unwrap().len(), avatar.template.joint_count());
    // A bone takes its joint to where the pose has it.
    let frames: Vec<Vec<[f64; 7]>> = serde_json::from_value(motion["frames"].clone()).unwrap();
    let poses = ghand_motion::motions::motion("count", &avatar.model, 5.0).unwrap().unwrap().frames;
    assert!(frames.len() > 10 && frames.len() == poses.len());
    for (frame, PoseFrame { pose, .. }) in frames.iter().zip(&poses) {
        let posed = pose_hand(&avatar.model, &[], pose).unwrap();
        for (k, [x, y, z, w, shift @ ..]) in frame.iter().enumerate() {
            let place = DQuat::from_xyzw(*x, *y, *z, *w) * avatar.model.joints[k] + DVec3::from(*shift);
            assert!(place.distance(posed.joints[k]) < 1e-6, "bone {k}: {place}, not {}", posed.joints[k]);
        }
    }
    let page = String::from_utf8(read("index.html")).unwrap();
    assert!(["hand.ply", "bones.bin", "motion.json", "SplatSkinning"].iter().all(|part| page.contains(part)));
}

#[test]
fn what_a_format_does_not_have_is_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    save_avatar(folder);
    std::fs::write(folder.join("file"), "").unwrap();
    let before = listing(folder);
    for (line, expected) in [
        ("hand.ghand --out a.usdz", "a.usdz: must end in one of .glb, .ply, .spz"),
        ("hand.ghand --out a.ply --gaussians", "--gaussians: means nothing for .ply"),
        ("hand.ghand --out a.spz --sh-degree 3", "--sh-degree: means nothing for .spz"),
        ("hand.ghand --out a.glb --sh-degree 1", "--sh-degree: means nothing for .glb"),
        ("hand.ghand --out a.ply --texture 512", "--texture: means nothing for .ply"),
        ("hand.ghand --spark page --joint-names webxr", "--joint-names: means nothing for --spark"),
        ("hand.ghand --out a.glb --texture 1000", "must be 256, 512"),
        ("hand.ghand --out a.glb --pose fist --pose open", "--pose open: a second pose"),
        ("hand.ghand --out a.ply --pose fist --pose open", "--pose open: a second pose"),
        ("hand.ghand --out a.glb --pose salute", "salute"),
        ("hand.ghand --out a.glb --spark page", "--spark"),
        ("hand.ghand --spark file", "--spark file: is a file"),
        ("builtin --out a.ply", "builtin: is a hand model, which has no Gaussians"),
        ("builtin --spark page", "builtin: is a hand model, which has no Gaussians"),
        ("builtin --out a.glb --gaussians", "--gaussians: builtin is a hand model"),
        ("builtin --out a.glb --texture 512", "--texture: builtin is a hand model"),
        ("builtin --out a.glb --pose fist", "--pose: builtin is a hand model"),
    ] {
        let words: Vec<&str> = ["export"].into_iter().chain(line.split_whitespace()).collect();
        assert_one_sentence(&run(GHAND, folder, &words), &[expected]);
    }
    assert_eq!(listing(folder), before);
}

/// The bytes of the first data address of a kind in a page.
fn inside(page: &str, kind: &str) -> Vec<u8> {
    use base64::Engine;
    let (_, rest) = page.split_once(&format!("data:{kind};base64,")).unwrap();
    let text: String = rest.chars().take_while(|c| c.is_ascii_alphanumeric() || "+/=".contains(*c)).collect();
    base64::engine::general_purpose::STANDARD.decode(text).unwrap()
}

#[test]
fn a_page_has_avatar_motion_picture_and_player_inside() {
    use std::io::Read;
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    save_avatar(folder);
    said(folder, &["export", "hand.ghand", "--pose", "count", "--out", "count.html"]);
    let page = std::fs::read_to_string(folder.join("count.html")).unwrap();
    assert!(page.contains(r#"motion="count""#) && page.contains("<ghand-avatar"), "{}", &page[..400]);
    assert_eq!(inside(&page, "application/octet-stream"), std::fs::read(folder.join("hand.ghand")).unwrap());
    let mut wasm = Vec::new();
    flate2::read::GzDecoder::new(&inside(&page, "application/gzip")[..]).read_to_end(&mut wasm).unwrap();
    assert!(wasm.starts_with(b"\0asm"));
    let poster = image::load_from_memory(&inside(&page, "image/png")).unwrap().into_rgb8();
    let background = *poster.get_pixel(0, 0);
    assert!(poster.pixels().filter(|pixel| **pixel != background).count() > 20_000, "the picture is empty");
    // No other file is named: each address is inside.
    assert!(!page.contains(r#"src="ghand-avatar.js""#) && page.matches("<script").count() == 2);
    // A file of poses is inside, too.
    said(folder, &["pose", "--pose", "wave", "--for", "hand.ghand", "--out", "wave.json"]);
    said(folder, &["export", "hand.ghand", "--pose", "wave.json", "--out", "wave.html"]);
    let page = std::fs::read_to_string(folder.join("wave.html")).unwrap();
    let poses: serde_json::Value = serde_json::from_slice(&inside(&page, "application/json")).unwrap();
    assert!(poses["frames"].as_array().unwrap().len() > 10);
    let refused = run(GHAND, folder, &["export", "hand.ghand", "--texture", "512", "--out", "a.html"]);
    assert_one_sentence(&refused, &["--texture", ".html"]);
    assert!(!listing(folder).contains(&"a.html".to_owned()));
}

use std::path::Path;

use ghand_hand_model::files::rigged_glb::RiggedHand;
use ghand_test_support::procedural_hand::ProceduralHand;

use super::*;
use crate::template::{AvatarConfig, GaussianShape};

fn avatar() -> Avatar {
    let model = ProceduralHand { detail: 1, ..Default::default() }.build().unwrap();
    let config = AvatarConfig { uv_resolution: 48, gaussians: GaussianShape::Flat, ..Default::default() };
    Avatar::untrained(&model, &config, [0.8, 0.5, 0.4], 3).unwrap()
}

fn glb(avatar: &Avatar) -> Vec<u8> {
    let mut document = RiggedHand::default().document(&avatar.model).unwrap();
    add_gaussians(&mut document, avatar).unwrap();
    document.finish().unwrap()
}

#[test]
fn ghand_reads_the_avatar_itself_back() {
    let avatar = avatar();
    let bytes = glb(&avatar);
    assert_eq!(Avatar::from_bytes(Path::new("a.glb"), &bytes).unwrap(), avatar);
    assert!(holds_avatar(&bytes[..]) && !holds_avatar(&bytes[..bytes.len().min(400)]));
    assert!(!holds_avatar(&RiggedHand::default().document(&avatar.model).unwrap().finish().unwrap()[..]));
}

#[test]
fn another_reader_finds_the_gaussians_and_shows_the_hand_first() {
    let avatar = avatar();
    let bytes = glb(&avatar);
    // Its validation does not know attributes of extensions.
    let file = gltf::Gltf::from_slice_without_validation(&bytes).unwrap();
    let blob = file.blob.clone().unwrap();
    let shown = file.default_scene().unwrap();
    assert!(shown.nodes().any(|node| node.skin().is_some()) && shown.nodes().all(|n| n.name() != Some("gaussians")));
    let mesh = file.scenes().nth(1).unwrap().nodes().next().unwrap().mesh().unwrap();
    let primitive = mesh.primitives().next().unwrap();
    assert_eq!(primitive.mode(), gltf::mesh::Mode::Points);
    let json: Value = serde_json::from_slice(&bytes[20..20 + word(&bytes, 12)]).unwrap();
    let raw = &json["meshes"][1]["primitives"][0];
    assert_eq!(raw["extensions"]["KHR_gaussian_splatting"]["colorSpace"], "srgb_rec709_display");
    let numbers = |name: &str| -> Vec<f32> {
        let accessor = &json["accessors"][raw["attributes"][name].as_u64().unwrap() as usize];
        let view = &json["bufferViews"][accessor["bufferView"].as_u64().unwrap() as usize];
        let [begin, length] = ["byteOffset", "byteLength"].map(|name| view[name].as_u64().unwrap() as usize);
        bytemuck::pod_collect_to_vec(&blob[begin..begin + length])
    };
    let scene = PosedHand::splats_on_host(&avatar, &Pose::rest(avatar.model.joint_count())).unwrap();
    let n = scene.count;
    let reader = primitive.reader(|_| Some(&blob[..]));
    assert!(
        reader
            .read_positions()
            .unwrap()
            .zip(scene.means())
            .all(|(p, q)| { DVec3::from(p.map(f64::from)).distance(q) < 1e-9 })
    );
    let scales = numbers("KHR_gaussian_splatting:SCALE");
    let rotations = numbers("KHR_gaussian_splatting:ROTATION");
    assert_eq!((scales.len(), rotations.len()), (3 * n, 4 * n));
    assert_eq!(numbers("KHR_gaussian_splatting:OPACITY").len(), n);
    let normals = avatar.template.normals.as_ref().unwrap();
    for i in 0..n {
        let [x, _, z] = [0, 1, 2].map(|k| scales[3 * i + k]);
        assert!((z / x - 0.2).abs() < 1e-5 && (1e-4..1e-2).contains(&x), "{x} {z}");
        let rotation = glam::Quat::from_slice(&rotations[4 * i..4 * i + 4]);
        let thin = rotation * glam::Vec3::Z;
        let normal = glam::Vec3::from([0, 1, 2].map(|c| normals[c * n + i]));
        assert!(rotation.is_normalized() && thin.distance(normal) < 1e-4);
    }
    let weights: Vec<[f32; 4]> = reader.read_weights(0).unwrap().into_f32().collect();
    assert!(weights.len() == n && weights.iter().all(|w| (w.iter().sum::<f32>() - 1.0).abs() < 1e-5));
}

fn word(bytes: &[u8], at: usize) -> usize {
    u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize
}

#[test]
fn damaged_files_are_errors_of_one_sentence() {
    let good = glb(&avatar());
    let error = |bytes: &[u8]| {
        let message = Avatar::from_bytes(Path::new("a.glb"), bytes).unwrap_err().to_string();
        assert!(message.starts_with("a.glb: ") && !message.contains('\n'), "{message}");
        message
    };
    for length in [4, 11, 19, 30, 200] {
        assert!(error(&good[..length]).contains("truncated"));
    }
    assert!(error(&good[..good.len() - 5000]).contains("GHAND_gaussian_avatar"));
    let replaced = |from: &str, to: &str| {
        assert_eq!(from.len(), to.len());
        let at = good.windows(from.len()).position(|part| part == from.as_bytes()).unwrap();
        [&good[..at], to.as_bytes(), &good[at + from.len()..]].concat()
    };
    assert!(error(&replaced("\"GHAND_gaussian_avatar\":{", "\"GHAND_gaussian_other1\":{")).contains("is missing"));
    assert!(error(&replaced("\"version\":1", "\"version\":7")).contains("its version is 7, not 1"));
    // The bytes of the avatar are not an avatar any more.
    let mut broken = good.clone();
    let length = broken.len();
    broken[length - 40_000..].fill(0x7f);
    error(&broken);
}

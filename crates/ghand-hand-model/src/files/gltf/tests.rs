mod hands;
mod shapes;
mod skinning;
mod storage;

use std::path::PathBuf;

use ghand_test_support::shared;

use super::webxr::WEBXR_JOINTS;
use super::*;

/// The generic hand, if it is beside the checkout.
fn generic_hand(file: &str) -> Option<PathBuf> {
    shared(&format!("assets/generic-hand/{file}"))
}

/// A chain of three joints (stored child first, with a plain node between) that moves one square, split into two
/// triangles each with its own UV vertices.
struct SmallHand {
    json: String,
    bytes: Vec<u8>,
}

impl SmallHand {
    fn new() -> SmallHand {
        let mut bytes: Vec<u8> = Vec::new();
        let floats = |bytes: &mut Vec<u8>, values: &[f32]| bytes.extend(values.iter().flat_map(|v| v.to_le_bytes()));
        let corners = [[0., 0., 0.], [1., 0., 0.], [1., 1., 0.], [0., 0., 0.], [1., 1., 0.], [0., 1., 0.]];
        floats(&mut bytes, &corners.concat());
        let uvs = [[0., 0.], [0.4, 0.], [0.4, 0.4], [0.5, 0.5], [0.9, 0.9], [0.5, 0.9]];
        floats(&mut bytes, &uvs.concat());
        for k in 0..6 {
            // Corners 0 and 3 are the same point with different weights.
            bytes.extend(if k == 3 { [1u8, 2, 0, 0] } else { [2u8, 0, 0, 0] });
        }
        for k in 0..6 {
            floats(&mut bytes, &if k == 3 { [0.5, 1.5, 0.0, 0.0] } else { [1.0, 0.0, 0.0, 0.0] });
        }
        for x in [3.0, 2.0, 1.0] {
            let matrix: [f32; 16] = [1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0., -x, 0., 0., 1.];
            floats(&mut bytes, &matrix);
        }
        let json = format!(
            r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0,4]}}],
            "nodes":[{{"mesh":0,"skin":0,"name":"hand_L"}},{{"name":"tip","translation":[1,0,0]}},
                     {{"name":"middle","children":[1],"translation":[1,0,0]}},
                     {{"name":"between","children":[2]}},{{"name":"root","children":[3],"translation":[1,0,0]}}],
            "skins":[{{"joints":[1,2,4],"inverseBindMatrices":4}}],
            "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0,"TEXCOORD_0":1,"JOINTS_0":2,"WEIGHTS_0":3}}}}]}}],
            "buffers":[{{"byteLength":{}}}],
            "bufferViews":[{{"buffer":0,"byteOffset":0,"byteLength":72}},{{"buffer":0,"byteOffset":72,"byteLength":48}},
                {{"buffer":0,"byteOffset":120,"byteLength":24}},{{"buffer":0,"byteOffset":144,"byteLength":96}},
                {{"buffer":0,"byteOffset":240,"byteLength":192}}],
            "accessors":[{{"bufferView":0,"componentType":5126,"count":6,"type":"VEC3","min":[0,0,0],"max":[1,1,0]}},
                {{"bufferView":1,"componentType":5126,"count":6,"type":"VEC2"}},
                {{"bufferView":2,"componentType":5121,"count":6,"type":"VEC4"}},
                {{"bufferView":3,"componentType":5126,"count":6,"type":"VEC4"}},
                {{"bufferView":4,"componentType":5126,"count":3,"type":"MAT4"}}]}}"#,
            bytes.len()
        );
        SmallHand { json, bytes }
    }

    fn replace(mut self, from: &str, to: &str) -> SmallHand {
        assert!(self.json.contains(from), "the fixture has no {from}");
        self.json = self.json.replace(from, to);
        self
    }

    /// With morph targets, as displacements of the six file vertices.
    fn with_targets(mut self, targets: &[[[f32; 3]; 6]]) -> SmallHand {
        let mut views = String::new();
        let mut accessors = String::new();
        let mut primitive = vec![];
        for (k, target) in targets.iter().enumerate() {
            views += &format!(r#",{{"buffer":0,"byteOffset":{},"byteLength":72}}"#, self.bytes.len());
            accessors += &format!(r#",{{"bufferView":{},"componentType":5126,"count":6,"type":"VEC3"}}"#, 5 + k);
            primitive.push(format!(r#"{{"POSITION":{}}}"#, 5 + k));
            self.bytes.extend(target.concat().iter().flat_map(|v| v.to_le_bytes()));
        }
        let length = format!(r#""byteLength":{}}}"#, self.bytes.len());
        let primitive = format!(r#""WEIGHTS_0":3}},"targets":[{}]"#, primitive.join(","));
        self.replace(r#""byteLength":432}"#, &length)
            .replace(r#""byteOffset":240,"byteLength":192}"#, &format!(r#""byteOffset":240,"byteLength":192}}{views}"#))
            .replace(r#""count":3,"type":"MAT4"}"#, &format!(r#""count":3,"type":"MAT4"}}{accessors}"#))
            .replace(r#""WEIGHTS_0":3}"#, &primitive)
    }

    /// With the given JSON as the extras of the mesh and of the skin.
    fn with_extras(self, mesh: &str, skin: &str) -> SmallHand {
        self.replace(r#""meshes":[{"#, &format!(r#""meshes":[{{"extras":{mesh},"#))
            .replace(r#""skins":[{"#, &format!(r#""skins":[{{"extras":{skin},"#))
    }

    fn put(mut self, offset: usize, value: f32) -> SmallHand {
        self.bytes[offset..offset + 4].copy_from_slice(&value.to_le_bytes());
        self
    }

    fn glb(&self) -> Vec<u8> {
        let mut json = self.json.clone().into_bytes();
        json.resize(json.len().next_multiple_of(4), b' ');
        let mut glb = b"glTF".to_vec();
        let number = |v: usize| (v as u32).to_le_bytes();
        glb.extend(number(2));
        glb.extend(number(28 + json.len() + self.bytes.len()));
        glb.extend(number(json.len()));
        glb.extend(b"JSON");
        glb.extend(json);
        glb.extend(number(self.bytes.len()));
        glb.extend(b"BIN\0");
        glb.extend(&self.bytes);
        glb
    }

    fn read(&self) -> Result<HandModel, HandModelError> {
        read_bytes(&self.glb())
    }

    fn read_with_warnings(&self) -> Result<GltfFile, HandModelError> {
        read_gltf_bytes("small.glb", &self.glb())
    }
}

fn read_bytes(bytes: &[u8]) -> Result<HandModel, HandModelError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("small.glb");
    std::fs::write(&path, bytes).unwrap();
    Ok(read_gltf(&path, None)?.model)
}

#[test]
fn a_node_tree_gives_the_hierarchy_with_parents_first() {
    let model = SmallHand::new().read().unwrap();
    assert_eq!(model.joint_names, ["root", "middle", "tip"]);
    assert_eq!(model.parents, [None, Some(0), Some(1)]);
    assert_eq!(model.joints, [DVec3::X, 2.0 * DVec3::X, 3.0 * DVec3::X]);
    assert_eq!(model.side, Side::Left);
}

#[test]
fn seam_vertices_are_welded_and_keep_their_uvs() {
    let model = SmallHand::new().read().unwrap();
    assert_eq!((model.vertices.len(), model.uvs.len()), (4, 6));
    assert_eq!(model.faces, [[0, 1, 2], [0, 2, 3]]);
    assert_eq!(model.face_uvs, [[0, 1, 2], [3, 4, 5]]);
    // One copy is all root; the other is middle 0.5 and root 1.5, which sums to 2: normalised, then averaged.
    assert_eq!(model.vertex_weights(0), [0.875, 0.125, 0.0]);
}

#[test]
fn buffers_beside_a_gltf_file_are_found() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("small.gltf");
    let hand = SmallHand::new().replace(r#""byteLength":432"#, r#""byteLength":432,"uri":"small.bin""#);
    std::fs::write(&path, &hand.json).unwrap();
    let message = read_gltf(&path, None).unwrap_err().to_string();
    assert!(message.contains("small.bin"), "{message}");
    std::fs::write(folder.path().join("small.bin"), &hand.bytes).unwrap();
    assert_eq!(read_gltf(&path, None).unwrap().model.vertices, SmallHand::new().read().unwrap().vertices);
}

#[test]
fn bad_files_are_rejected_with_the_part_and_a_remedy() {
    let small = SmallHand::new;
    let uri = |uri: &str| small().replace(r#""byteLength":432}"#, &format!(r#""byteLength":432,"uri":"{uri}"}}"#));
    let required = |name: &str| {
        small().replace(
            r#""scene":0"#,
            &format!(r#""scene":0,"extensionsUsed":["{name}"],"extensionsRequired":["{name}"]"#),
        )
    };
    let cases: Vec<(SmallHand, &str)> = vec![
        (small().replace(r#","skin":0"#, ""), "skin: no mesh has one"),
        (small().replace(r#""TEXCOORD_0":1,"#, ""), "unwrap the mesh"),
        (small().replace(r#""JOINTS_0":2,"WEIGHTS_0":3"#, r#""NORMAL":0"#), "JOINTS_0: is missing"),
        (small().replace(r#","inverseBindMatrices":4"#, ""), "inverseBindMatrices: are missing"),
        (small().replace(r#""TEXCOORD_0":1"#, r#""TEXCOORD_0":0"#), "has 3 components, expected 2"),
        (small().replace(r#""POSITION":0"#, r#""POSITION":9"#), "POSITION: refers to accessor 9 of 5"),
        (small().replace(r#""count":3,"type":"MAT4""#, r#""count":4,"type":"MAT4""#), "beyond its buffer"),
        (small().replace(r#""count":3,"type":"MAT4""#, r#""count":99999999999,"type":"MAT4""#), "more than any hand"),
        (small().replace(r#""count":3,"type":"MAT4""#, r#""count":999999,"type":"MAT4""#), "beyond its buffer"),
        (small().replace(r#""count":3,"type":"MAT4""#, r#""count":2,"type":"MAT4""#), "2 for 3 joints"),
        (uri("data:;base64,AA=="), "buffer 0: has 1 of 432 bytes"),
        (uri("data:;base64,A!=="), "buffer 0: is not base64"),
        (uri("data:text/plain,hello"), "buffer 0: is a data: URI without base64"),
        (uri("../secret.bin"), "buffer 0: is at '../secret.bin', outside the .gltf file's folder"),
        (uri("a/%2e%2E/%2e./secret.bin"), "outside the .gltf file's folder; put it beside the .gltf file"),
        (uri("/etc/passwd"), "is at '/etc/passwd', outside"),
        (uri("file:///etc/passwd"), "is at 'file:///etc/passwd', outside"),
        (uri("https://example.org/a.bin"), "is at 'https://example.org/a.bin', outside"),
        (uri("%FF.bin"), "is not UTF-8"),
        (uri("."), "it is a folder, not a file; put '.' beside the .gltf file"),
        (uri("none.bin"), "put 'none.bin' beside the .gltf file"),
        (small().replace(r#""byteLength":432}"#, r#""byteLength":4320000000}"#), "more than 1073741824"),
        (required("KHR_draco_mesh_compression"), "extensionsRequired: lists KHR_draco_mesh_compression"),
        (required("EXT_meshopt_compression"), "export without mesh compression"),
        (required("KHR_mesh_quantization"), "export without quantization"),
        (required("EXT_unknown"), "EXT_unknown"),
        (small().replace(r#""children":[2]"#, r#""children":[]"#), "2 root joints (middle, root)"),
        (small().put(0, f32::NAN), "POSITION: entry 0 is not finite"),
        (small().put(72, f32::INFINITY), "TEXCOORD_0: entry 0 is not finite"),
        (small().put(144, -1.0), "WEIGHTS_0: has -1"),
        (small().put(144, 0.0), "vertex 0 is not bound to any joint"),
        (small().put(240, 0.0), "that of joint 0 cannot be inverted"),
    ];
    for (hand, expected) in cases {
        let message = hand.read().map(|_| ()).unwrap_err().to_string();
        assert!(message.contains(expected) && message.contains("small.glb"), "wanted '{expected}', got '{message}'");
    }
    let mut wild = SmallHand::new();
    wild.bytes[120] = 77;
    assert!(wild.read().unwrap_err().to_string().contains("JOINTS_0: refers to joint 77 of 3"));
}

#[test]
fn a_file_truncated_anywhere_is_an_error_not_a_panic() {
    let glb = SmallHand::new().glb();
    for length in 0..glb.len() {
        assert!(read_bytes(&glb[..length]).is_err(), "{length} of {} bytes were accepted as a hand", glb.len());
    }
}

#[test]
fn a_missing_file_is_named() {
    let message = read_gltf(Path::new("no/such/hand.glb"), None).unwrap_err().to_string();
    assert!(message.contains("no/such/hand.glb"), "{message}");
}

#[test]
fn both_generic_hands_have_the_25_webxr_joints_in_one_order() {
    for (file, side) in [("right.glb", Side::Right), ("left.glb", Side::Left)] {
        let Some(path) = generic_hand(file) else { return };
        let model = read_gltf(&path, None).unwrap().model;
        assert_eq!(model.joint_names, WEBXR_JOINTS);
        assert_eq!(model.side, side);
        let parents = [0, 0, 1, 2, 3, 0, 5, 6, 7, 8, 0, 10, 11, 12, 13, 0, 15, 16, 17, 18, 0, 20, 21, 22, 23];
        assert_eq!(model.parents[0], None);
        assert!(model.parents[1..].iter().zip(&parents[1..]).all(|(a, b)| *a == Some(*b)));
        assert!(model.vertices.len() < model.uvs.len());
        // Welded, the skin is closed: every edge is used once in each direction.
        let mut edges: Vec<(u32, u32)> = model.faces.iter().flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)]).collect();
        edges.sort_unstable();
        let open = edges.iter().filter(|&&(a, b)| edges.binary_search(&(b, a)).is_err()).count();
        assert_eq!(open, 0, "{file}");
    }
}

#[test]
fn the_generic_hands_are_mirror_images_in_x() {
    let (Some(right), Some(left)) = (generic_hand("right.glb"), generic_hand("left.glb")) else { return };
    let (right, left) = (read_gltf(&right, None).unwrap().model, read_gltf(&left, None).unwrap().model);
    for (name, (r, l)) in right.joint_names.iter().zip(right.joints.iter().zip(&left.joints)) {
        // The files' artist moved the hands by 2 mm and an index joint by 7: far less than the size of a hand.
        let mirrored = DVec3::new(-l.x, l.y, l.z);
        assert!(r.distance(mirrored) < 0.008, "{name}: {r} against {mirrored}");
    }
    // The wrist is where the file's node says (checked by hand): metres and axes are the mesh's.
    assert!(right.joints[0].distance(DVec3::new(0.039126, 0.055775, 0.009157)) < 1e-5);
}

//! Writes a posed hand as a binary glTF 2.0 file.

use std::path::Path;

use ghand_core::HandModel;
use ghand_core::mesh::RenderMesh;
use glam::{DVec3, Vec3};
use serde_json::json;

use super::export;
use crate::HandModelError;

// Numbers of the glTF standard.
const F32: u32 = 5126;
const U32: u32 = 5125;
const VERTEX_BUFFER: u32 = 34962;
const INDEX_BUFFER: u32 = 34963;

/// The bytes of a GLB file: one static mesh, its vertices at `positions` (`V`, metres, model axes), with normals and
/// UVs, split along the seams of the atlas.
///
/// # Errors
/// [`HandModelError::Invalid`] if the model breaks its invariants, `positions` are not finite or not one per vertex,
/// or the mesh is larger than GLB's 4 GiB.
pub fn glb_bytes(model: &HandModel, positions: &[DVec3]) -> Result<Vec<u8>, HandModelError> {
    export::check(model, positions)?;
    let mesh = RenderMesh::from_model(model);
    let points: Vec<Vec3> = mesh.gather(positions).iter().map(|p| p.as_vec3()).collect();
    // glTF requires a unit vector, even for a vertex whose faces have no area.
    let normals = mesh.gather(&model.vertex_normals(positions));
    let normals = normals.iter().map(|n| if *n == DVec3::ZERO { Vec3::Z } else { n.as_vec3() });
    let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for p in &points {
        low = low.min(*p);
        high = high.max(*p);
    }
    // All entries have four bytes, so that every part of the buffer is aligned.
    let parts: [Vec<u8>; 4] = [
        points.iter().flat_map(|p| p.to_array()).flat_map(f32::to_le_bytes).collect(),
        normals.flat_map(|n| n.to_array()).flat_map(f32::to_le_bytes).collect(),
        mesh.uvs.iter().flat_map(|uv| uv.as_vec2().to_array()).flat_map(f32::to_le_bytes).collect(),
        mesh.triangles.iter().flatten().flat_map(|i| i.to_le_bytes()).collect(),
    ];
    let mut views = vec![];
    let mut binary: Vec<u8> = vec![];
    for (k, part) in parts.iter().enumerate() {
        let target = if k < 3 { VERTEX_BUFFER } else { INDEX_BUFFER };
        views.push(json!({"buffer": 0, "byteOffset": binary.len(), "byteLength": part.len(), "target": target}));
        binary.extend(part);
    }
    let count = points.len();
    let document = json!({
        "asset": {"version": "2.0", "generator": "ghand"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": model.name}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2}, "indices": 3}]}],
        "buffers": [{"byteLength": binary.len()}],
        "bufferViews": views,
        "accessors": [
            {"bufferView": 0, "componentType": F32, "count": count, "type": "VEC3",
                "min": low.to_array(), "max": high.to_array()},
            {"bufferView": 1, "componentType": F32, "count": count, "type": "VEC3"},
            {"bufferView": 2, "componentType": F32, "count": count, "type": "VEC2"},
            {"bufferView": 3, "componentType": U32, "count": 3 * mesh.triangles.len(), "type": "SCALAR"}
        ]
    });
    let mut text = document.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    // File header, and a header for each of the two chunks.
    let total = 12 + 8 + text.len() + 8 + binary.len();
    let too_large = |_| {
        HandModelError::invalid(
            model.name.clone(),
            "mesh",
            format!("takes {total} bytes, more than a GLB file can have; write it as OBJ"),
        )
    };
    let mut glb = Vec::with_capacity(total);
    glb.extend(b"glTF");
    glb.extend(2u32.to_le_bytes());
    glb.extend(u32::try_from(total).map_err(too_large)?.to_le_bytes());
    for (kind, chunk) in [(b"JSON", &text), (b"BIN\0", &binary)] {
        glb.extend(u32::try_from(chunk.len()).map_err(too_large)?.to_le_bytes());
        glb.extend(kind);
        glb.extend(chunk);
    }
    Ok(glb)
}

/// Writes [`glb_bytes`] to a file atomically.
///
/// # Errors
/// As for [`glb_bytes`]; [`HandModelError::Write`] if the file cannot be written.
pub fn write_glb(path: &Path, model: &HandModel, positions: &[DVec3]) -> Result<(), HandModelError> {
    export::write(path, &glb_bytes(model, positions)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::procedural::ProceduralHand;
    use ghand_core::pose::Pose;
    use ghand_core::posing::pose_hand;

    fn posed_hand() -> (HandModel, Vec<DVec3>) {
        let model = ProceduralHand { detail: 1, ..Default::default() }.build().unwrap();
        let mut pose = Pose::rest(model.joint_count());
        pose.rotations[1..].fill(DVec3::new(0.1, -0.2, 0.6));
        let positions = pose_hand(&model, &[], &pose).unwrap().vertices;
        (model, positions)
    }

    #[test]
    fn another_reader_finds_the_posed_surface_with_normals_and_uvs() {
        let (model, positions) = posed_hand();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("hand.glb");
        write_glb(&path, &model, &positions).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        // With the reader's validation, which checks min and max, ranges and alignments.
        let file = ::gltf::Gltf::from_slice(&bytes).unwrap();
        let blob = file.blob.clone().unwrap();
        assert!(file.buffers().all(|b| b.length() == blob.len()));
        assert!(file.views().all(|v| v.offset() % 4 == 0 && v.offset() + v.length() <= blob.len()));
        assert_eq!(file.skins().count(), 0);
        let mesh = file.meshes().next().unwrap();
        let primitive = mesh.primitives().next().unwrap();
        let reader = primitive.reader(|_| Some(&blob));
        let found: Vec<Vec3> = reader.read_positions().unwrap().map(Vec3::from).collect();
        let normals: Vec<Vec3> = reader.read_normals().unwrap().map(Vec3::from).collect();
        let uvs: Vec<[f32; 2]> = reader.read_tex_coords(0).unwrap().into_f32().collect();
        let corners: Vec<u32> = reader.read_indices().unwrap().into_u32().collect();
        assert_eq!((normals.len(), uvs.len()), (found.len(), found.len()));
        assert!(normals.iter().all(|n| (n.length() - 1.0).abs() < 1e-6));
        assert_eq!(corners.len(), 3 * model.faces.len());
        let outwards = model.vertex_normals(&positions);
        for (corners, (face, face_uv)) in corners.chunks_exact(3).zip(model.faces.iter().zip(&model.face_uvs)) {
            for c in 0..3 {
                let at = corners[c] as usize;
                assert_eq!(found[at], positions[face[c] as usize].as_vec3());
                assert_eq!(normals[at], outwards[face[c] as usize].as_vec3());
                assert_eq!(uvs[at], model.uvs[face_uv[c] as usize].as_vec2().to_array());
            }
        }
        let bounds = primitive.bounding_box();
        let least = found.iter().copied().fold(Vec3::INFINITY, Vec3::min);
        let most = found.iter().copied().fold(Vec3::NEG_INFINITY, Vec3::max);
        assert_eq!((bounds.min, bounds.max), (least.to_array(), most.to_array()));
    }

    #[test]
    fn the_file_is_aligned_and_has_its_declared_length() {
        let (mut model, positions) = posed_hand();
        for name in ["a", "ab", "abc", "\"quoted\" \u{e9}\n"] {
            model.name = name.into();
            let glb = glb_bytes(&model, &positions).unwrap();
            let word = |at: usize| u32::from_le_bytes(glb[at..at + 4].try_into().unwrap()) as usize;
            assert_eq!((&glb[..4], word(4), word(8)), (b"glTF".as_slice(), 2, glb.len()));
            assert!(glb.len().is_multiple_of(4) && word(12).is_multiple_of(4));
            let file = ::gltf::Gltf::from_slice(&glb).unwrap();
            assert_eq!(file.nodes().next().unwrap().name(), Some(name));
        }
    }

    #[test]
    fn positions_that_do_not_match_are_rejected() {
        let (model, mut positions) = posed_hand();
        let message = glb_bytes(&model, &positions[1..]).unwrap_err().to_string();
        let count = model.vertices.len();
        let expected = format!("positions: {} of them, the model has {count}", count - 1);
        assert!(message.contains(&expected), "{message}");
        positions[5].x = 1e300;
        let message = glb_bytes(&model, &positions).unwrap_err().to_string();
        assert!(message.contains("vertex 5"), "{message}");
        positions[5].x = 0.0;
        let folder = tempfile::tempdir().unwrap();
        let message = write_glb(folder.path(), &model, &positions).unwrap_err().to_string();
        assert!(message.contains(": cannot write") && message.contains("folder"), "{message}");
    }
}

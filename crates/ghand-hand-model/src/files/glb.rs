//! Writes a posed hand as a binary glTF 2.0 file.

use std::path::Path;

use ghand_core::mesh::RenderMesh;
use ghand_core::posing::pose_hand;
use ghand_core::{HandModel, Pose};
use glam::DVec3;
use serde_json::json;

use super::export;
use super::glb_document::GlbDocument;
use crate::HandModelError;

/// The bytes of a GLB file: one static mesh, the model in that shape (`n_s` or fewer) and pose, with normals and UVs,
/// split along the seams of the atlas. The model's shape directions are morph targets of the posed mesh: weights of 0
/// are the given shape.
///
/// # Errors
/// [`HandModelError::Invalid`] if the model breaks its invariants, shape or pose do not fit it, a number is too large
/// for single precision, or the mesh is larger than GLB's 4 GiB.
pub fn glb_bytes(model: &HandModel, shape: &[f64], pose: &Pose) -> Result<Vec<u8>, HandModelError> {
    model.validate()?;
    let positions = pose_hand(model, shape, pose)?.vertices;
    export::check(model, &positions)?;
    let directions = posed_directions(model, shape, pose, &positions)?;
    let mesh = RenderMesh::from_model(model);
    let mut document = GlbDocument::new(model);
    let primitive = document.primitive(&mesh, &positions, &directions)?;
    let mesh = document.mesh(primitive, &vec![0.0; model.shape_count()], &model.shape_names);
    document.push("meshes", mesh);
    document.push("nodes", json!({"mesh": 0, "name": model.name}));
    document.push("scenes", json!({"nodes": [0]}));
    document.finish()
}

/// Displacements `[n_s][V]` of the posed vertices per unit of each shape parameter, metres. They are the same in every
/// shape: joints are linear in the shape, and so is a skinned point in the joints.
fn posed_directions(
    model: &HandModel,
    shape: &[f64],
    pose: &Pose,
    positions: &[DVec3],
) -> Result<Vec<DVec3>, HandModelError> {
    let mut directions = Vec::with_capacity(model.shape_directions.len());
    for k in 0..model.shape_count() {
        let mut changed = shape.to_vec();
        changed.resize(model.shape_count(), 0.0);
        changed[k] += 1.0;
        let moved = pose_hand(model, &changed, pose)?.vertices;
        directions.extend(moved.iter().zip(positions).map(|(moved, at)| *moved - *at));
    }
    Ok(directions)
}

/// Writes [`glb_bytes`] to a file atomically.
///
/// # Errors
/// As for [`glb_bytes`]; [`HandModelError::Write`] if the file cannot be written.
pub fn write_glb(path: &Path, model: &HandModel, shape: &[f64], pose: &Pose) -> Result<(), HandModelError> {
    export::write(path, &glb_bytes(model, shape, pose)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use ghand_test_support::procedural_hand::ProceduralHand;
    use glam::Vec3;

    const SHAPE: [f64; 3] = [0.5, -1.0, 2.0];

    fn posed_hand() -> (HandModel, Pose, Vec<DVec3>) {
        let model = ProceduralHand { detail: 1, ..Default::default() }.build().unwrap();
        let mut pose = Pose::rest(model.joint_count());
        pose.rotations[1..].fill(DVec3::new(0.1, -0.2, 0.6));
        let positions = pose_hand(&model, &SHAPE, &pose).unwrap().vertices;
        (model, pose, positions)
    }

    #[test]
    fn another_reader_finds_the_posed_surface_with_normals_and_uvs() {
        let (model, pose, positions) = posed_hand();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("hand.glb");
        write_glb(&path, &model, &SHAPE, &pose).unwrap();
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
    fn the_shape_directions_are_morph_targets_of_the_posed_mesh() {
        let (model, pose, positions) = posed_hand();
        let file = ::gltf::Gltf::from_slice(&glb_bytes(&model, &SHAPE, &pose).unwrap()).unwrap();
        let mesh = file.meshes().next().unwrap();
        let extras: serde_json::Value = serde_json::from_str(mesh.extras().as_ref().unwrap().get()).unwrap();
        assert_eq!(extras["targetNames"], json!(model.shape_names));
        assert_eq!(mesh.weights(), Some(&[0.0; 10][..]));
        let primitive = mesh.primitives().next().unwrap();
        let reader = primitive.reader(|_| file.blob.as_deref());
        let weights: [f64; 10] = std::array::from_fn(|k| 0.3 * k as f64 - 1.0);
        let mut morphed: Vec<DVec3> = reader.read_positions().unwrap().map(|p| Vec3::from(p).as_dvec3()).collect();
        for ((target, _, _), weight) in reader.read_morph_targets().zip(weights) {
            morphed.iter_mut().zip(target.unwrap()).for_each(|(p, d)| *p += Vec3::from(d).as_dvec3() * weight);
        }
        let shape: Vec<f64> = (0..10).map(|k| weights[k] + SHAPE.get(k).unwrap_or(&0.0)).collect();
        let expected = pose_hand(&model, &shape, &pose).unwrap().vertices;
        let mesh = RenderMesh::from_model(&model);
        assert!(mesh.gather(&positions).len() == morphed.len() && primitive.morph_targets().len() == 10);
        for (found, expected) in morphed.iter().zip(mesh.gather(&expected)) {
            assert!(found.distance(expected) < 1e-7, "{found} against {expected}");
        }
    }

    #[test]
    fn the_file_is_aligned_and_has_its_declared_length() {
        let (mut model, pose, _) = posed_hand();
        for name in ["a", "ab", "abc", "\"quoted\" \u{e9}\n"] {
            model.name = name.into();
            let glb = glb_bytes(&model, &SHAPE, &pose).unwrap();
            let word = |at: usize| u32::from_le_bytes(glb[at..at + 4].try_into().unwrap()) as usize;
            assert_eq!((&glb[..4], word(4), word(8)), (b"glTF".as_slice(), 2, glb.len()));
            assert!(glb.len().is_multiple_of(4) && word(12).is_multiple_of(4));
            let file = ::gltf::Gltf::from_slice(&glb).unwrap();
            assert_eq!(file.nodes().next().unwrap().name(), Some(name));
        }
    }

    #[test]
    fn a_shape_or_pose_that_does_not_fit_is_rejected() {
        let (model, mut pose, _) = posed_hand();
        let message = glb_bytes(&model, &[0.0; 11], &pose).unwrap_err().to_string();
        assert!(message.contains("shape: has 11 numbers"), "{message}");
        pose.translation.x = 1e300;
        let message = glb_bytes(&model, &[], &pose).unwrap_err().to_string();
        assert!(message.contains("positions: that of vertex 0 is too large"), "{message}");
        pose.rotations.pop();
        let message = glb_bytes(&model, &[], &pose).unwrap_err().to_string();
        assert!(message.contains("pose: has 15 rotations"), "{message}");
        let (model, pose, _) = posed_hand();
        let folder = tempfile::tempdir().unwrap();
        let message = write_glb(folder.path(), &model, &[], &pose).unwrap_err().to_string();
        assert!(message.contains(": cannot write") && message.contains("folder"), "{message}");
    }
}

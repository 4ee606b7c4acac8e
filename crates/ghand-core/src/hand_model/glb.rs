//! Writes posed hands as binary glTF 2.0.

use std::io;
use std::path::Path;

use glam::DVec3;
use serde_json::json;

use super::HandModel;
use crate::atomic_file::write_atomically;
use crate::mesh::RenderMesh;

/// glTF's codes for component types and buffer targets.
const F32: u32 = 5126;
const U32: u32 = 5125;
const VERTICES: u32 = 34962;
const INDICES: u32 = 34963;

/// Writes a hand with its vertices at `positions` (metres, `V`) as a mesh without bones, with normals and texture
/// coordinates, whole or not at all. Vertices on UV seams are split.
///
/// # Errors
/// Any error of the file system; `path` is then as it was before.
pub fn write_glb(path: &Path, model: &HandModel, positions: &[DVec3]) -> io::Result<()> {
    write_atomically(path, &glb(model, positions)?)
}

fn glb(model: &HandModel, positions: &[DVec3]) -> io::Result<Vec<u8>> {
    let mesh = RenderMesh::from_model(model);
    let corners = mesh.gather(positions);
    let normals = mesh.gather(&model.vertex_normals(positions));
    let floats =
        |values: &mut dyn Iterator<Item = f64>| values.flat_map(|v| (v as f32).to_le_bytes()).collect::<Vec<u8>>();
    let parts = [
        (floats(&mut corners.iter().flat_map(|v| v.to_array())), F32, "VEC3", corners.len(), VERTICES),
        // A vertex without area has no normal; glTF wants unit vectors.
        (
            floats(&mut normals.iter().flat_map(|n| if *n == DVec3::ZERO { DVec3::X } else { *n }.to_array())),
            F32,
            "VEC3",
            corners.len(),
            VERTICES,
        ),
        (floats(&mut mesh.uvs.iter().flat_map(|uv| uv.to_array())), F32, "VEC2", corners.len(), VERTICES),
        (
            mesh.triangles.iter().flatten().flat_map(|i| i.to_le_bytes()).collect(),
            U32,
            "SCALAR",
            3 * mesh.triangles.len(),
            INDICES,
        ),
    ];
    let (mut views, mut accessors, mut data) = (Vec::new(), Vec::new(), Vec::new());
    for (bytes, component_type, kind, count, target) in &parts {
        views.push(json!({"buffer": 0, "byteOffset": data.len(), "byteLength": bytes.len(), "target": target}));
        accessors.push(
            json!({"bufferView": accessors.len(), "componentType": component_type, "count": count, "type": kind}),
        );
        data.extend_from_slice(bytes);
    }
    // The bounds of what is stored, which is rounded.
    let stored: Vec<DVec3> = corners.iter().map(|v| v.as_vec3().as_dvec3()).collect();
    let bound = |start: DVec3, pick: fn(DVec3, DVec3) -> DVec3| stored.iter().copied().fold(start, pick).to_array();
    if let Some(of_positions) = accessors.first_mut() {
        of_positions["min"] = json!(bound(DVec3::INFINITY, DVec3::min));
        of_positions["max"] = json!(bound(DVec3::NEG_INFINITY, DVec3::max));
    }
    let root = json!({
        "asset": {"version": "2.0", "generator": "ghand"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": "hand"}],
        "meshes": [{"primitives": [{
            "attributes": {"POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2}, "indices": 3, "material": 0
        }]}],
        "materials": [{"pbrMetallicRoughness": {"baseColorFactor": [0.8, 0.6, 0.5, 1.0], "metallicFactor": 0.0}}],
        "buffers": [{"byteLength": data.len()}],
        "bufferViews": views,
        "accessors": accessors,
    });
    let mut text = serde_json::to_vec(&root)?;
    text.resize(text.len().next_multiple_of(4), b' ');
    let word = |n: usize| u32::try_from(n).map(u32::to_le_bytes).map_err(|_| io::Error::other("the mesh is too large"));
    let mut file = b"glTF".to_vec();
    file.extend(2u32.to_le_bytes());
    file.extend(word(12 + 8 + text.len() + 8 + data.len())?);
    file.extend(word(text.len())?);
    file.extend(b"JSON");
    file.extend(text);
    // All parts are of whole words.
    file.extend(word(data.len())?);
    file.extend(b"BIN\0");
    file.extend(data);
    Ok(file)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hand_model::procedural::ProceduralHand;

    #[test]
    fn the_file_is_valid_gltf_that_holds_the_mesh() {
        let hand = ProceduralHand { detail: 1, ..Default::default() }.build().unwrap();
        let moved: Vec<DVec3> = hand.vertices.iter().map(|v| *v + DVec3::Y).collect();
        let bytes = glb(&hand, &moved).unwrap();
        // Validates against the specification.
        let file = gltf::Gltf::from_slice(&bytes).unwrap();
        let primitive = file.meshes().next().unwrap().primitives().next().unwrap();
        let blob = file.blob.clone().unwrap();
        let reader = primitive.reader(|_| Some(&blob));
        let positions: Vec<_> = reader.read_positions().unwrap().collect();
        let triangles: Vec<u32> = reader.read_indices().unwrap().into_u32().collect();
        assert_eq!(triangles.len(), 3 * hand.faces.len());
        for (corner, vertex) in triangles.iter().zip(hand.faces.as_flattened()) {
            assert_eq!(positions[*corner as usize], moved[*vertex as usize].as_vec3().to_array());
        }
        assert_eq!(reader.read_tex_coords(0).unwrap().into_f32().count(), positions.len());
        let unit = |n: [f32; 3]| (n.iter().map(|v| v * v).sum::<f32>() - 1.0).abs() < 1e-5;
        assert!(reader.read_normals().unwrap().all(unit));
        let bounds = primitive.bounding_box();
        assert!(positions.iter().all(|p| (0..3).all(|c| bounds.min[c] <= p[c] && p[c] <= bounds.max[c])));
    }
}

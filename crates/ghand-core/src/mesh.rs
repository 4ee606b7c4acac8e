//! Textured triangle meshes, in the layout that renderers need.

use std::collections::HashMap;

use glam::{DVec2, DVec3};

use crate::HandModel;

/// An 8-bit colour texture; values are display values (no transfer curve is applied anywhere).
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Texture {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Row-major texels, `width * height` of them; UV (0, 0) is the outer corner of the first.
    pub rgb: Vec<[u8; 3]>,
}

impl Texture {
    /// A texture of one colour.
    pub fn plain(rgb: [u8; 3]) -> Texture {
        Texture { width: 1, height: 1, rgb: vec![rgb] }
    }
}

/// Triangles with one UV per vertex (vertices on UV seams are duplicated).
#[derive(Debug, Clone, PartialEq)]
pub struct RenderMesh {
    /// For each render vertex, the index of its vertex in the model.
    pub source_vertices: Vec<u32>,
    /// UV of each render vertex.
    pub uvs: Vec<DVec2>,
    /// Triangles as indices of render vertices.
    pub triangles: Vec<[u32; 3]>,
}

impl RenderMesh {
    /// Splits a model's vertices along its UV seams.
    pub fn from_model(model: &HandModel) -> RenderMesh {
        let mut index = HashMap::new();
        let mut mesh = RenderMesh { source_vertices: vec![], uvs: vec![], triangles: vec![] };
        for (face, face_uv) in model.faces.iter().zip(&model.face_uvs) {
            let mut triangle = [0; 3];
            for corner in 0..3 {
                let key = (face[corner], face_uv[corner]);
                triangle[corner] = *index.entry(key).or_insert_with(|| {
                    mesh.source_vertices.push(key.0);
                    mesh.uvs.push(model.uvs[key.1 as usize]);
                    mesh.uvs.len() as u32 - 1
                });
            }
            mesh.triangles.push(triangle);
        }
        mesh
    }

    /// Values of the model's vertices (positions, normals, ...) at the render vertices.
    pub fn gather(&self, values: &[DVec3]) -> Vec<DVec3> {
        self.source_vertices.iter().map(|&i| values[i as usize]).collect()
    }
}

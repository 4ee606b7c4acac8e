//! Builds a UV atlas for a mesh that has none.
//!
//! The surface is cut into charts, each completely visible from one direction. Each chart is projected along its
//! direction, and the projections are packed into the unit square. No part of a chart is tilted by more than
//! [`STEEPEST`], so that texels are about equally dense everywhere; overlaps are impossible by construction.

mod charts;
mod packing;
mod raster;

use glam::{DVec2, DVec3};

use charts::Chart;

/// Cosine of the steepest angle between a face and the plane that it is projected on: 60 degrees, at which a texel
/// covers twice the area, sqrt(2) of the spacing. A smaller angle makes more charts, whose gutters cost more than the
/// evenness gains.
const STEEPEST: f64 = 0.5;

/// Smallest area of a face that gets its own place, where the longest side of the mesh's box is 1: at it, the area of a
/// triangle is near the rounding error of its corners and its direction is noise.
const SMALLEST_AREA: f64 = 1e-14;

/// UV coordinates that show every face of a mesh once.
#[derive(Debug, Clone, PartialEq)]
pub struct Atlas {
    /// Points in `[0, 1]^2`, (0, 0) at the first row and column of a texture.
    pub uvs: Vec<DVec2>,
    /// Triangles as indices into `uvs`, one for each face, as seen from outside in an upright image (negative area when
    /// u is turned towards v). A face without area has one point at all corners.
    pub face_uvs: Vec<[u32; 3]>,
    /// Number of connected pieces.
    pub charts: usize,
}

/// The problem of a mesh without a surface.
const WITHOUT_AREA: &str = "no face has an area; an atlas needs a surface";

/// Builds an atlas of a mesh given as vertices (any unit) and triangles that index them, counter-clockwise seen from
/// outside.
///
/// Any triangles are accepted: open, closed, with edges shared by many faces, or with inconsistent winding. No two
/// triangles of the atlas overlap; charts keep two texels of 512 between each other and to the border (less if there
/// are thousands of them). The same mesh gives the same bits; its position and size do not matter.
///
/// # Errors
/// What makes the mesh unusable, and what to do.
pub fn build_atlas(vertices: &[DVec3], faces: &[[u32; 3]]) -> Result<Atlas, String> {
    if let Some(face) = faces.iter().position(|f| f.iter().any(|&i| i as usize >= vertices.len())) {
        return Err(format!("face {face} refers to a vertex beyond the {}; repair the mesh", vertices.len()));
    }
    let vertices = normalized(vertices, faces)?;
    let charts = charts::cut(&vertices, faces);
    if charts.is_empty() {
        return Err(WITHOUT_AREA.into());
    }
    let places = packing::pack(&charts).ok_or_else(|| {
        format!("the surface has {} pieces, more than fit into a texture; weld its vertices", charts.len())
    })?;
    let mut atlas = Atlas { uvs: vec![], face_uvs: vec![[u32::MAX; 3]; faces.len()], charts: charts.len() };
    // A point of the atlas at each vertex, for faces without area.
    let mut any_point = vec![0; vertices.len()];
    for (Chart { vertices, faces: chart_faces, triangles, .. }, place) in charts.iter().zip(places) {
        let first = atlas.uvs.len() as u32;
        for (k, &vertex) in vertices.iter().enumerate() {
            any_point[vertex as usize] = first + k as u32;
        }
        atlas.uvs.extend(place);
        for (&face, triangle) in chart_faces.iter().zip(triangles) {
            atlas.face_uvs[face as usize] = triangle.map(|i| first + i);
        }
    }
    for (face_uv, face) in atlas.face_uvs.iter_mut().zip(faces) {
        if face_uv[0] == u32::MAX {
            *face_uv = [any_point[face[0] as usize]; 3];
        }
    }
    Ok(atlas)
}

/// The vertices moved to the origin, with the longest side of the box around the faces 1.
fn normalized(vertices: &[DVec3], faces: &[[u32; 3]]) -> Result<Vec<DVec3>, String> {
    let not_finite = |vertex: usize| format!("vertex {vertex} is not finite; repair the mesh");
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for &i in faces.iter().flatten() {
        let p = vertices[i as usize];
        if !p.is_finite() {
            return Err(not_finite(i as usize));
        }
        low = low.min(p);
        high = high.max(p);
    }
    let side = (high - low).max_element();
    if side == f64::INFINITY {
        let vertex = vertices.iter().position(|p| p.abs().max_element() > f64::MAX / 4.0).unwrap_or(0);
        return Err(not_finite(vertex));
    }
    if side <= 0.0 || faces.is_empty() {
        return Err(WITHOUT_AREA.into());
    }
    Ok(vertices.iter().map(|p| (*p - low) / side).collect())
}

#[cfg(test)]
mod tests;

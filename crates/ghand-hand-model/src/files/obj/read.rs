//! Reads the UV atlas of an OBJ file.

use std::collections::HashSet;
use std::path::Path;

use ghand_files::input_file;
use glam::DVec2;

use crate::HandModelError;

/// Largest file that is read: room for about a million vertices.
const MAX_BYTES: u64 = 64 << 20;
/// UV points this far outside the unit square are moved to its border: rounding by exporters.
const BORDER: f64 = 1e-4;

/// A UV atlas, with the faces that it belongs to.
#[derive(Debug, Clone, PartialEq)]
pub struct UvLayout {
    /// Points in `[0, 1]^2`, (0, 0) at the first row and column of a texture.
    pub uvs: Vec<DVec2>,
    /// Triangles as vertex indices.
    pub faces: Vec<[u32; 3]>,
    /// Triangles as indices into `uvs`, one for each face.
    pub face_uvs: Vec<[u32; 3]>,
}

/// Reads UV points and triangles of an OBJ file made for a model of `vertex_count` vertices and the triangles `faces`.
///
/// The file's vertices must be the model's, in the model's order (their positions do not matter). Its triangles replace
/// the model's; they may close the wrist or leave it open. Polygons are split into triangles around their first corner.
/// The file's v is measured from the bottom of a texture and is converted to one measured from the top.
///
/// # Errors
/// [`HandModelError::Io`] if the file cannot be read; [`HandModelError::Invalid`] names file, line and a remedy if it
/// is not an OBJ file with UVs, is larger than 64 MiB, or belongs to another mesh: one with another number of vertices,
/// with mostly different edges, or with the opposite winding.
pub fn read_obj_uvs(path: &Path, vertex_count: usize, faces: &[[u32; 3]]) -> Result<UvLayout, HandModelError> {
    let io = |error| HandModelError::Io { path: path.to_path_buf(), source: error };
    let origin = path.display().to_string();
    let Some(bytes) = input_file::read(path, MAX_BYTES).map_err(io)? else {
        let problem = format!("is larger than {} MiB; export only the hand's mesh", MAX_BYTES >> 20);
        return Err(HandModelError::invalid(origin, "size", problem));
    };
    // Names and comments may be in any encoding.
    parse(&String::from_utf8_lossy(&bytes), vertex_count, faces)
        .map_err(|(field, problem)| HandModelError::invalid(origin, field, problem))
}

/// The problem, and its line.
type Flaw = (String, String);

fn at_line(line: usize, problem: impl Into<String>) -> Flaw {
    (format!("line {line}"), problem.into())
}

fn parse(text: &str, vertex_count: usize, model_faces: &[[u32; 3]]) -> Result<UvLayout, Flaw> {
    let mut vertices = 0;
    let mut layout = UvLayout { uvs: vec![], faces: vec![], face_uvs: vec![] };
    // The line of each face: indices can only be checked when all points are known.
    let mut lines = vec![];
    for (line, content) in logical_lines(text) {
        let content = content.split('#').next().unwrap_or_default();
        let mut words = content.split_whitespace();
        match words.next() {
            Some("v") => vertices += 1,
            Some("vt") => layout.uvs.push(uv_point(words).map_err(|problem| at_line(line, problem))?),
            Some("f") => {
                let mut corners = vec![];
                for word in words {
                    let corner = corner(word, vertices, layout.uvs.len()).map_err(|problem| at_line(line, problem))?;
                    corners.push(corner);
                }
                let [first, rest @ ..] = corners.as_slice() else {
                    return Err(at_line(line, "a face without corners; export the mesh again"));
                };
                if rest.len() < 2 {
                    return Err(at_line(line, "a face needs three corners or more; export the mesh again"));
                }
                for pair in rest.windows(2) {
                    layout.faces.push([first.0, pair[0].0, pair[1].0]);
                    layout.face_uvs.push([first.1, pair[0].1, pair[1].1]);
                    lines.push(line);
                }
            }
            _ => {}
        }
    }
    if vertices != vertex_count {
        let problem = format!(
            "{vertices}, the hand model has {vertex_count}; export the UVs of this model's mesh with its vertices in \
             order"
        );
        return Err(("vertices".into(), problem));
    }
    if layout.faces.is_empty() {
        return Err(("faces".into(), "there are none; export the mesh with faces and UVs".into()));
    }
    let uv_count = layout.uvs.len();
    for ((face, face_uv), line) in layout.faces.iter().zip(&layout.face_uvs).zip(lines) {
        if let Some(i) = face.iter().find(|&&i| i as usize >= vertex_count) {
            return Err(at_line(
                line,
                format!("refers to vertex {} of {vertex_count}; export again", u64::from(*i) + 1),
            ));
        }
        if let Some(i) = face_uv.iter().find(|&&i| i as usize >= uv_count) {
            return Err(at_line(line, format!("refers to UV point {} of {uv_count}; export again", u64::from(*i) + 1)));
        }
    }
    check_same_mesh(&layout.faces, model_faces)?;
    Ok(layout)
}

/// Logical lines, joined at backslashes, each with the number of its first line.
fn logical_lines(text: &str) -> impl Iterator<Item = (usize, String)> {
    let mut lines = text.lines().enumerate();
    std::iter::from_fn(move || {
        let (number, mut line) = lines.next().map(|(k, line)| (k + 1, line.to_string()))?;
        while let Some(open) = line.strip_suffix('\\') {
            line.truncate(open.len());
            match lines.next() {
                Some((_, next)) => {
                    line.push(' ');
                    line.push_str(next);
                }
                None => break,
            }
        }
        Some((number, line))
    })
}

/// `u v [w]`, v from the bottom.
fn uv_point<'a>(mut words: impl Iterator<Item = &'a str>) -> Result<DVec2, String> {
    let mut number = || -> Result<f64, String> {
        let word = words.next().ok_or("a UV point needs two numbers; export the mesh again")?;
        let value: f64 =
            word.parse().map_err(|_| format!("'{}' is not a number; export the mesh again", short(word)))?;
        if !(-BORDER..=1.0 + BORDER).contains(&value) {
            return Err(format!("UV {value} is not in 0 to 1; unwrap the mesh into one UV square"));
        }
        Ok(value.clamp(0.0, 1.0))
    };
    let (u, v) = (number()?, number()?);
    Ok(DVec2::new(u, 1.0 - v))
}

/// Vertex and UV point of `v/vt` or `v/vt/vn`, counted from 0.
fn corner(word: &str, vertices: usize, uvs: usize) -> Result<(u32, u32), String> {
    let mut parts = word.split('/');
    let mut index = |so_far: usize| -> Result<u32, String> {
        let part = parts.next().unwrap_or_default();
        if part.is_empty() {
            return Err(format!("corner '{}' has no UV point; export the mesh with UVs", short(word)));
        }
        let number: i64 =
            part.parse().map_err(|_| format!("'{}' is not an index; export the mesh again", short(part)))?;
        // Negative indices count back from the latest point.
        let index = if number < 0 { so_far as i64 + number } else { number - 1 };
        u32::try_from(index).map_err(|_| format!("'{}' does not refer to a point; indices start at 1", short(part)))
    };
    Ok((index(vertices)?, index(uvs)?))
}

/// The beginning of a word, for messages.
fn short(word: &str) -> String {
    word.chars().take(40).collect()
}

/// A mesh with the same number of vertices in another order would give a torn atlas; a mirrored one would give an
/// inside-out hand.
fn check_same_mesh(faces: &[[u32; 3]], model_faces: &[[u32; 3]]) -> Result<(), Flaw> {
    let edges = |&[a, b, c]: &[u32; 3]| [(a, b), (b, c), (c, a)].map(|(a, b)| (a.min(b), a.max(b)));
    let model_edges: HashSet<(u32, u32)> = model_faces.iter().flat_map(edges).collect();
    let shared = faces.iter().flat_map(edges).filter(|edge| model_edges.contains(edge)).count();
    // Polygons may be split along other diagonals, and the wrist may be closed.
    if shared * 2 < 3 * faces.len() {
        let problem = format!(
            "only {shared} of {} edges are the hand model's; export its mesh without sorting or joining vertices",
            3 * faces.len()
        );
        return Err(("faces".into(), problem));
    }
    let from_least = |&[a, b, c]: &[u32; 3]| {
        if a <= b && a <= c {
            [a, b, c]
        } else if b <= c {
            [b, c, a]
        } else {
            [c, a, b]
        }
    };
    let model_triangles: HashSet<[u32; 3]> = model_faces.iter().map(from_least).collect();
    let found = |face: [u32; 3]| usize::from(model_triangles.contains(&from_least(&face)));
    let (same, turned) =
        faces.iter().fold((0, 0), |(same, turned), &[a, b, c]| (same + found([a, b, c]), turned + found([a, c, b])));
    if turned > same {
        let problem = format!(
            "{turned} of {} have the opposite winding; use the atlas of this hand, not of the other one, or flip the \
             faces",
            faces.len()
        );
        return Err(("faces".into(), problem));
    }
    Ok(())
}

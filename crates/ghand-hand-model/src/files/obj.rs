//! Writes a posed hand as an OBJ file.

use std::fmt::Write;
use std::path::Path;

use ghand_core::HandModel;
use glam::DVec3;

use crate::HandModelError;
use crate::files::export;

/// Decimals of the smallest numbers: far below the size of an atom.
const MAX_DECIMALS: i32 = 20;

/// The text of an OBJ file of the model with its vertices at `positions` (`V`, metres).
///
/// Vertices are those of the file that the model came from, in that file's order, so that the mesh can be matched to
/// it; a model without a file has its own order. Nine significant digits are more than an f32 has. UVs are measured
/// from the bottom, as usual in OBJ.
///
/// # Errors
/// [`HandModelError::Invalid`] if the model breaks its invariants, or `positions` are not finite or not one per vertex.
pub fn obj_text(model: &HandModel, positions: &[DVec3]) -> Result<String, HandModelError> {
    export::check(model, positions)?;
    let order = file_order(model);
    let mut first_of_vertex = vec![u32::MAX; model.vertices.len()];
    for (file_vertex, &vertex) in order.iter().enumerate().rev() {
        first_of_vertex[vertex as usize] = file_vertex as u32;
    }
    let name: String = model.name.chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
    let mut text = format!("# {name} (metres)\n");
    for &vertex in order.iter() {
        let [x, y, z] = positions[vertex as usize].to_array().map(decimal);
        push(&mut text, format_args!("v {x} {y} {z}\n"));
    }
    for uv in &model.uvs {
        push(&mut text, format_args!("vt {} {}\n", decimal(uv.x), decimal(1.0 - uv.y)));
    }
    for (face, face_uv) in model.faces.iter().zip(&model.face_uvs) {
        text.push('f');
        for (&vertex, &uv) in face.iter().zip(face_uv) {
            // The UV points of a glTF file are its vertices, so that each corner's copy of a split vertex is known.
            let own = order.get(uv as usize) == Some(&vertex);
            let file_vertex = if own { uv } else { first_of_vertex[vertex as usize] };
            push(&mut text, format_args!(" {}/{}", file_vertex + 1, uv + 1));
        }
        text.push('\n');
    }
    Ok(text)
}

/// Writes [`obj_text`] to a file atomically.
///
/// # Errors
/// As for [`obj_text`]; [`HandModelError::Write`] if the file cannot be written.
pub fn write_obj(path: &Path, model: &HandModel, positions: &[DVec3]) -> Result<(), HandModelError> {
    let text = obj_text(model, positions)?;
    export::write(path, text.as_bytes())
}

/// The model's vertex at each vertex of the file.
fn file_order(model: &HandModel) -> Vec<u32> {
    let mut present = vec![false; model.vertices.len()];
    for &vertex in &model.source_vertices {
        present[vertex as usize] = true;
    }
    if present.iter().all(|p| *p) { model.source_vertices.clone() } else { (0..model.vertices.len() as u32).collect() }
}

/// Nine significant digits without an exponent, which some readers do not know.
fn decimal(value: f64) -> String {
    let scientific = format!("{value:.8e}");
    let exponent: i32 = scientific.rsplit('e').next().and_then(|e| e.parse().ok()).unwrap_or(0);
    let decimals = (8 - exponent).clamp(0, MAX_DECIMALS) as usize;
    let fixed = format!("{value:.decimals$}");
    if decimals == 0 { fixed } else { fixed.trim_end_matches('0').trim_end_matches('.').to_string() }
}

/// Appends; writing to a string cannot fail.
fn push(text: &mut String, part: std::fmt::Arguments) {
    let _ = text.write_fmt(part);
}

#[cfg(test)]
mod tests;

//! Wavefront OBJ: writes posed hands, and reads the texture coordinates that a MANO model lacks.

use std::fmt::Write;
use std::io::{self, Read};
use std::path::Path;

use glam::{DVec2, DVec3};

use super::{HandModel, HandModelError};
use crate::atomic_file::write_atomically;

/// Writes a hand with its vertices at `positions` (metres, `V`), whole or not at all.
///
/// The vertices are those of the file that the model came from, in its order, with nine significant digits; triangles
/// keep their orientation and have texture coordinates (with v upwards, as is usual in OBJ files).
///
/// # Errors
/// Any error of the file system; `path` is then as it was before.
pub fn write_obj(path: &Path, model: &HandModel, positions: &[DVec3]) -> io::Result<()> {
    write_atomically(path, obj_text(model, positions).as_bytes())
}

fn obj_text(model: &HandModel, positions: &[DVec3]) -> String {
    let mut text = String::from("# metres\n");
    let mut line = |kind: &str, numbers: &[f64]| {
        text.push_str(kind);
        for number in numbers {
            text.push(' ');
            push_significant(&mut text, *number);
        }
        text.push('\n');
    };
    let file_vertices: Vec<DVec3> = match model.source_vertices.as_slice() {
        [] => positions.to_vec(),
        split => split.iter().map(|&i| positions[i as usize]).collect(),
    };
    file_vertices.iter().for_each(|v| line("v", &v.to_array()));
    model.uvs.iter().for_each(|uv| line("vt", &[uv.x, 1.0 - uv.y]));
    // Where seams are split, a vertex of the file and its UV point have one number.
    let faces = if model.source_vertices.is_empty() { &model.faces } else { &model.face_uvs };
    for (face, uvs) in faces.iter().zip(&model.face_uvs) {
        text.push('f');
        for (vertex, uv) in face.iter().zip(uvs) {
            // Writing to a string cannot fail.
            let _ = write!(text, " {}/{}", vertex + 1, uv + 1);
        }
        text.push('\n');
    }
    text
}

/// A decimal number of nine significant digits, which tell two f32 apart.
fn push_significant(text: &mut String, number: f64) {
    let digits_before_point = if number == 0.0 { 0.0 } else { number.abs().log10().floor() + 1.0 };
    let decimals = (9.0 - digits_before_point).clamp(0.0, 320.0) as usize;
    let _ = write!(text, "{number:.decimals$}");
}

/// Texture coordinates of a mesh with the triangles that they belong to.
#[derive(Debug, Clone, PartialEq)]
pub struct ObjUvs {
    /// Triangles as vertex indices.
    pub faces: Vec<[u32; 3]>,
    /// UV points, (0, 0) at the first row and column of a texture.
    pub uvs: Vec<DVec2>,
    /// Triangles as indices into `uvs`.
    pub face_uvs: Vec<[u32; 3]>,
}

/// Most bytes of an OBJ file: some hundred times what a hand takes.
const MAX_BYTES: u64 = 1 << 26;

/// Reads the faces with their texture coordinates of an OBJ file for a mesh of `vertex_count` vertices. Polygons become
/// fans of triangles.
///
/// # Errors
/// [`HandModelError::Io`] when the file cannot be read; [`HandModelError::Invalid`] names the line when it is not an OBJ
/// of that mesh, has faces without texture coordinates, or is larger than 64 MiB.
pub fn read_obj_uvs(path: &Path, vertex_count: usize) -> Result<ObjUvs, HandModelError> {
    let failed = |source| HandModelError::Io { path: path.to_path_buf(), source };
    let mut bytes = Vec::new();
    std::fs::File::open(path).and_then(|file| file.take(MAX_BYTES + 1).read_to_end(&mut bytes)).map_err(failed)?;
    let result = match std::str::from_utf8(&bytes) {
        _ if bytes.len() as u64 > MAX_BYTES => Err(("file".into(), format!("is larger than {MAX_BYTES} bytes"))),
        Ok(text) => parse(text, vertex_count),
        Err(_) => Err(("file".into(), "is not text; give a Wavefront OBJ file".into())),
    };
    result.map_err(|(field, problem)| HandModelError::Invalid { origin: path.display().to_string(), field, problem })
}

fn parse(text: &str, vertex_count: usize) -> Result<ObjUvs, (String, String)> {
    let mut found = ObjUvs { faces: vec![], uvs: vec![], face_uvs: vec![] };
    let mut vertices = 0;
    // A backslash at its end continues a line.
    let joined = text.replace("\\\r\n", " ").replace("\\\n", " ");
    for (number, line) in joined.lines().enumerate() {
        let fail = |problem: String| Err((format!("line {}", number + 1), problem));
        let line = line.split('#').next().unwrap_or_default();
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => vertices += 1,
            Some("vt") => {
                let mut value = || words.next().and_then(|word| word.parse::<f64>().ok()).filter(|v| v.is_finite());
                match (value(), value()) {
                    (Some(u), Some(v)) => found.uvs.push(DVec2::new(u, 1.0 - v)),
                    _ => return fail("has no two finite texture coordinates".into()),
                }
            }
            Some("f") => {
                let mut corners = Vec::new();
                for word in words {
                    let mut parts = word.split('/');
                    let vertex = index(parts.next(), vertices);
                    let uv = index(parts.next(), found.uvs.len());
                    match (vertex, uv) {
                        (Some(vertex), Some(uv)) => corners.push((vertex, uv)),
                        (Some(_), None) => {
                            return fail(format!("{word:?} has no texture coordinates; unwrap the mesh and save them"));
                        }
                        (None, _) => return fail(format!("{word:?} names no vertex of the {vertices} before it")),
                    }
                }
                if corners.len() < 3 {
                    return fail(format!("a face has {} corners", corners.len()));
                }
                for pair in corners[1..].windows(2) {
                    let fan = [corners[0], pair[0], pair[1]];
                    found.faces.push(fan.map(|(vertex, _)| vertex));
                    found.face_uvs.push(fan.map(|(_, uv)| uv));
                }
            }
            _ => {}
        }
    }
    if vertices != vertex_count {
        return Err((
            "v".into(),
            format!("has {vertices} vertices, the hand model {vertex_count}; give the OBJ of the same mesh"),
        ));
    }
    if found.faces.is_empty() {
        return Err(("f".into(), "are missing; save the mesh with its faces".into()));
    }
    Ok(found)
}

/// A one-based index, or one that counts back from the last of `count`, as a zero-based one.
fn index(word: Option<&str>, count: usize) -> Option<u32> {
    let number: i64 = word?.parse().ok()?;
    let count = i64::try_from(count).ok()?;
    let zero_based = if number < 0 { count.checked_add(number)? } else { number - 1 };
    u32::try_from(zero_based).ok().filter(|_| (0..count).contains(&zero_based))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hand_model::procedural::ProceduralHand;

    #[test]
    fn what_is_written_is_read_back() {
        let hand = ProceduralHand { detail: 1, ..Default::default() }.build().unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("hand.obj");
        write_obj(&path, &hand, &hand.vertices).unwrap();
        let back = read_obj_uvs(&path, hand.vertices.len()).unwrap();
        assert_eq!((&back.faces, &back.face_uvs), (&hand.faces, &hand.face_uvs));
        assert!(back.uvs.iter().zip(&hand.uvs).all(|(a, b)| (*a - *b).length() < 1e-8));
        let text = std::fs::read_to_string(&path).unwrap();
        let positions = text
            .lines()
            .filter_map(|line| line.strip_prefix("v "))
            .map(|line| DVec3::from_slice(&line.split(' ').map(|word| word.parse().unwrap()).collect::<Vec<f64>>()));
        for (a, b) in positions.zip(&hand.vertices) {
            assert!((a - *b).abs().cmple(b.abs() * 5e-9).all(), "{a} {b}");
        }
    }

    #[test]
    fn numbers_have_nine_significant_digits() {
        let written = |number: f64| {
            let mut text = String::new();
            push_significant(&mut text, number);
            text
        };
        assert_eq!(written(0.0123456789123), "0.0123456789");
        assert_eq!(written(-12.3456789123), "-12.3456789");
        assert_eq!(written(1e-9), "0.00000000100000000");
        assert_eq!(written(0.0), "0.000000000");
        assert_eq!(written(1234567891234.0), "1234567891234");
    }

    #[test]
    fn vertices_split_at_seams_in_the_file_are_written_in_its_order() {
        let mut hand = ProceduralHand { detail: 1, ..Default::default() }.build().unwrap();
        // As a glTF file would have it: a vertex for each UV point.
        let mut split = vec![0; hand.uvs.len()];
        for (face, uvs) in hand.faces.iter().zip(&hand.face_uvs) {
            face.iter().zip(uvs).for_each(|(vertex, uv)| split[*uv as usize] = *vertex);
        }
        hand.source_vertices = split;
        let text = obj_text(&hand, &hand.vertices);
        assert_eq!(text.lines().filter(|line| line.starts_with("v ")).count(), hand.uvs.len());
        let [a, b, c] = hand.face_uvs[0].map(|i| i + 1);
        assert!(text.contains(&format!("\nf {a}/{a} {b}/{b} {c}/{c}\n")));
    }

    #[test]
    fn polygons_negative_indices_comments_and_continued_lines_are_read() {
        let text = "# a square\r\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0 # corner\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 0.25 0\n\
                    vn 0 0 1\nf 1/1/1 2/2/1 \\\n 3/3/1 -1/-1/-1\n";
        let found = parse(text, 4).unwrap();
        assert_eq!(found.faces, [[0, 1, 2], [0, 2, 3]]);
        assert_eq!(found.face_uvs, found.faces);
        assert_eq!(found.uvs[3], DVec2::new(0.0, 0.75));
    }

    #[test]
    fn what_does_not_fit_is_refused_with_its_line() {
        let square = "v 0 0 0\nv 1 0 0\nv 1 1 0\nvt 0 0\n";
        for (more, expected) in [
            ("", "are missing"),
            ("f 1/1 2/1\n", "line 5: a face has 2 corners"),
            ("f 1 2 3\n", "line 5: \"1\" has no texture"),
            ("f 1/1 2/1 4/1\n", "line 5: \"4/1\" names no vertex"),
            ("f 1/1 2/1 -4/1\n", "names no vertex"),
            ("f 1/1 2/1 3/9\n", "\"3/9\" has no texture"),
            ("f 1/1 2/1 99999999999999999999/1\n", "names no vertex"),
            ("vt 0\n", "line 5: has no two finite"),
            ("vt 0 nan\n", "line 5: has no two finite"),
            ("v 0 0 0\nf 1/1 2/1 3/1\n", "has 4 vertices, the hand model 3"),
        ] {
            let (field, problem) = parse(&format!("{square}{more}"), 3).unwrap_err();
            assert!(format!("{field}: {problem}").contains(expected), "wanted {expected:?}, got {field}: {problem}");
        }
    }
}

//! Reads MANO hand models (Romero, Tzionas and Black, "Embodied Hands", 2017) from the user's own files, and models of
//! other rigs stored in the same way.
//!
//! Accepts the pickle as published, pickles of later releases of Python and its libraries in any protocol, with or
//! without chumpy's wrappers, and `.npz` archives with the same keys. Nothing that a file names is executed.

mod body;
mod build;
mod named_arrays;
mod side;

use std::path::Path;

use ghand_core::{HandModel, Side};
use ghand_files::input_file;
use glam::DVec3;

use crate::HandModelError;
use crate::surface::uv_atlas::build_atlas;
pub use named_arrays::NamedArrays;

/// MANO's joints in MANO's order.
pub const JOINT_NAMES: [&str; 16] = [
    "wrist", "index1", "index2", "index3", "middle1", "middle2", "middle3", "pinky1", "pinky2", "pinky3", "ring1",
    "ring2", "ring3", "thumb1", "thumb2", "thumb3",
];

/// Parents of [`JOINT_NAMES`].
pub const PARENTS: [Option<usize>; 16] = [
    None,
    Some(0),
    Some(1),
    Some(2),
    Some(0),
    Some(4),
    Some(5),
    Some(0),
    Some(7),
    Some(8),
    Some(0),
    Some(10),
    Some(11),
    Some(0),
    Some(13),
    Some(14),
];

/// Remedy for a file that is not a MANO model.
const REMEDY: &str = "pass MANO_RIGHT.pkl or MANO_LEFT.pkl as downloaded";

/// Largest file in bytes: twice the size of a whole body's model.
const MAX_BYTES: usize = 1 << 28;

/// What to do about the bug of the published left model, whose shape directions have the x components of the right
/// hand.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum LeftShapes {
    /// Negate the x components if the file has the bug.
    #[default]
    Fixed,
    /// Keep the shape directions, for shape parameters that were fitted with them.
    AsPublished,
}

/// Information that a MANO file does not contain.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct ManoOptions {
    /// Which hand it is; by default decided by the file's name, else by the geometry.
    pub side: Option<Side>,
    /// What to do about the bug of the published left model.
    pub left_shapes: LeftShapes,
}

/// A hand model with remarks on its file for the user.
#[derive(Debug, Clone, PartialEq)]
pub struct ManoFile {
    /// The hand.
    pub model: HandModel,
    /// Whether the file has the bug of the published left model. The model's shape directions are corrected unless
    /// [`LeftShapes::AsPublished`] was requested.
    pub has_left_shape_bug: bool,
    /// Unusual properties of the file, one sentence each.
    pub warnings: Vec<String>,
}

/// Reads a MANO model from a pickle or an `.npz` archive, recognised from its contents.
///
/// Keys: `v_template` (V, 3), `f` (F, 3), `weights` (V, n_b), `kintree_table` (2, n_b), `J_regressor` (n_b, V; sparse
/// or not), `shapedirs` (V, 3, n_s), `posedirs` (V, 3, 9 (n_b - 1)), and optionally `hands_mean` (3 (n_b - 1)) and
/// `hands_components` (c, 3 (n_b - 1)); others are ignored. Units and axes are the file's (MANO: metres). The rest
/// joints are regressed from `v_template`, so they are those of shape 0 to the last bit. 16 joints with MANO's
/// hierarchy get MANO's names, those of other rigs are called `joint0`, `joint1` and so on.
///
/// Weights of a vertex that do not sum to 1 by more than rounding are divided by their sum. The side is that of the
/// options, else "left" or "right" in the file's name, else that on which the thumb bends to the palm. The bug of the
/// published left model is detected by a comparison with the right model, if a file of the same name with "right" for
/// "left" is beside it, else from the correlation of the hand's length and breadth.
///
/// # Errors
/// [`HandModelError::Io`] if a file cannot be read. [`HandModelError::Invalid`] names the file, the key and a remedy
/// if it is larger than 256 MiB, damaged, the model of a whole body, names a class or function that no hand model needs, lacks a key, or has an
/// invalid shape, index or number.
pub fn read_mano(path: &Path, options: &ManoOptions) -> Result<ManoFile, HandModelError> {
    let bytes = read_file(path)?;
    // An unreadable right model is not a reason to reject the left one.
    let right = side::right_beside(path).and_then(|right| read_file(&right).ok());
    read_mano_bytes(&path.display().to_string(), &bytes, right.as_deref(), options)
}

/// Reads the bytes of a file as [`read_mano`] does. `name` is the file's, for messages and for the side;
/// `right` are the bytes of the matching right model, to compare a left model with.
///
/// # Errors
/// As in [`read_mano`].
pub fn read_mano_bytes(
    name: &str,
    bytes: &[u8],
    right: Option<&[u8]>,
    options: &ManoOptions,
) -> Result<ManoFile, HandModelError> {
    let mut file = read_without_atlas(name, bytes, right, options)?;
    let model = &mut file.model;
    let atlas = build_atlas(&model.vertices, &model.faces)
        .map_err(|problem| HandModelError::invalid(model.name.clone(), "f", problem))?;
    (model.uvs, model.face_uvs) = (atlas.uvs, atlas.face_uvs);
    model.validate()?;
    Ok(file)
}

/// The model without texture coordinates, which files do not have; not validated.
fn read_without_atlas(
    name: &str,
    bytes: &[u8],
    right: Option<&[u8]>,
    options: &ManoOptions,
) -> Result<ManoFile, HandModelError> {
    let mut fields = NamedArrays::open(name, bytes, REMEDY)?;
    body::reject_body(&mut fields)?;
    let mut warnings = Vec::new();
    let mut model = build::build(&mut fields, &mut warnings)?;
    model.side = side::find_side(&model, name, options.side, &mut warnings);
    let has_left_shape_bug = model.side == Side::Left && side::has_left_shape_bug(&model, right, &mut warnings);
    if has_left_shape_bug && options.left_shapes == LeftShapes::Fixed {
        model.shape_directions.iter_mut().for_each(|direction| direction.x = -direction.x);
    }
    Ok(ManoFile { model, has_left_shape_bug, warnings })
}

fn read_file(path: &Path) -> Result<Vec<u8>, HandModelError> {
    let failed = |error| HandModelError::Io { path: path.to_path_buf(), source: error };
    input_file::read(path, MAX_BYTES as u64).map_err(failed)?.ok_or_else(|| {
        let problem = format!("is larger than {MAX_BYTES} bytes; pass a MANO model, or store less in it");
        HandModelError::invalid(path.display().to_string(), "hand model", problem)
    })
}

fn dvec3(v: &[f64; 3]) -> DVec3 {
    DVec3::from_array(*v)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

    use ghand_test_support::mano_files::hands::{Hand, as_npz, as_pickle};

    use super::*;

    #[test]
    fn a_file_with_any_byte_changed_is_read_or_an_error() {
        let entries = Hand::small().published();
        let options = ManoOptions { side: Some(Side::Right), ..Default::default() };
        for mut bytes in [as_pickle(&entries), as_npz(&entries, false), as_npz(&entries, true)] {
            assert!(read_without_atlas("some/file", &bytes, None, &options).is_ok());
            for at in 0..bytes.len() {
                for flip in [0xff, 0x01] {
                    bytes[at] ^= flip;
                    // Neither panics.
                    let read = read_without_atlas("some/file", &bytes, None, &options);
                    let _ = read.map(|file| file.model.validate());
                    bytes[at] ^= flip;
                }
            }
        }
    }
}

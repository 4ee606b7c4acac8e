//! Reads any hand model file, recognised from its contents.

use std::path::{Path, PathBuf};

use ghand_core::HandModel;

use super::gltf::read_gltf_with_warnings;
use super::mano::{LeftShapes, ManoOptions, read_mano_with_warnings};
use crate::HandModelError;

/// Information that the file does not contain.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct ReadOptions {
    /// OBJ file with the UVs of a MANO model, which has none of its own. Without it, UVs are generated.
    pub uv_obj: Option<PathBuf>,
    /// What to do about the bug of the published MANO left hand.
    pub left_shapes: LeftShapes,
}

/// A hand model with remarks on its file.
#[derive(Debug, Clone, PartialEq)]
pub struct HandModelFile {
    /// The hand model.
    pub model: HandModel,
    /// Kind of the file, for display.
    pub kind: &'static str,
    /// Unusual or corrected properties of the file.
    pub warnings: Vec<String>,
}

/// The kind of a MANO file.
pub const MANO_KIND: &str = "MANO model";

/// Reads a rigged glTF hand (`.glb`, `.gltf`), or else a MANO file (a pickle or an `.npz` archive).
///
/// ```no_run
/// use ghand_hand_model::read::{ReadOptions, read_hand_model};
///
/// let file = read_hand_model("MANO_RIGHT.pkl".as_ref(), &ReadOptions::default())?;
/// println!("{}: {} vertices", file.kind, file.model.vertices.len());
/// # Ok::<(), ghand_hand_model::HandModelError>(())
/// ```
///
/// # Errors
/// [`HandModelError`] names the file, the unusable part and a remedy.
pub fn read_hand_model(path: &Path, options: &ReadOptions) -> Result<HandModelFile, HandModelError> {
    if is_gltf(path) {
        let file = read_gltf_with_warnings(path)?;
        return Ok(HandModelFile { model: file.model, kind: "rigged glTF hand", warnings: file.warnings });
    }
    let options = ManoOptions { uv_obj: options.uv_obj.clone(), side: None, left_shapes: options.left_shapes };
    let file = read_mano_with_warnings(path, &options)?;
    let mut warnings = file.warnings;
    if file.has_left_shape_bug {
        warnings.push(match options.left_shapes {
            LeftShapes::Fixed => {
                "the shape directions of this left hand had the x components of a right one, a known bug; \
                 corrected"
                    .into()
            }
            LeftShapes::AsPublished => {
                "the shape directions of this left hand have the x components of a right one, a known bug; kept as \
                 requested"
                    .into()
            }
        });
    }
    Ok(HandModelFile { model: file.model, kind: MANO_KIND, warnings })
}

/// From the file's name, else from its first bytes. The reader reports a file that cannot be opened.
fn is_gltf(path: &Path) -> bool {
    use std::io::Read;
    let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase());
    let mut start = Vec::new();
    let read = ghand_files::input_file::open(path).and_then(|file| file.take(4).read_to_end(&mut start));
    matches!(extension.as_deref(), Some("glb" | "gltf")) || (read.is_ok() && start == b"glTF")
}

//! Reads any hand model file, recognised from its contents.

use std::path::{Path, PathBuf};

use ghand_core::{HandModel, Side};

use super::gltf::read_gltf;
use super::mano::{LeftShapes, ManoOptions, read_mano};
use crate::HandModelError;
use crate::inspection;

/// A hand model with remarks on its file.
#[derive(Debug, Clone, PartialEq)]
pub struct HandModelFile {
    /// The hand model.
    pub model: HandModel,
    /// Kind of the file, for display.
    pub kind: &'static str,
    /// Unusual or corrected properties of the file and of the model ([`inspection::warnings`]).
    pub warnings: Vec<String>,
}

/// The kind of a MANO file.
pub const MANO_KIND: &str = "MANO model";

/// Reads a rigged glTF hand (`.glb`, `.gltf`), or else a MANO file (a pickle or an `.npz` archive). `FILE:left` and
/// `FILE:right` are one hand of a file with both ([`file_and_side`]). `left_shapes` says what to do about the bug of the
/// published MANO left hand.
///
/// ```no_run
/// use ghand_hand_model::files::mano::LeftShapes;
/// use ghand_hand_model::files::read::read_hand_model;
///
/// let file = read_hand_model("MANO_RIGHT.pkl".as_ref(), LeftShapes::Fixed)?;
/// println!("{}: {} vertices", file.kind, file.model.vertices.len());
/// # Ok::<(), ghand_hand_model::HandModelError>(())
/// ```
///
/// # Errors
/// [`HandModelError`] names the file, the unusable part and a remedy.
pub fn read_hand_model(path: &Path, left_shapes: LeftShapes) -> Result<HandModelFile, HandModelError> {
    let (path, side) = file_and_side(path);
    let file = if is_gltf(&path) { read_gltf_hand(&path, side)? } else { read_mano_hand(&path, side, left_shapes)? };
    match side {
        Some(side) if side != file.model.side => {
            let problem = format!("has no {side} hand, but a {} one; omit :{side}", file.model.side);
            Err(HandModelError::invalid(path.display().to_string(), "hand model", problem))
        }
        _ => Ok(file),
    }
}

/// The file and the side that `FILE:left` or `FILE:right` names. An existing path is used unchanged, including colons.
pub fn file_and_side(path: &Path) -> (PathBuf, Option<Side>) {
    let name = path.to_str().filter(|_| !path.exists()).unwrap_or_default();
    match name.rsplit_once(':') {
        Some((file, "left")) => (file.into(), Some(Side::Left)),
        Some((file, "right")) => (file.into(), Some(Side::Right)),
        _ => (path.to_path_buf(), None),
    }
}

/// Reads a rigged glTF hand; of a file with both hands that of the wanted side, else the right one.
///
/// # Errors
/// As in [`read_gltf`].
pub fn read_gltf_hand(path: &Path, wanted: Option<Side>) -> Result<HandModelFile, HandModelError> {
    let file = read_gltf(path, wanted)?;
    let warnings = [file.warnings, inspection::warnings(&file.model)].concat();
    Ok(HandModelFile { model: file.model, kind: "rigged glTF hand", warnings })
}

fn read_mano_hand(path: &Path, side: Option<Side>, left_shapes: LeftShapes) -> Result<HandModelFile, HandModelError> {
    let file = read_mano(path, &ManoOptions { side, left_shapes })?;
    let mut warnings = file.warnings;
    if file.has_left_shape_bug {
        warnings.push(match left_shapes {
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
    warnings.extend(inspection::warnings(&file.model));
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::builtin::builtin_hand;
    use crate::files::rigged_glb::RiggedHand;

    #[test]
    fn a_side_after_the_name_chooses_a_hand_unless_that_is_a_files_name() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("hand.glb");
        let left = builtin_hand(Side::Left).unwrap();
        let glb = RiggedHand::default().document(&left).unwrap().finish().unwrap();
        std::fs::write(&path, glb).unwrap();
        let named = |side: &str| PathBuf::from(format!("{}:{side}", path.display()));
        let read = |path: &Path| read_hand_model(path, LeftShapes::Fixed);
        assert_eq!(read(&named("left")).unwrap().model, read(&path).unwrap().model);
        let refused = read(&named("right")).unwrap_err().to_string();
        assert!(refused.contains("hand.glb: hand model: has no right hand, but a left one; omit :right"), "{refused}");
        assert_eq!(file_and_side(&named("front")), (named("front"), None));
        std::fs::copy(&path, named("right")).unwrap();
        assert_eq!(read(&named("right")).unwrap().model.side, Side::Left);
    }
}

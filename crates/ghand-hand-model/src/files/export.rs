//! Shared parts of all exports of a posed hand.

use std::path::Path;

use ghand_core::HandModel;
use ghand_files::atomic_file::write_atomically;
use glam::DVec3;

use crate::HandModelError;

/// Checks a model and the positions of its vertices (`V`, metres).
pub(crate) fn check(model: &HandModel, positions: &[DVec3]) -> Result<(), HandModelError> {
    model.validate()?;
    let problem = if positions.len() != model.vertices.len() {
        format!("{} of them, the model has {} vertices", positions.len(), model.vertices.len())
    } else if let Some(k) = positions.iter().position(|p| !p.as_vec3().is_finite()) {
        format!("that of vertex {k} is too large for the file; check the pose")
    } else {
        return Ok(());
    };
    Err(HandModelError::invalid(model.name.clone(), "positions", problem))
}

/// Writes a file atomically.
pub(crate) fn write(path: &Path, contents: &[u8]) -> Result<(), HandModelError> {
    write_atomically(path, contents).map_err(|error| HandModelError::Write { path: path.to_path_buf(), source: error })
}

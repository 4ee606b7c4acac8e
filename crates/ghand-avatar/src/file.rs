//! The avatar file `*.ghand`: a safetensors file with a JSON block in its metadata.

mod light;
mod metadata;
mod parts;
mod tensors;

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use ghand_files::atomic_file::write_atomically;
use ghand_files::input_file;
use metadata::Metadata;
use safetensors::serialize;
use safetensors::tensor::TensorView;
pub(crate) use tensors::{Reader, Tensors};

use crate::avatar::Avatar;
use crate::gaussian_glb::avatar_in;

/// Maximum file size, bytes; the largest avatars have a few hundred million.
const LARGEST_FILE: u64 = 1 << 32;
/// Key of the JSON block in the file's metadata.
const METADATA_KEY: &str = "ghand";

/// Why an avatar file could not be read or written.
#[derive(Debug, thiserror::Error)]
pub enum AvatarFileError {
    /// Reading or writing failed.
    #[error("{path}: cannot {action} the avatar: {source}")]
    Io {
        /// The file.
        path: PathBuf,
        /// "read" or "write".
        action: &'static str,
        /// The cause.
        source: std::io::Error,
    },
    /// The avatar was not written, because [`Avatar::load`] would reject it.
    #[error("{path}: not written, because it would not be readable: {field} {problem}")]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// The part of the avatar that is wrong.
        field: String,
        /// What is wrong.
        problem: String,
    },
    /// The contents are unusable.
    #[error("{path}: {field}: {problem}")]
    Invalid {
        /// The file.
        path: PathBuf,
        /// The part that is wrong.
        field: String,
        /// What is wrong and what to do.
        problem: String,
    },
}

impl Avatar {
    /// Writes the avatar to a file, atomically. The bytes are first read back with the reader of [`Avatar::load`], so
    /// that it accepts every written file.
    ///
    /// # Errors
    /// [`AvatarFileError::Unreadable`] if [`Avatar::load`] would reject the avatar, [`AvatarFileError::Io`] if the file
    /// cannot be written. An existing file is then unchanged.
    pub fn save(&self, path: &Path) -> Result<(), AvatarFileError> {
        let bytes = self.to_bytes(path).and_then(|bytes| from_bytes(path, &bytes).map(|_| bytes));
        let bytes = bytes.map_err(|error| match error {
            AvatarFileError::Invalid { path, field, problem } => AvatarFileError::Unreadable { path, field, problem },
            other => other,
        })?;
        write_atomically(path, &bytes).map_err(|source| AvatarFileError::Io {
            path: path.into(),
            action: "write",
            source,
        })
    }

    /// Size of the avatar's file, bytes.
    ///
    /// # Errors
    /// [`AvatarFileError::Invalid`] if its parts do not fit into a file.
    pub fn file_size(&self) -> Result<usize, AvatarFileError> {
        self.to_bytes(Path::new("avatar")).map(|bytes| bytes.len())
    }

    /// The bytes of the avatar's file.
    pub(crate) fn to_bytes(&self, path: &Path) -> Result<Vec<u8>, AvatarFileError> {
        let invalid = |problem: String| AvatarFileError::Invalid { path: path.into(), field: "avatar".into(), problem };
        let metadata = serde_json::to_string(&Metadata::of(self)).map_err(|e| invalid(e.to_string()))?;
        let tensors = parts::write(self);
        let mut views = Vec::new();
        for (name, dtype, shape, bytes) in &tensors.named {
            let view = TensorView::new(*dtype, shape.clone(), bytes).map_err(|e| invalid(e.to_string()))?;
            views.push((name.as_str(), view));
        }
        let block = HashMap::from([(METADATA_KEY.to_owned(), metadata)]);
        serialize(views, Some(block)).map_err(|e| invalid(e.to_string()))
    }

    /// Reads an avatar from a file and validates it completely: a `.ghand` file, or a glTF file that has one
    /// ([`crate::gaussian_glb`]).
    ///
    /// # Errors
    /// [`AvatarFileError`] names the file, the field and what is wrong with it.
    pub fn load(path: &Path) -> Result<Avatar, AvatarFileError> {
        let io = |source| AvatarFileError::Io { path: path.into(), action: "read", source };
        let bytes = input_file::read(path, LARGEST_FILE).map_err(io)?.ok_or_else(|| too_large(path))?;
        from_bytes(path, &bytes)
    }

    /// Reads an avatar from the bytes of its file, as [`Avatar::load`] does. `name` is for messages.
    ///
    /// # Errors
    /// As [`Avatar::load`].
    pub fn from_bytes(name: &Path, bytes: &[u8]) -> Result<Avatar, AvatarFileError> {
        from_bytes(name, bytes)
    }
}

fn too_large(path: &Path) -> AvatarFileError {
    let problem = format!("is larger than {} GiB, the limit for avatars", LARGEST_FILE >> 30);
    AvatarFileError::Invalid { path: path.into(), field: "file".into(), problem }
}

/// Parses and validates the bytes of an avatar file.
fn from_bytes(path: &Path, bytes: &[u8]) -> Result<Avatar, AvatarFileError> {
    if bytes.len() as u64 > LARGEST_FILE {
        return Err(too_large(path));
    }
    let bytes = match avatar_in(bytes) {
        Some(inside) => {
            inside.map_err(|(field, problem)| AvatarFileError::Invalid { path: path.into(), field, problem })?
        }
        None => bytes,
    };
    Reader::new(path, bytes)?.avatar()
}

#[cfg(test)]
mod tests;

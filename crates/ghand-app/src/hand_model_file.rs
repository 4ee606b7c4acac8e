//! Options that select a hand model.

use std::path::{Path, PathBuf};

use anyhow::bail;
use clap::Args;
use ghand_avatar::Avatar;
use ghand_hand_model::mano::LeftShapes;
use ghand_hand_model::procedural::ProceduralHand;
use ghand_hand_model::read::{HandModelFile, ReadOptions, read_hand_model};

use crate::file_kind::{FileKind, file_kind};

/// How to read a hand model.
#[derive(Debug, Clone, Default, Args)]
pub struct HandModelArgs {
    /// OBJ file with UVs for a MANO model, which has none [default: generated]
    #[arg(long, value_name = "FILE")]
    uv: Option<PathBuf>,
    /// Keep the shape directions of a MANO left hand as published, mirrored by mistake [default: correct them]
    #[arg(long)]
    left_shapes_as_published: bool,
}

impl HandModelArgs {
    /// Reads the hand model, or the template mesh of an avatar, or builds the built-in hand if there is no file.
    ///
    /// # Errors
    /// An error that names the file, if it is not a usable hand model or avatar.
    pub fn load(&self, path: Option<&PathBuf>) -> anyhow::Result<HandModelFile> {
        let Some(path) = path else {
            let model = ProceduralHand::default().build()?;
            return Ok(HandModelFile { model, kind: "built-in hand", warnings: vec![] });
        };
        if let (FileKind::Avatar, Some(uv)) = (file_kind(path), &self.uv) {
            bail!("--uv {}: {} is an avatar, which has UVs; omit --uv", uv.display(), path.display());
        }
        let left_shapes = if self.left_shapes_as_published { LeftShapes::AsPublished } else { LeftShapes::Fixed };
        load_hand_model(path, &ReadOptions { uv_obj: self.uv.clone(), left_shapes })
    }
}

/// Reads a hand model file of any kind, or the template mesh of an avatar.
///
/// # Errors
/// As in [`HandModelArgs::load`].
pub fn load_hand_model(path: &Path, options: &ReadOptions) -> anyhow::Result<HandModelFile> {
    match file_kind(path) {
        FileKind::Avatar => {
            let model = Avatar::load(path)?.model;
            Ok(HandModelFile { model, kind: "template mesh of an avatar", warnings: vec![] })
        }
        FileKind::Ply => bail!(
            "{}: is a scene of Gaussians (.ply), not a hand model; give MANO (.pkl, .npz), a rigged glTF hand (.glb, \
             .gltf) or an avatar (.ghand)",
            path.display()
        ),
        FileKind::HandModel | FileKind::Other => Ok(read_hand_model(path, options)?),
    }
}

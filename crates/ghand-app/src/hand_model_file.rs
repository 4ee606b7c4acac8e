//! A hand model that a user names, and how to read it.

use std::path::{Path, PathBuf};

use anyhow::bail;
use clap::Args;
use ghand_avatar::Avatar;
use ghand_core::Side;
use ghand_hand_model::builtin::{HAND_NAMES, builtin_hand, hand_by_name};
use ghand_hand_model::files::mano::LeftShapes;
use ghand_hand_model::files::read::{HandModelFile, MANO_KIND, read_hand_model};
use serde::{Deserialize, Serialize};

use crate::file_kind::{FileKind, file_kind};

/// The kind of a hand that is part of the program.
const HAND_OF_GHAND: &str = "hand of ghand";

/// Options that say how to read a hand model. Part of a run's record on disk.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, Args)]
pub struct HandModelReading {
    /// Keep the shape directions of a MANO left hand as published, mirrored by mistake [default: correct them]
    #[arg(long)]
    pub left_shapes_as_published: bool,
}

impl HandModelReading {
    /// Reads the hand model, or the template mesh of an avatar; the built-in hand if there is no path.
    ///
    /// # Errors
    /// An error that names the file, if it is not a usable hand model or avatar.
    pub fn load(&self, path: Option<&PathBuf>) -> anyhow::Result<HandModelFile> {
        let Some(path) = path else {
            self.refuse_for("the built-in hand is not a MANO model")?;
            return Ok(HandModelFile { model: builtin_hand(Side::Right)?, kind: HAND_OF_GHAND, warnings: vec![] });
        };
        match file_kind(path) {
            _ if is_hand_name(path) => self.refuse_for(&format!("{} is a hand of ghand", path.display()))?,
            FileKind::Avatar => self.refuse_for(&format!("{} is an avatar", path.display()))?,
            _ => {}
        }
        let left_shapes = if self.left_shapes_as_published { LeftShapes::AsPublished } else { LeftShapes::Fixed };
        let file = load_hand_model(path, left_shapes)?;
        if file.kind != MANO_KIND {
            self.refuse_for(&format!("{} is a {}", path.display(), file.kind))?;
        }
        if self.left_shapes_as_published && file.model.side != Side::Left {
            bail!("--left-shapes-as-published: {} is a right hand; omit the option", path.display());
        }
        Ok(file)
    }

    /// Fails if `--left-shapes-as-published` is given, where no MANO model is read because of `reason`.
    ///
    /// # Errors
    /// One sentence that names the option.
    pub fn refuse_for(&self, reason: &str) -> anyhow::Result<()> {
        if self.left_shapes_as_published {
            bail!("--left-shapes-as-published: is for MANO models, and {reason}; omit it");
        }
        Ok(())
    }
}

/// Whether this is the name of a hand that comes with ghand.
pub fn is_hand_name(path: &Path) -> bool {
    path.to_str().is_some_and(|name| HAND_NAMES.contains(&name))
}

/// Reads a hand model file of any kind, the template mesh of an avatar, or a hand that comes with ghand, by its name
/// ([`ghand_hand_model::builtin::HAND_NAMES`]).
///
/// # Errors
/// As in [`HandModelReading::load`].
pub fn load_hand_model(path: &Path, left_shapes: LeftShapes) -> anyhow::Result<HandModelFile> {
    if let Some(model) = path.to_str().and_then(hand_by_name) {
        return Ok(HandModelFile { model: model?, kind: HAND_OF_GHAND, warnings: vec![] });
    }
    match file_kind(path) {
        FileKind::Avatar => {
            let model = Avatar::load(path)?.model;
            Ok(HandModelFile { model, kind: "template mesh of an avatar", warnings: vec![] })
        }
        FileKind::Scene => bail!(
            "{}: is a scene of Gaussians (.ply), not a hand model; give MANO (.pkl, .npz), a rigged glTF hand (.glb, \
             .gltf) or an avatar (.ghand)",
            path.display()
        ),
        FileKind::HandModel | FileKind::Other => Ok(read_hand_model(path, left_shapes)?),
    }
}

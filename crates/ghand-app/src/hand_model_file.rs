//! Which hand model a command works on.

use std::path::PathBuf;

use clap::Args;
use ghand_core::HandModelError;
use ghand_core::hand_model::mano::LeftShapes;
use ghand_core::hand_model::procedural::ProceduralHand;
use ghand_core::hand_model::read::{HandModelFile, ReadOptions, read_hand_model};

/// How to read a hand model.
#[derive(Debug, Clone, Default, Args)]
pub struct HandModelArgs {
    /// OBJ file with UVs for a MANO model, which has none [default: UVs are made]
    #[arg(long, value_name = "FILE")]
    uv: Option<PathBuf>,
    /// Leave the shape directions of a MANO left hand as published, mirrored by mistake [default: mend them]
    #[arg(long)]
    left_shapes_as_published: bool,
}

impl HandModelArgs {
    /// Reads the hand model, or builds the built-in hand if there is no file.
    ///
    /// # Errors
    /// [`HandModelError`] if the file is no usable hand model.
    pub fn load(&self, path: Option<&PathBuf>) -> Result<HandModelFile, HandModelError> {
        let Some(path) = path else {
            let model = ProceduralHand::default().build()?;
            return Ok(HandModelFile { model, kind: "built-in hand", warnings: vec![] });
        };
        let left_shapes = if self.left_shapes_as_published { LeftShapes::AsPublished } else { LeftShapes::Fixed };
        let options = ReadOptions { uv_obj: self.uv.clone(), left_shapes };
        read_hand_model(path, &options)
    }
}

//! Options that say how to read a hand model.

use std::path::PathBuf;

use clap::Args;

use crate::hand_model_file::HandModelReading;

/// How to read a hand model.
#[derive(Debug, Clone, Args)]
pub struct HandModelArgs {
    /// OBJ file with UVs for a MANO model, which has none [default: generated]
    #[arg(long, value_name = "FILE")]
    uv: Option<PathBuf>,
    /// Keep the shape directions of a MANO left hand as published, mirrored by mistake [default: correct them]
    #[arg(long)]
    left_shapes_as_published: bool,
}

impl HandModelArgs {
    /// How to read it.
    pub fn reading(&self) -> HandModelReading {
        HandModelReading { uv: self.uv.clone(), left_shapes_as_published: self.left_shapes_as_published }
    }
}

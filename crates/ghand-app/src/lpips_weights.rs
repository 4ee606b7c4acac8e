//! The weights for LPIPS: built in, or a user's.

use std::path::PathBuf;
use std::sync::Arc;

use anyhow::Context;
use clap::Args;
use ghand_capture::Capture;
use ghand_measure::lpips::{BACKBONE, Lpips};
use serde::{Deserialize, Serialize};

use crate::say;

/// The option that says where the weights for LPIPS are. Part of a run's record on disk.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, Args)]
pub struct LpipsWeights {
    /// Weights for LPIPS, a safetensors file that scripts/lpips_weights.py makes [default: the published ones, built in]
    #[arg(long, value_name = "FILE")]
    pub lpips: Option<PathBuf>,
}

impl LpipsWeights {
    /// The same file from any folder.
    ///
    /// # Errors
    /// If the present folder does not exist any more.
    pub fn absolute(&self) -> std::io::Result<LpipsWeights> {
        Ok(LpipsWeights { lpips: self.lpips.as_ref().map(std::path::absolute).transpose()? })
    }

    /// Reads the file, if one is given, and then says so in one line.
    ///
    /// # Errors
    /// An error that names the file and its problem.
    pub fn load(&self) -> anyhow::Result<Arc<Lpips>> {
        let Some(path) = &self.lpips else { return Ok(Arc::new(Lpips::built_in()?)) };
        let lpips = Lpips::load(path).context("--lpips")?;
        say!("LPIPS: backbone `{BACKBONE}`, from {}", path.display());
        Ok(Arc::new(lpips))
    }
}

/// LPIPS, if all images of a split are large enough for it; else says which camera's are not.
pub fn for_images<'a>(lpips: &'a Lpips, capture: &Capture, split: &str) -> Option<&'a Lpips> {
    for view in capture.splits.get(split).iter().flat_map(|split| &split.views) {
        let camera = &capture.cameras[view.camera];
        if let Err(refusal) = lpips.check_size([camera.width, camera.height]) {
            say!("LPIPS: not computed for the split `{split}`, camera {}: {refusal}", camera.id);
            return None;
        }
    }
    Some(lpips)
}

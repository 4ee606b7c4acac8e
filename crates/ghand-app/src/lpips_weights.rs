//! The weights for LPIPS that a user names.

use std::path::PathBuf;
use std::sync::Arc;

use anyhow::Context;
use ghand_capture::Capture;
use ghand_measure::lpips::{BACKBONE, Lpips};
use serde::{Deserialize, Serialize};

use crate::say;

/// Where the weights for LPIPS are. Part of a run's record on disk.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct LpipsWeights {
    /// A safetensors file; `None`: without LPIPS.
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

    /// Reads the file, if one is given, and says in one line whether LPIPS is on.
    ///
    /// # Errors
    /// An error that names the file and its problem.
    pub fn load(&self) -> anyhow::Result<Option<Arc<Lpips>>> {
        let Some(path) = &self.lpips else {
            say!("LPIPS: off; --lpips FILE turns it on");
            return Ok(None);
        };
        let lpips = Lpips::load(path).context("--lpips")?;
        say!("LPIPS: backbone `{BACKBONE}`, from {}", path.display());
        Ok(Some(Arc::new(lpips)))
    }
}

/// Fails if images of a split are too small for LPIPS.
///
/// # Errors
/// An error that names the camera and its size.
pub fn check_image_sizes(lpips: Option<&Lpips>, capture: &Capture, split: &str) -> anyhow::Result<()> {
    let (Some(lpips), Some(split)) = (lpips, capture.splits.get(split)) else { return Ok(()) };
    for view in &split.views {
        let camera = &capture.cameras[view.camera];
        lpips.check_size([camera.width, camera.height]).with_context(|| format!("camera {}", camera.id))?;
    }
    Ok(())
}

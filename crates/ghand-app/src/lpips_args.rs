//! The option `--lpips`.

use std::path::PathBuf;

use clap::Args;

use crate::lpips_weights::LpipsWeights;

/// Where the weights for LPIPS are.
#[derive(Debug, Clone, Args)]
pub struct LpipsArgs {
    /// Weights for LPIPS, a safetensors file that scripts/lpips_weights.py makes [default: the published ones, built in]
    #[arg(long, value_name = "FILE")]
    pub lpips: Option<PathBuf>,
}

impl LpipsArgs {
    /// The weights.
    pub fn weights(&self) -> LpipsWeights {
        LpipsWeights { lpips: self.lpips.clone() }
    }
}

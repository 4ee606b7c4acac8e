//! The option `--lpips`.

use std::path::PathBuf;

use clap::Args;

use crate::lpips_weights::LpipsWeights;

/// Where the weights for LPIPS are.
#[derive(Debug, Clone, Args)]
pub struct LpipsArgs {
    /// Weights for LPIPS, a safetensors file that scripts/lpips_weights.py makes: adds the figure `lpips` and, in
    /// training, a term of the loss (--set lpips_weight) [default: without LPIPS]
    #[arg(long, value_name = "FILE")]
    pub lpips: Option<PathBuf>,
}

impl LpipsArgs {
    /// The weights.
    pub fn weights(&self) -> LpipsWeights {
        LpipsWeights { lpips: self.lpips.clone() }
    }
}

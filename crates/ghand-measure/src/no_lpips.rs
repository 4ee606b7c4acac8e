//! LPIPS of a program that was built without the feature `networks`: there is none.

#[path = "lpips/pair.rs"]
mod pair;

use std::convert::Infallible;
use std::path::{Path, PathBuf};

pub use pair::{BACKBONE, LpipsError, Pair, SMALLEST_SIDE};

/// Why there is no LPIPS.
#[derive(Debug, thiserror::Error)]
#[error("{0}: this program was built without LPIPS; build it with `--features networks`, or leave out --lpips")]
pub struct LpipsFileError(PathBuf);

/// AlexNet with its weights. There is none.
#[derive(Debug)]
pub struct Lpips(Infallible);

impl Lpips {
    /// Fails.
    ///
    /// # Errors
    /// [`LpipsFileError`] says why.
    pub fn load(path: &Path) -> Result<Lpips, LpipsFileError> {
        Err(LpipsFileError(path.into()))
    }

    /// Whether images of this size are large enough.
    ///
    /// # Errors
    /// None.
    pub fn check_size(&self, _: [u32; 2]) -> Result<(), LpipsError> {
        match self.0 {}
    }

    /// The distance of two pictures.
    ///
    /// # Errors
    /// None.
    pub fn distance(&self, _: &Pair) -> Result<f64, LpipsError> {
        match self.0 {}
    }

    /// The distances of several pictures from one truth.
    ///
    /// # Errors
    /// None.
    pub fn distances<const N: usize>(
        &self,
        _: [u32; 2],
        _: [&[[f32; 3]]; N],
        _: &[[f32; 3]],
    ) -> Result<[f64; N], LpipsError> {
        match self.0 {}
    }

    /// The distance of two pictures, and its gradient.
    ///
    /// # Errors
    /// None.
    pub fn distance_and_gradient(&self, _: &Pair) -> Result<(f64, Vec<[f32; 3]>), LpipsError> {
        match self.0 {}
    }
}

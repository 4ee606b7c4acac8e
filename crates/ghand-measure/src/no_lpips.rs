//! LPIPS of a program that was built without the feature `networks`: there is none.

#[allow(dead_code, reason = "nothing is read into it")]
#[path = "lpips/backbone.rs"]
mod backbone;
#[path = "lpips/pair.rs"]
mod pair;

use std::convert::Infallible;
use std::path::{Path, PathBuf};

pub use backbone::Backbone;
pub use pair::{LpipsError, Pair};

/// Why there is no LPIPS.
#[derive(Debug, thiserror::Error)]
#[error("{0}: this program was built without LPIPS; build it with `--features networks`, or leave out --lpips")]
pub struct LpipsFileError(PathBuf);

/// A backbone with its weights. There is none.
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

    /// The backbone.
    pub fn backbone(&self) -> Backbone {
        match self.0 {}
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

//! LPIPS of a program that was built without the feature `networks`: there is none.

#[allow(dead_code, reason = "nothing is read into it")]
#[path = "lpips/backbone.rs"]
mod backbone;

use std::convert::Infallible;
use std::path::{Path, PathBuf};

pub use backbone::Backbone;

/// Why two pictures could not be compared.
#[derive(Debug, thiserror::Error)]
pub enum LpipsError {
    /// A picture has fewer or more pixels than its size says.
    #[error("a picture of {width} x {height} pixels for LPIPS has {pixels} values")]
    Size {
        /// Width, pixels.
        width: usize,
        /// Height, pixels.
        height: usize,
        /// Number of pixels there are.
        pixels: usize,
    },
    /// A picture is smaller than the backbone can process.
    #[error(
        "LPIPS needs at least {smallest} x {smallest} pixels with the backbone `{backbone}`, but the image has {width} x \
         {height}; use larger images or omit --lpips"
    )]
    TooSmall {
        /// Width, pixels.
        width: u32,
        /// Height, pixels.
        height: u32,
        /// Smallest side, pixels.
        smallest: usize,
        /// The backbone.
        backbone: Backbone,
    },
    /// A tensor could not be read.
    #[error("the LPIPS network failed: {0}")]
    Tensor(String),
}

/// Why there is no LPIPS.
#[derive(Debug, thiserror::Error)]
#[error("{0}: this program was built without LPIPS; build it with `--features networks`, or leave out --lpips")]
pub struct LpipsFileError(PathBuf);

/// A backbone with its weights. There is none.
#[derive(Debug)]
pub struct Lpips(Infallible);

/// Two pictures of the same size, row-major, as display values in `[0, 1]`.
#[derive(Debug, Clone, Copy)]
pub struct Pair<'a> {
    /// Width and height, pixels.
    pub size: [u32; 2],
    /// The picture.
    pub picture: &'a [[f32; 3]],
    /// What it is compared with.
    pub truth: &'a [[f32; 3]],
}

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

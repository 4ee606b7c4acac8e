//! What LPIPS compares, and why it cannot.

use super::Backbone;

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

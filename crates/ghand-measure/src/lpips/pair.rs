//! What LPIPS compares, and why it cannot.

/// The network whose features are compared, as the `lpips` package and the weights' file call it.
pub const BACKBONE: &str = "alex";
/// Smallest width and height of an image, pixels: with smaller ones AlexNet's second maximum has no window.
pub const SMALLEST_SIDE: u32 = 31;

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
    /// A picture is smaller than the network can process.
    #[error("LPIPS needs at least {SMALLEST_SIDE} x {SMALLEST_SIDE} pixels, but the image has {width} x {height}")]
    TooSmall {
        /// Width, pixels.
        width: u32,
        /// Height, pixels.
        height: u32,
    },
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

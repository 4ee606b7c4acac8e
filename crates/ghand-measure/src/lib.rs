//! How well pictures agree with images: PSNR, SSIM, LPIPS, and where on the hand errors are.

pub mod error_bands;
pub mod hand_box;
#[cfg(feature = "networks")]
pub mod lpips;
#[cfg(not(feature = "networks"))]
#[path = "no_lpips.rs"]
pub mod lpips;
pub mod metrics;
pub mod outline;
pub mod ssim;

//! How well an avatar agrees with images that training did not see.
//!
//! [`evaluation`] compares it with images and with the [`baseline`], in poses by a [`protocol`]. [`metrics`], [`ssim`]
//! and [`lpips`] compare pictures, [`error_bands`] and [`outline`] say where errors are.

pub mod baseline;
pub mod error_bands;
pub mod evaluation;
pub mod hand_box;
pub mod lpips;
pub mod metrics;
pub mod outline;
pub mod protocol;
pub mod ssim;

//! Hand models: readers and writers, UV atlases, hands that come with the program, and surface samples.
//!
//! [`ghand_core::HandModel`] is the type. [`files`] reads and writes it: [`files::read`] recognises a file's format
//! from its contents. [`builtin`] has a human hand. [`joints`] maps joint names to parts of the hand and says how these
//! turn and how far. [`named_poses`] has poses by name, [`shape_values`] reads shapes by name, [`pose_correctives`]
//! keeps the volume of bent joints, [`surface`] samples the points that become an avatar's Gaussians.
//!
//! Units are metres and radians.

pub mod builtin;
mod cholesky;
mod error;
pub mod files;
pub mod inspection;
pub mod joints;
pub mod named_poses;
pub mod pose_correctives;
pub mod shape_values;
mod side;
pub mod surface;

pub use error::HandModelError;
pub use surface::SurfaceSamples;

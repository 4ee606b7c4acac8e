//! Hand models: readers and writers, UV atlases, the built-in hand, and surface samples.
//!
//! [`ghand_core::HandModel`] is the type. [`read`] recognises a file's format from its contents; [`mano`] and [`gltf`]
//! read one format each, [`procedural`] builds the built-in hand, [`obj`] and [`glb`] write posed hands.
//! [`joint_names`] maps joint names to parts of the hand, [`joint_axes`] says how these turn and [`joint_limits`] how far.
//! [`named_poses`] has poses by name, [`surface`] samples the points that become an avatar's Gaussians.
//!
//! Units are metres and radians.

mod error;
mod export;
pub mod glb;
pub mod gltf;
pub mod inspection;
pub mod joint_axes;
pub mod joint_limits;
pub mod joint_names;
pub mod mano;
pub mod named_poses;
pub mod obj;
pub mod procedural;
pub mod read;
pub mod surface;
pub mod uv_atlas;

pub use error::HandModelError;
pub use surface::SurfaceSamples;

//! Hand models: readers and writers, UV atlases, hands that come with the program, and surface samples.
//!
//! [`ghand_core::HandModel`] is the type. [`read`] recognises a file's format from its contents; [`mano`] and [`gltf`]
//! read one format each, [`builtin`] has a human hand, [`obj`] and [`glb`] write posed hands, [`rigged_glb`] rigged ones. [`joint_names`] maps joint names to parts of the hand,
//! [`joint_axes`] says how these turn and [`joint_limits`] how far. [`named_poses`] has poses by name, [`shape_values`]
//! reads shapes by name, [`pose_correctives`] keeps the volume of bent joints, [`surface`] samples the points that
//! become an avatar's Gaussians.
//!
//! Units are metres and radians.

pub mod arm_end;
pub mod builtin;
mod cholesky;
mod error;
mod export;
pub mod glb;
mod glb_document;
pub mod gltf;
pub mod hand_directions;
pub mod inspection;
pub mod joint_axes;
pub mod joint_limits;
pub mod joint_names;
pub mod joint_regressor;
pub mod mano;
pub mod named_poses;
pub mod obj;
pub mod pose_correctives;
pub mod read;
pub mod rigged_glb;
pub mod shape_values;
mod side;
pub mod surface;
pub mod uv_atlas;

pub use error::HandModelError;
pub use surface::SurfaceSamples;

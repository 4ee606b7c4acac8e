//! The exact mathematics of ghand, in f64 and without a GPU.
//!
//! Everything here is plain data and pure functions: the hand model in a shape and pose; and the kinematic chain, Hand
//! Gaussian Blend Shapes, the Neural Residual Skeleton and corrected linear blend skinning, each forward and as a
//! vector-Jacobian product (`*_vjp`). Tests compare GPU code with these functions. Files are read elsewhere.
//!
//! Units are metres and radians; vectors are columns; matrices read `to_from_from` (`posed_from_rest`).

pub mod blend_shapes;
pub mod bound_joints;
pub mod camera;
pub mod deformation;
pub mod hand_model;
pub mod light;
pub mod mesh;
mod parallel;
pub mod pose;
pub mod pose_error;
pub mod pose_offsets;
pub mod pose_response;
pub mod posing;
pub mod residual_skeleton;
pub mod rotation;
pub mod skeleton;
pub mod skinning;
pub mod sphere;
pub mod statistics;
pub mod stretch;

pub use camera::Camera;
pub use hand_model::{HandModel, InvalidHandModel, PoseSpace, Side};
pub use pose::Pose;

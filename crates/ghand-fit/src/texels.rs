//! The texels of the template in the images of a capture: which it needs, which each image shows, and their colours.

pub mod colors;
pub mod frames;
pub mod mesh_painter;
pub mod required;
pub mod views;

use ghand_capture::CaptureError;
use ghand_core::InvalidHandModel;
use ghand_hand_model::HandModelError;
use ghand_render::mesh::MeshError;

/// Why texels could not be found in images.
#[derive(Debug, thiserror::Error)]
pub enum TexelError {
    /// The hand model is unusable.
    #[error(transparent)]
    HandModel(#[from] HandModelError),
    /// An image is unusable.
    #[error(transparent)]
    Capture(#[from] CaptureError),
    /// A pose does not fit the hand model.
    #[error(transparent)]
    Pose(#[from] InvalidHandModel),
    /// The mesh could not be drawn.
    #[error(transparent)]
    Mesh(#[from] MeshError),
}

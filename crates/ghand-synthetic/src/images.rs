//! What the cameras see: where they stand, the light, what is behind the hand, and the pictures.

pub(crate) mod background;
pub(crate) mod camera_placement;
pub(crate) mod cast_shadow;
pub(crate) mod draw;
pub(crate) mod labels;
pub(crate) mod light_visibility;
pub(crate) mod lighting;

//! How a subject becomes a picture: the camera, the drawing on the device, and the texture that shows it.

pub mod camera;
pub mod drawing;
pub mod frame_times;
pub mod picture;
pub mod screen;
pub mod subject_copy;
pub mod view_side;

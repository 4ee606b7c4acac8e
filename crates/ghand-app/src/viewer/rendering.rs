//! How a subject becomes a picture: the camera, the drawing on the device, and the texture that shows it.

pub mod drawing;
pub mod drawn_subject;
pub mod frame;
pub mod frame_times;
pub mod picture;
pub mod screen;

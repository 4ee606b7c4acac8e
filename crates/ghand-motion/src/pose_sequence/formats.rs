//! The formats of pose files: each has a reader that recognises its own files and makes a recording of one.

pub mod ghand;
pub mod ho3d;
pub mod image_landmarks;
pub mod landmarks;
pub mod mano;
pub mod plain;
pub mod sam_3d_body;
pub mod xr;

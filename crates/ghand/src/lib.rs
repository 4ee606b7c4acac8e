//! Real-time, animatable hand avatars from a few camera views: ghand as one library.
//!
//! Each module is a crate of its own; [`prelude`] has what most programs use. Lengths are metres, angles radians, cameras
//! those of OpenCV (x right, y down, z forward).
//!
//! ```no_run
//! use ghand::prelude::*;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let avatar = Avatar::load("avatar.ghand".as_ref())?;
//! let fist = named_pose("fist", &avatar.model).ok_or("there is no such pose")?;
//! let gpu = Gpu::new(&AdapterChoice::from_env())?;
//! let mut scene = Scene::new(&gpu, &[&avatar], Purpose::Images, 1, [512, 512])?;
//! scene.set_pose(&gpu, 0, 0, &fist)?;
//! let cameras = turntable(&avatar.model, &[&fist], 1, [512, 512]);
//! let image = scene.render(&gpu, 0, &cameras[0][0], [1.0; 3])?;
//! println!("{} x {} pixels", image.width, image.height);
//! # Ok(())
//! # }
//! ```

pub use ghand_avatar as avatar;
pub use ghand_capture as capture;
pub use ghand_core as core;
pub use ghand_fit as fit;
pub use ghand_hand_model as hand_model;
pub use ghand_measure as measure;
pub use ghand_motion as motion;
pub use ghand_pictures as pictures;
pub use ghand_render as render;
pub use ghand_synthetic as synthetic;
pub use ghand_train as train;

/// What most programs use.
pub mod prelude {
    pub use ghand_avatar::framing::turntable;
    pub use ghand_avatar::{Avatar, AvatarConfig, Scene};
    pub use ghand_capture::Capture;
    pub use ghand_core::{Camera, HandModel, Pose, Side};
    pub use ghand_hand_model::builtin::builtin_hand;
    pub use ghand_hand_model::named_poses::named_pose;
    pub use ghand_motion::{PoseOptions, read_poses};
    pub use ghand_render::splat::Purpose;
    pub use ghand_render::{AdapterChoice, Gpu};
    pub use ghand_train::{TrainSettings, Trainer};
}

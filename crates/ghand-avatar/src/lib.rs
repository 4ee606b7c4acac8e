//! Hand avatars: Gaussians on a hand model's surface, the property models that drive them, scenes of posed avatars, and
//! the avatar file.

pub mod avatar;
#[cfg(feature = "bake")]
pub mod bake;
pub mod deform;
pub mod file;
pub mod four_bones;
pub mod framing;
pub mod gaussian_glb;
pub mod light;
pub mod local_thickness;
pub mod neighbors;
pub mod orbit_camera;
pub mod pose_properties;
pub mod posed_avatar;
pub mod posed_hand;
pub mod properties;
pub mod reference;
mod retain;
pub mod scene;
pub mod scene_files;
pub mod scene_framing;
pub mod template;
pub mod textured_hand;
mod training_coverage;
pub mod view_side;

pub use avatar::{Avatar, Provenance};
#[cfg(feature = "bake")]
pub use bake::{Bake, BakeError};
pub use file::AvatarFileError;
pub use light::{AvatarLight, Light, LightKind};
pub use posed_avatar::PosedAvatar;
pub use posed_hand::PosedHand;
pub use properties::direct::DirectTables;
pub use properties::network::NetworkSizes;
pub use properties::{DeviceModel, PropertyModel, PropertyRates, PropertyStart, PropertyTables, TrainableModel};
pub use scene::Scene;
pub use template::{AvatarConfig, GaussianShape, Offsets, Template};

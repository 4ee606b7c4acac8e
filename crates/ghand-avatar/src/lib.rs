//! Hand avatars: Gaussians on a hand model's surface, their property model, the GPU pipeline that poses and renders
//! them, and the avatar file.

pub mod avatar;
pub mod direct;
pub mod file;
pub mod ply;
pub mod renderer;
pub mod response_limits;

pub use avatar::{Avatar, AvatarConfig, Provenance, Template};
pub use direct::DirectTables;
pub use file::AvatarFileError;
pub use renderer::AvatarRenderer;

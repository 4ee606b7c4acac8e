//! The avatar that comes with the programs, for a first look: see `assets/demo-avatar`.

use std::path::Path;

use ghand_avatar::{Avatar, AvatarFileError};

/// Its name in messages.
pub const DEMO_AVATAR_NAME: &str = "the demo avatar";

/// The avatar.
///
/// # Errors
/// Never: a test reads it.
pub fn demo_avatar() -> Result<Avatar, AvatarFileError> {
    let bytes = include_bytes!("../../../assets/demo-avatar/right.ghand");
    Avatar::from_bytes(Path::new(DEMO_AVATAR_NAME), bytes)
}

#[cfg(test)]
mod tests {
    #[test]
    fn it_can_be_read() {
        let avatar = super::demo_avatar().unwrap();
        assert!(avatar.light.is_some() && avatar.template.len() > 20_000);
    }
}

//! What the colours of an avatar show: `--show`.

use anyhow::{Context, bail};
use clap::ValueEnum;
use ghand_avatar::{Avatar, PropertyTables};

use crate::lighting::Lighting;

/// What the colours of an avatar show.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub enum AvatarColors {
    /// The hand as it was trained.
    #[default]
    Skin,
    /// How much the training views saw of each place, on a logarithmic scale: dark violet for nothing, green for as much
    /// as of most, yellow for ten times as much.
    Views,
}

impl AvatarColors {
    /// The avatar in these colours; skin in a light.
    ///
    /// # Errors
    /// One sentence if the avatar does not know what training saw, or has no light of its own.
    pub fn apply_to(self, avatar: Avatar, light: &Lighting) -> anyhow::Result<Avatar> {
        match self {
            AvatarColors::Skin => {
                let mut avatar = avatar;
                light.apply_to(&mut avatar)?;
                Ok(avatar)
            }
            AvatarColors::Views if !light.is_default() => bail!("--light: --show views has no light"),
            AvatarColors::Views => {
                let remedy = match avatar.tables {
                    PropertyTables::Baked(_) => "bake it again, of an avatar whose file says so",
                    _ => "train the avatar again",
                };
                let shown = avatar.colored_by_seen();
                shown.with_context(|| {
                    format!("--show views: the avatar's file does not say what training saw; {remedy}")
                })
            }
        }
    }
}

//! The hand that is shown before anything has been trained.

use ghand_avatar::{Avatar, AvatarConfig};
use ghand_core::{HandModel, Side};
use ghand_hand_model::builtin::builtin_hand;
use ghand_hand_model::{HandModelError, surface};
use glam::DVec3;

use crate::framing::Upright;

/// Skin that faces the light, display values.
const COLOR: DVec3 = DVec3::new(0.86, 0.65, 0.54);
/// Brightness independent of the direction that the skin faces.
const AMBIENT: f64 = 0.5;
/// Extra brightness of the palm and the back of the hand over the sides of the fingers, so that fingers stand out.
const FACING: f64 = 0.25;

/// The built-in hand as an untrained avatar, softly lit at rest so that its shape shows.
///
/// # Errors
/// [`HandModelError`] if the built-in hand cannot be read, which would be a bug.
pub fn untrained_hand() -> Result<Avatar, HandModelError> {
    untrained_avatar_of(&builtin_hand(Side::Right)?)
}

/// Like [`untrained_hand`], for any hand model.
///
/// # Errors
/// [`HandModelError`] if the model's texture coordinates are not usable for an avatar.
pub fn untrained_avatar_of(model: &HandModel) -> Result<Avatar, HandModelError> {
    let config = AvatarConfig::default();
    let mut avatar = Avatar::untrained(model, &config, COLOR.to_array(), 0)?;
    let Upright { up, back } = Upright::at_rest(model);
    let light = (back + up + 0.7 * DVec3::NEG_Z).normalize();
    let shade = |normal: &DVec3| {
        let lit = (1.0 - AMBIENT - FACING) * (0.5 + 0.5 * normal.dot(light));
        (COLOR * (AMBIENT + FACING * normal.dot(back).abs() + lit)).to_array()
    };
    let samples = surface::sample_surface(model, config.uv_resolution)?;
    avatar.tables.set_base_colors(&samples.normals.iter().map(shade).collect::<Vec<_>>());
    Ok(avatar)
}

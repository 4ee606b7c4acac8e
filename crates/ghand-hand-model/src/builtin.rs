//! The built-in hand: a human hand that anyone may use (CC0), part of the program. Its files and their licence are in
//! `assets/human-hand`.

use ghand_core::{HandModel, Side};

use crate::HandModelError;
use crate::files::gltf::read_gltf_bytes;

#[cfg(not(target_arch = "wasm32"))]
const HANDS: [&[u8]; 2] =
    [include_bytes!("../../../assets/human-hand/right.glb"), include_bytes!("../../../assets/human-hand/left.glb")];
/// A page does not download megabytes for hands that avatars bring along.
#[cfg(target_arch = "wasm32")]
const HANDS: [&[u8]; 2] = [&[]; 2];

/// Names that [`hand_by_name`] knows.
pub const HAND_NAMES: [&str; 2] = ["builtin", "builtin-left"];

/// The built-in hand: 1,750 vertices, 25 joints with WebXR's names, 10 shape directions with names, pose correctives.
///
/// At rest it is flat with the thumb spread, in metres: fingers along -Y, back of a right hand towards +X, thumb towards
/// -Z. The left hand is the mirror image in X.
///
/// # Errors
/// [`HandModelError`] if the embedded file is not usable, which would be a bug; always in browsers, where there is none.
pub fn builtin_hand(side: Side) -> Result<HandModel, HandModelError> {
    let [right, left] = HANDS;
    let (name, bytes) = match side {
        Side::Right => ("built-in right hand", right),
        Side::Left => ("built-in left hand", left),
    };
    if bytes.is_empty() {
        return Err(HandModelError::invalid(name, "file", "is not part of programs for browsers; give a hand model"));
    }
    Ok(read_gltf_bytes(name, bytes)?.model)
}

/// The hand of that name; `None` if the name is not in [`HAND_NAMES`].
///
/// # Errors
/// As in [`builtin_hand`].
pub fn hand_by_name(name: &str) -> Option<Result<HandModel, HandModelError>> {
    match name {
        "builtin" => Some(builtin_hand(Side::Right)),
        "builtin-left" => Some(builtin_hand(Side::Left)),
        _ => None,
    }
}

//! Models of whole bodies in MANO's format, which are not hands.

use super::named_arrays::NamedArrays;
use crate::HandModelError;

/// Parents of the first joints of SMPL and of all models made from it: pelvis, legs, spine, head and arms.
const BODY_PARENTS: [usize; 21] = [0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19];

/// Models by their numbers of vertices and joints.
const MODELS: [(&str, usize, usize); 3] = [("SMPL", 6890, 24), ("SMPL-H", 6890, 52), ("SMPL-X", 10475, 55)];

/// Rejects the model of a whole body by its name. What cannot be read is left to the reader of the hand.
pub(super) fn reject_body(fields: &mut NamedArrays) -> Result<(), HandModelError> {
    let mut shape = |key: &str| fields.contains(key).then(|| fields.numbers(key).ok()).flatten();
    let vertices = shape("v_template").and_then(|array| array.shape.first().copied()).unwrap_or(0);
    let parents = shape("kintree_table").filter(|array| array.shape.first() == Some(&2));
    let joints = parents.as_ref().and_then(|array| array.shape.get(1).copied()).unwrap_or(0);
    let starts_as_body = parents.is_some_and(|array| {
        let parents = array.values.iter().take(joints).skip(1);
        joints > BODY_PARENTS.len() && parents.zip(BODY_PARENTS).all(|(parent, own)| *parent == own as f64)
    });
    if !starts_as_body && MODELS.iter().all(|(_, own, _)| *own != vertices) {
        return Ok(());
    }
    let name = MODELS.iter().find(|(.., own)| *own == joints).map_or("SMPL or a model made from it", |(name, ..)| name);
    let problem = format!(
        "is a whole body, {name} ({vertices} vertices, {joints} joints), not a hand; pass MANO_RIGHT.pkl or \
         MANO_LEFT.pkl, its hands alone"
    );
    Err(fields.invalid("hand model", problem))
}

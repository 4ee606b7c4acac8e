//! GRAB's sequences: `rhand` and `lhand`, each with `params`: `global_orient` (T, 3), `transl` (T, 3), `fullpose` (T, 45)
//! and its 24 components `hand_pose`, from the flat hand. The full pose counts; the `body` is not used.

use ghand_core::Side;
use ghand_files::value::Value;

use super::components::{Fingers, meaning};
use super::{Hand, flat, frame};
use crate::pose_sequence::{PoseError, Source};

const HANDS: [(&str, Side); 2] = [("rhand", Side::Right), ("lhand", Side::Left)];
/// The pose, in the order in which it counts.
const POSE_NAMES: [&str; 2] = ["fullpose", "hand_pose"];

/// The parameters of a hand.
fn params<'a>(value: &'a Value, name: &str) -> Option<&'a Value> {
    let params = value.get(name)?.get("params")?;
    POSE_NAMES.iter().any(|name| params.get(name).is_some()).then_some(params)
}

pub(super) fn is_grab(value: &Value) -> bool {
    HANDS.iter().any(|(name, _)| params(value, name).is_some())
}

pub(super) fn hands(source: &Source, value: &Value) -> Result<Vec<Hand>, PoseError> {
    let mut hands = Vec::new();
    for (name, side) in HANDS {
        let Some(params) = params(value, name) else { continue };
        let field = |part: &str| format!("{name}.params.{part}");
        let pose = POSE_NAMES.iter().find_map(|part| Some((*part, params.get(part)?.numbers()?)));
        let Some((part, array)) = pose else {
            return Err(source.invalid(&field("fullpose"), "is not an array of numbers (T, 45)".into()));
        };
        let fingers = meaning(array, &[params, value]).map_err(|problem| source.invalid(&field(part), problem))?;
        let count = array.values.len() / fingers.width();
        let orients = flat(params.get("global_orient"));
        let places = flat(params.get("transl"));
        for (part, values) in [("global_orient", &orients), ("transl", &places)] {
            if params.get(part).is_none() {
                return Err(source.invalid(&field(part), format!("is missing; give it as ({count}, 3)")));
            }
            if values.len() != 3 * count {
                let problem = format!("has {} numbers for {count} frames, expected 3 each", values.len());
                return Err(source.invalid(&field(part), problem));
            }
        }
        for (k, row) in array.values.chunks_exact(fingers.width()).enumerate() {
            let id = format!("{k:04}");
            let of = |values: &[f64]| values.iter().skip(3 * k).take(3).copied().collect::<Vec<f64>>();
            let rotations = fingers.rotations(source, side, row);
            let found = rotations.and_then(|pose| frame(&id, &of(&orients), &pose, &[], &of(&places)));
            // GRAB's components are from the flat hand too.
            let mut hand = Hand::new(id, Some(side), found);
            if let (Fingers::Components(_), Err(problem)) = (fingers, &mut hand.frame) {
                *problem = format!("{} {problem}", field(part));
            }
            hands.push(hand);
        }
    }
    Ok(hands)
}

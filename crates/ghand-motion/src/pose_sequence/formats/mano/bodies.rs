//! The hands of bodies: AMASS, SMPL-H and SMPL-X. Only the fingers are read: the root is the body's and not the wrist's.

use ghand_core::Side;
use ghand_files::npz::NumericArray;
use ghand_files::value::Value;

use super::components::{Fingers, meaning, said};
use super::{Hand, first, frame};
use crate::pose_sequence::reading::source::{frames_of, id_of};
use crate::pose_sequence::{PoseError, Source};

/// Largest depth at which a body is looked for.
const MAX_DEPTH: usize = 3;
/// Whole poses of bodies with both hands, whose last 90 numbers are the left and the right hand.
const WHOLE: [(&str, &[usize]); 4] =
    [("poses", &[156, 165]), ("fullpose", &[156, 165]), ("full_pose", &[156, 165]), ("pose_hand", &[90])];
/// Names of the right and the left hand.
const HANDS: [(&str, &str); 5] = [
    ("right_hand_pose", "left_hand_pose"),
    ("rhand_pose", "lhand_pose"),
    ("smplx_rhand_pose", "smplx_lhand_pose"),
    ("pred_rhand_pose", "pred_lhand_pose"),
    ("body_rhand_pose", "body_lhand_pose"),
];
/// Names of the root of a body and of its place, which are not used.
const ROOT_NAMES: [&str; 7] =
    ["global_orient", "root_orient", "smplx_root_pose", "transl", "trans", "body_pose", "pose_body"];

/// What is said of a body with a root.
const WARNING: &str =
    "the hand is that of a body, whose rotation and position are not the wrist's; only the fingers move";

/// Bodies of a file: itself, or the frames of a list.
fn bodies(value: &Value) -> Vec<(&Value, Option<String>)> {
    if has_hands(value) {
        return vec![(value, None)];
    }
    let frames = frames_of(value).unwrap_or_default().iter().enumerate();
    frames.filter(|(_, frame)| has_hands(frame)).map(|(k, frame)| (frame, Some(id_of(frame, k)))).collect()
}

fn has_hands(value: &Value) -> bool {
    let is_named = |name: &str| value.get(name).is_some_and(|hand| hand.numbers().is_some());
    whole(value).is_some() || HANDS.iter().any(|(right, left)| is_named(right) || is_named(left))
}

/// Whole poses and their width.
fn whole(value: &Value) -> Option<(&NumericArray, usize)> {
    WHOLE.iter().find_map(|(name, widths)| {
        let array = value.get(name)?.numbers()?;
        match array.shape[..] {
            [width] | [_, width] | [1, _, width] if widths.contains(&width) => Some((array, width)),
            _ => None,
        }
    })
}

pub(super) fn is_body(value: &Value) -> bool {
    !bodies(value).is_empty()
}

/// The first body inside a file that is none itself.
pub(super) fn inside(value: &Value) -> Option<&Value> {
    inside_at(value, 0)
}

fn inside_at(value: &Value, depth: usize) -> Option<&Value> {
    let children = value.entries().iter().map(|(_, child)| child);
    children
        .filter(|_| depth < MAX_DEPTH)
        .find_map(|child| if is_body(child) { Some(child) } else { inside_at(child, depth + 1) })
}

/// What is said if a file's body has a root or a place.
pub(super) fn warning(value: &Value) -> Option<&'static str> {
    let has_root =
        |body: &Value| first(&[body], &ROOT_NAMES).is_some() || whole(body).is_some_and(|(_, width)| width > 90);
    bodies(value).iter().any(|(body, _)| has_root(body)).then_some(WARNING)
}

pub(super) fn hands(source: &Source, value: &Value) -> Result<Vec<Hand>, PoseError> {
    let mut hands = Vec::new();
    let said = said(value);
    for (body, id) in bodies(value) {
        let id = id.as_deref();
        if let Some((array, width)) = whole(body) {
            for (side, from_end) in [(Side::Left, 90), (Side::Right, 45)] {
                let rows = array.values.chunks_exact(width).map(|row| &row[width - from_end..][..45]);
                add(source, (side, "the whole pose"), id, rows, Fingers::Rotations(45), &mut hands);
            }
            continue;
        }
        for (right, left) in HANDS {
            for (side, name) in [(Side::Left, left), (Side::Right, right)] {
                let Some(array) = body.get(name).and_then(Value::numbers) else { continue };
                let fingers = meaning(array, &[body, value, &said]).map_err(|problem| source.invalid(name, problem))?;
                add(source, (side, name), id, array.values.chunks_exact(fingers.width()), fingers, &mut hands);
            }
        }
    }
    Ok(hands)
}

/// Adds a hand of each row.
fn add<'a>(
    source: &Source,
    (side, name): (Side, &str),
    id: Option<&str>,
    rows: impl ExactSizeIterator<Item = &'a [f64]>,
    fingers: Fingers,
    hands: &mut Vec<Hand>,
) {
    let is_one = rows.len() == 1;
    for (k, row) in rows.enumerate() {
        let id = match id {
            Some(id) if is_one => id.to_owned(),
            Some(id) => format!("{id}.{k}"),
            None => format!("{k:04}"),
        };
        let rotations = fingers.rotations(source, side, row).map_err(|problem| format!("{name} {problem}"));
        let frame = rotations.and_then(|rotations| frame(&id, &[0.0; 3], &rotations, &[], &[]));
        let from_components = matches!(fingers, Fingers::Components(_));
        hands.push(Hand { from_components, ..Hand::new(id, Some(side), frame) });
    }
}

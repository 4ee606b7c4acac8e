//! Dyn-HaMR's `*_world_results.npz`: for B tracked hands and T frames `trans` and `root_orient` (B, T, 3), `pose_body`
//! (B, T, 45), `is_right` (B, T), `betas` (B, 10), in its world, from the flat hand. A left hand is the mirror image in x
//! of the whole scene of a right one.
//!
//! SLAHMR, from which it comes, writes the same names for bodies, whose `pose_body` has 63 numbers: they have no hands.

use ghand_core::Side;
use ghand_files::npz::NumericArray;
use ghand_files::value::Value;

use super::{Hand, NO_HAND, flat, frame};
use crate::pose_sequence::{PoseError, Source};

const FINGERS: usize = 45;
/// Masks of frames in which a hand is seen.
const MASK_NAMES: [&str; 2] = ["vis_mask", "track_mask"];

/// The results, which may be in a map of stages.
fn results(value: &Value) -> &Value {
    value.get("world").filter(|world| is_named(world)).unwrap_or(value)
}

fn is_named(value: &Value) -> bool {
    ["pose_body", "root_orient"].iter().all(|name| value.get(name).is_some_and(|part| part.numbers().is_some()))
}

/// Whether a value has such names and the pose is that of hands.
pub(super) fn is_results(value: &Value) -> bool {
    let results = results(value);
    is_named(results) && results.get("pose_body").and_then(Value::numbers).is_some_and(|pose| axes(pose).is_some())
}

/// Tracks and frames of a pose of hands.
fn axes(pose: &NumericArray) -> Option<(usize, usize)> {
    match pose.shape[..] {
        [tracks, frames, FINGERS] | [tracks, frames, 15, 3] => Some((tracks, frames)),
        [frames, FINGERS] | [frames, 15, 3] => Some((1, frames)),
        _ => None,
    }
}

pub(super) fn hands(source: &Source, value: &Value) -> Result<Vec<Hand>, PoseError> {
    let value = results(value);
    let Some(pose) = value.get("pose_body").and_then(Value::numbers) else { return Ok(vec![]) };
    let Some((tracks, frames)) = axes(pose) else { return Ok(vec![]) };
    let poses = &pose.values;
    let part = |name: &str, width: usize| -> Result<Vec<f64>, PoseError> {
        let values = flat(value.get(name));
        if values.len() == width * tracks * frames {
            return Ok(values);
        }
        if value.get(name).is_none() {
            return Err(source.invalid(name, format!("is missing; give it as ({tracks}, {frames}, {width})")));
        }
        let problem = format!(
            "has {} numbers, expected ({tracks}, {frames}, {width}) as pose_body has {tracks} hands in {frames} frames",
            values.len()
        );
        Err(source.invalid(name, problem))
    };
    let orients = part("root_orient", 3)?;
    let places = part("trans", 3)?;
    let sides = sides(source, value, tracks, frames)?;
    let shapes = flat(value.get("betas"));
    let shape_width = shapes.len() / tracks.max(1);
    // One shape for each hand, or one for each of its frames.
    let per_frame =
        if shape_width > 10 && shape_width.is_multiple_of(frames) { shape_width / frames } else { shape_width };
    source.copied("betas", per_frame, tracks * frames)?;
    let masks = MASK_NAMES.iter().map(|name| flat(value.get(name))).find(|mask| mask.len() == tracks * frames);
    let mut hands = Vec::with_capacity(tracks * frames);
    // In the order of time: a hand may go from one track to another.
    for (number, track) in (0..frames).flat_map(|number| (0..tracks).map(move |track| (number, track))) {
        let k = track * frames + number;
        let first = track * shape_width + if per_frame == shape_width { 0 } else { number * per_frame };
        let id = format!("{number:04}");
        let row = |values: &[f64], width: usize| values.get(k * width..(k + 1) * width).unwrap_or_default().to_vec();
        let shape = shapes.get(first..first + per_frame).unwrap_or_default();
        let is_seen = masks.as_ref().is_none_or(|mask| mask.get(k).is_some_and(|seen| *seen != 0.0));
        let mut found = if is_seen {
            frame(&id, &row(&orients, 3), &row(poses, FINGERS), shape, &row(&places, 3))
        } else {
            Err(NO_HAND.into())
        };
        let side = sides.get(k).copied();
        if let (Ok(found), Some(Side::Left)) = (&mut found, side) {
            found.pose = found.pose.mirrored();
        }
        hands.push(Hand::new(id, side, found));
    }
    Ok(hands)
}

/// The side of each hand in each frame.
fn sides(source: &Source, value: &Value, tracks: usize, frames: usize) -> Result<Vec<Side>, PoseError> {
    let side = |right: &f64| if *right >= 0.5 { Side::Right } else { Side::Left };
    let numbers = flat(value.get("is_right"));
    if numbers.len() == tracks * frames {
        return Ok(numbers.iter().map(side).collect());
    }
    if numbers.len() == tracks && tracks > 0 {
        return Ok((0..tracks * frames).filter_map(|k| numbers.get(k / frames)).map(side).collect());
    }
    let problem = match value.get("is_right") {
        None => format!("is missing; give 1 for a right and 0 for a left hand, ({tracks}, {frames})"),
        Some(found) => format!("is {}, expected ({tracks}, {frames})", found.kind()),
    };
    Err(source.invalid("is_right", problem))
}

//! Which hand a MANO file is, and whether it has the bug of the published left model.

use std::path::{Path, PathBuf};

use ghand_core::{HandModel, Side};
use glam::DVec3;

use super::named_arrays::NamedArrays;
use super::{PARENTS, REMEDY, build};
use crate::joints::names::side_in_name;

/// The side: the requested one, else from the file's name, else from the geometry.
pub(super) fn find_side(model: &HandModel, name: &str, asked: Option<Side>, warnings: &mut Vec<String>) -> Side {
    let by_shape = side_of_shape(model);
    let Some(known) = asked.or_else(|| side_of_name(Path::new(name))) else {
        return by_shape.unwrap_or_else(|| {
            warnings.push("neither the file's name nor the joints show the side; assuming a right hand".into());
            Side::Right
        });
    };
    if by_shape.is_some_and(|by_shape| by_shape != known) {
        warnings.push(format!("is read as a {known} hand, but its thumb is on the other side"));
    }
    known
}

/// The side that a word of the file's name says.
fn side_of_name(path: &Path) -> Option<Side> {
    side_in_name(&path.file_stem()?.to_string_lossy())
}

/// The side from the joints, if they are MANO's.
///
/// The vector from wrist to middle finger, crossed with the vector from index to little finger, points out of the palm
/// of a right hand and out of the back of a left one. At rest, the joints of the thumb are nearer to the palm's side
/// than those of the fingers.
fn side_of_shape(model: &HandModel) -> Option<Side> {
    if model.parents != PARENTS {
        return None;
    }
    let [wrist, index, middle, pinky] = [0, 1, 4, 7].map(|k| model.joints[k]);
    let along = middle - wrist;
    let normal = along.cross(pinky - index);
    let thumb = model.joints[13..].iter().map(|joint| (*joint - wrist).dot(normal)).sum::<f64>() / 3.0;
    let knuckles = [1, 4, 7, 10].map(|k| (model.joints[k] - wrist).dot(normal)).iter().sum::<f64>() / 4.0;
    // Relative to the palm's area times its length: 1 % of the length is more than the rounding of a flat hand.
    let height = (thumb - knuckles) / (normal.length() * along.length());
    if height > 0.01 {
        Some(Side::Right)
    } else if height < -0.01 {
        Some(Side::Left)
    } else {
        None
    }
}

/// The file of the right model that belongs to a left one, by its name.
pub(super) fn right_beside(path: &Path) -> Option<PathBuf> {
    let name = path.file_name()?.to_str()?;
    let words = [("left", "right"), ("LEFT", "RIGHT"), ("Left", "Right")];
    let (left, right) = words.into_iter().find(|(left, _)| name.contains(left))?;
    Some(path.with_file_name(name.replace(left, right)))
}

/// Whether a left model's shape directions have the x components of the right hand, as in the published file.
pub(super) fn has_left_shape_bug(model: &HandModel, right: Option<&[u8]>, warnings: &mut Vec<String>) -> bool {
    if model.shape_directions.is_empty() {
        return false;
    }
    if let Some(bug) = right.and_then(|right| compare_with_right(model, right)) {
        return bug;
    }
    match length_breadth_correlation(model) {
        // The bug changes the sign of the correlation. Measured hands have about 0.5, so that 0.2 is a clear threshold.
        Some(correlation) if correlation < -0.2 => true,
        Some(correlation) if correlation > 0.2 => false,
        _ => {
            warnings.push(
                "shapedirs do not show whether they have the bug of the published left model, and are used unchanged; \
                 put the right model's file beside this one"
                    .into(),
            );
            false
        }
    }
}

/// The published test: the sum over vertices and directions of the differences in x is below 1. (It is about 0 with
/// the bug, and twice the right hand's x without.) Since the sum depends on the size of the mesh, they must also be
/// nearer to the right hand's than to their mirror image.
fn compare_with_right(left: &HandModel, right: &[u8]) -> Option<bool> {
    let right = build::build(&mut NamedArrays::open("right hand", right, REMEDY).ok()?, &mut Vec::new()).ok()?;
    if right.shape_directions.len() != left.shape_directions.len() {
        return None;
    }
    let pairs = || left.shape_directions.iter().zip(&right.shape_directions).map(|(l, r)| (l.x, r.x));
    let same: f64 = pairs().map(|(l, r)| (l - r).abs()).sum();
    let mirrored: f64 = pairs().map(|(l, r)| (l + r).abs()).sum();
    (same != mirrored).then_some(same < 1.0 && same < mirrored)
}

/// How the extent along x correlates with that along y and z over all shapes, for independent shape parameters with
/// unit variance, as in a model of people. Long hands are broad, so that it is positive; negating the x of all shape
/// directions changes its sign.
fn length_breadth_correlation(model: &HandModel) -> Option<f64> {
    let count = model.vertices.len();
    let center = model.vertices.iter().sum::<DVec3>() / count as f64;
    let mut both = 0.0;
    let mut along_x = 0.0;
    let mut across = 0.0;
    for directions in model.shape_directions.chunks_exact(count) {
        let growth: DVec3 = model.vertices.iter().zip(directions).map(|(v, d)| (*v - center) * *d).sum();
        both += growth.x * (growth.y + growth.z);
        along_x += growth.x * growth.x;
        across += (growth.y + growth.z) * (growth.y + growth.z);
    }
    let correlation = both / (along_x * across).sqrt();
    correlation.is_finite().then_some(correlation)
}

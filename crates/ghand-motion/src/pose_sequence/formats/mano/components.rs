//! Poses as principal components, which a MANO model turns into rotations: `components @ hands_components[:n]`, measured
//! from its mean pose.
//!
//! Names say what numbers are: `pose_m` of DexYCB, `pose_pca` and its kin have components; `hand_pose` and its kin have
//! them beside `"use_pca": true` or `num_pca_comps`, or if there are too few for rotations. DexYCB's `pose_m` has 51
//! numbers: the wrist's rotation, 45 components, and a translation; all zero if the hand is not there.

use ghand_core::{PoseSpace, Side};
use ghand_files::npz::NumericArray;
use ghand_files::value::Value;
use glam::DVec3;

use super::{Hand, estimates, first, flat, frame};
use crate::pose_sequence::reading::refusal::COMPONENT_NAMES;
use crate::pose_sequence::reading::source::{frames_of, id_of, side_of};
use crate::pose_sequence::{PoseError, Source};

/// Rotations of a hand are this many numbers.
const ROTATIONS: usize = 45;
/// Fewest components that need no other sign than their number.
const FEWEST: usize = 5;
/// Numbers of components that programs write by themselves, without the wrist.
const USUAL: [usize; 8] = [6, 10, 12, 15, 20, 24, 30, 45];
/// Largest depth at which a flag is looked for.
const MAX_DEPTH: usize = 5;

/// Names of the fingers alone.
const FINGER_NAMES: [&str; 3] = ["hand_pose", "mano_hand_pose", "pred_hand_pose"];
/// Names of poses that may begin with the wrist.
const POSE_NAMES: [&str; 6] = ["pose", "poses", "mano_pose", "mano_poses", "full_pose", "fullpose"];
/// Numbers of components beyond this are all equally wrong.
const MOST_SAID: f64 = 1e6;
const COUNT_NAMES: [&str; 5] = ["num_pca_comps", "n_pca_comps", "ncomps", "n_comps", "num_pca"];
const ORIENT_NAMES: [&str; 4] = ["global_orient", "root_orient", "rot", "mano_global_orient"];
const PLACE_NAMES: [&str; 4] = ["transl", "trans", "translation", "cam_t"];
const SHAPE_NAMES: [&str; 4] = ["betas", "shape", "mano_betas", "beta"];
const SIDE_NAMES: [&str; 5] = ["mano_side", "side", "handedness", "hand_side", "is_right"];

/// The meaning of the numbers of a hand's fingers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Fingers {
    /// Axis-angle vectors or matrices, this many numbers of each hand.
    Rotations(usize),
    /// This many components of each hand.
    Components(usize),
}

impl Fingers {
    /// Numbers of each hand.
    pub(super) fn width(self) -> usize {
        let (Fingers::Rotations(width) | Fingers::Components(width)) = self;
        width
    }

    /// The rotations of a hand's numbers.
    pub(super) fn rotations(self, source: &Source, side: Side, numbers: &[f64]) -> Result<Vec<f64>, String> {
        match self {
            Fingers::Rotations(_) => Ok(numbers.to_vec()),
            Fingers::Components(_) => rotations(source, side, numbers),
        }
    }
}

/// The number of components that a file gives.
fn count(maps: &[&Value]) -> Option<usize> {
    let count = first(maps, &COUNT_NAMES).and_then(Value::number);
    count.map(|count| count.clamp(0.0, MOST_SAID) as usize)
}

/// A flag of a file, at any place in it.
pub(super) fn flag(value: &Value, name: &str) -> Option<bool> {
    flag_at(value, name, 0)
}

fn flag_at(value: &Value, name: &str, depth: usize) -> Option<bool> {
    let inner = |child: &Value| flag_at(child, name, depth + 1);
    value.get(name).and_then(truth).or_else(|| match value {
        _ if depth == MAX_DEPTH => None,
        Value::Map(entries) => entries.iter().find_map(|(_, child)| inner(child)),
        Value::List(items) => items.iter().find_map(inner),
        _ => None,
    })
}

/// A number that is not 0, or the text of Python's `True`.
fn truth(value: &Value) -> Option<bool> {
    match value.text().map(str::to_lowercase).as_deref() {
        Some("true") => Some(true),
        Some("false") => Some(false),
        _ => value.number().map(|number| number != 0.0),
    }
}

fn by_pca(maps: &[&Value]) -> Option<bool> {
    first(maps, &["use_pca"]).and_then(truth)
}

/// What the settings beside the hands of a file say of components: those in maps without a pose.
pub(super) fn said(value: &Value) -> Value {
    let is_pose = |name: &&str| FINGER_NAMES.contains(name) || POSE_NAMES.contains(name);
    let settings = value
        .entries()
        .iter()
        .map(|(_, child)| child)
        .filter(|child| !child.entries().iter().any(|(name, _)| is_pose(&name.as_str())));
    let settings: Vec<&Value> = settings.collect();
    let names = std::iter::once("use_pca").chain(COUNT_NAMES);
    Value::Map(names.filter_map(|name| Some((name.to_owned(), first(&settings, &[name])?.clone()))).collect())
}

/// The meaning of an array named like the pose of fingers, beside the other values of these maps.
pub(super) fn meaning(array: &NumericArray, maps: &[&Value]) -> Result<Fingers, String> {
    let by_pca = by_pca(maps);
    let count = count(maps);
    match array.shape[..] {
        [.., 15, 3, 3] => return Ok(Fingers::Rotations(135)),
        [.., 15, 3] => return Ok(Fingers::Rotations(ROTATIONS)),
        [.., 135] => return Ok(Fingers::Rotations(135)),
        [.., width] if by_pca == Some(true) && count.is_some_and(|count| count != width) => {
            return Err(format!(
                "has {width} numbers, but the file says that it has {} components; correct one of them",
                count.unwrap_or_default()
            ));
        }
        [.., ROTATIONS] if by_pca == Some(true) => return Ok(Fingers::Components(ROTATIONS)),
        [.., ROTATIONS] => return Ok(Fingers::Rotations(ROTATIONS)),
        _ => {}
    }
    let unknown = || {
        let shape = &array.shape;
        Err(format!("has the shape {shape:?}, expected (T, 15, 3, 3), (T, 15, 3), (T, 45) or components (T, n)"))
    };
    let (rows, width) = match array.shape[..] {
        [width] => (1, width),
        [rows, width] | [1, rows, width] | [rows, 1, width] => (rows, width),
        _ => return unknown(),
    };
    let is_said = by_pca == Some(true) || count == Some(width);
    // 15 or 16 rows may be joints, whose rotations are quaternions, six numbers or matrices.
    let is_certain = (FEWEST..ROTATIONS).contains(&width) && !matches!(rows, 15 | 16);
    if by_pca != Some(false) && (1..ROTATIONS).contains(&width) && (is_said || is_certain) {
        return Ok(Fingers::Components(width));
    }
    if by_pca.is_none() && (FEWEST..ROTATIONS).contains(&width) {
        return Err(format!(
            "has the shape {:?}, which may be {width} components of {rows} frames or {width} numbers of {rows} joints; \
             add \"use_pca\": true, or give rotations (T, {rows}, 3)",
            array.shape
        ));
    }
    unknown()
}

/// The components of the model that the file's poses are for.
fn pose_space<'a>(source: &Source<'a>) -> Option<(&'a PoseSpace, Side)> {
    let model = source.pose_model.unwrap_or(source.model);
    let space = model.pose_space.as_ref()?;
    (3 * space.mean.len() == ROTATIONS && !space.components.is_empty()).then_some((space, model.side))
}

/// The rotations, from the mean pose, of a hand of that side.
pub(super) fn rotations(source: &Source, side: Side, components: &[f64]) -> Result<Vec<f64>, String> {
    let count = components.len();
    let file = if side == Side::Right { "MANO_RIGHT.pkl" } else { "MANO_LEFT.pkl" };
    let Some((space, own)) = pose_space(source) else {
        return Err(format!(
            "has {count} principal components of a pose, not rotations, and only MANO's own file has what they mean; \
             give it with --pose-model {file}, or store MANO's full pose, 45 axis-angle numbers"
        ));
    };
    if own != side {
        return Err(format!(
            "has {count} principal components of a {side} hand, and the model is of a {own} one, whose components are \
             others; give --pose-model {file}"
        ));
    }
    let directions = space.components.chunks_exact(ROTATIONS / 3);
    if directions.len() < count {
        let problem = format!("has {count} components, the model has {}; give the full MANO file", directions.len());
        return Err(problem);
    }
    let mut sum = [DVec3::ZERO; ROTATIONS / 3];
    for (part, direction) in components.iter().zip(directions) {
        sum.iter_mut().zip(direction).for_each(|(sum, direction)| *sum += *part * *direction);
    }
    Ok(sum.iter().flat_map(DVec3::to_array).collect())
}

/// The array of components of a map inside a file, by its name or by what the file says.
fn named<'a>(map: &'a Value, file: &Value, said: &Value) -> Option<(&'static str, &'a NumericArray)> {
    let numbers = |name: &'static str| Some((name, map.get(name)?.numbers()?));
    if let Some(found) = COMPONENT_NAMES.iter().find_map(|name| numbers(name)) {
        return Some(found);
    }
    let maps = [map, file, said];
    let by_pca = by_pca(&maps);
    let count = count(&maps);
    let has_orient = first(&[map], &estimates::ORIENT_NAMES).is_some();
    // `estimates` reads these beside the wrist.
    let fingers = if has_orient { &[][..] } else { &FINGER_NAMES[..] };
    fingers.iter().chain(&POSE_NAMES).filter_map(|name| numbers(name)).find(|(name, array)| {
        let width = array.shape.last().copied().unwrap_or(0);
        match (by_pca, count) {
            (Some(by_pca), _) => by_pca,
            (None, Some(count)) => [count, count + 3, count + 6].contains(&width) && count < ROTATIONS,
            (None, None) => FINGER_NAMES.contains(name) && matches!(meaning(array, &maps), Ok(Fingers::Components(_))),
        }
    })
}

/// Maps of the file with such an array, each with its id if it is a frame of a list.
fn maps_with_names<'a>(value: &'a Value, said: &Value) -> Vec<(&'a Value, Option<String>)> {
    if named(value, value, said).is_some() {
        return vec![(value, None)];
    }
    let frames = frames_of(value).unwrap_or_default().iter().enumerate();
    frames
        .filter(|(_, frame)| named(frame, value, said).is_some())
        .map(|(k, frame)| (frame, Some(id_of(frame, k))))
        .collect()
}

/// Whether a file has components. Arrays that are components only by their own names count if the model that gives them
/// their meaning is at hand; otherwise, something else in the file may be read.
pub(super) fn are_named(source: &Source, value: &Value) -> bool {
    let said = &said(value);
    let maps = maps_with_names(value, said);
    let is_said = |map: &Value| named(map, value, said).is_some_and(|(name, _)| !COMPONENT_NAMES.contains(&name));
    !maps.is_empty() && (pose_space(source).is_some() || maps.iter().any(|(map, _)| is_said(map)))
}

/// Hands of arrays that are components by name.
pub(super) fn hands(source: &Source, value: &Value) -> Result<Vec<Hand>, PoseError> {
    let mut hands = Vec::new();
    let said = &said(value);
    for (map, id) in maps_with_names(value, said) {
        let maps = [map, value, said];
        let Some((name, array)) = named(map, value, said) else { continue };
        let width = array.shape.last().copied().unwrap_or(0);
        let orients = flat(first(&maps, &ORIENT_NAMES));
        let parts = parts(width, &maps, !orients.is_empty()).map_err(|problem| source.invalid(name, problem))?;
        let side = first(&maps, &SIDE_NAMES).and_then(side_of);
        let count = array.values.len().checked_div(width).unwrap_or(0);
        let places = flat(first(&maps, &PLACE_NAMES));
        let shapes = flat(first(&maps, &SHAPE_NAMES));
        source.copied("shape", shapes.len() / count.max(1), count)?;
        for (k, row) in array.values.chunks_exact(width.max(1)).enumerate() {
            let id = match &id {
                Some(id) if count == 1 => id.clone(),
                Some(id) => format!("{id}.{k}"),
                None => format!("{k:04}"),
            };
            let shape_width = if shapes.len() > 10 { shapes.len() / count } else { shapes.len() };
            let beside = [(&orients, &[3, 9][..]), (&places, &[3]), (&shapes, &[shape_width])];
            let beside = beside.map(|(values, widths)| of_frame(values, k, count, widths));
            let frame = hand(source, &id, side, row, parts, beside).map_err(|problem| format!("{name} {problem}"));
            hands.push(Hand { from_components: true, ..Hand::new(id, side, frame) });
        }
    }
    Ok(hands)
}

/// How the numbers of a frame are divided.
#[derive(Clone, Copy)]
struct Parts {
    root: bool,
    components: usize,
}

/// The parts of `width` numbers: of DexYCB, or as the values beside them say.
fn parts(width: usize, maps: &[&Value], has_orient: bool) -> Result<Parts, String> {
    let said = count(maps);
    let all = |components: usize| Ok(Parts { root: false, components });
    let after_root = |components: usize| Ok(Parts { root: true, components });
    match (said, width) {
        (Some(said), _) if said == width => all(width),
        (Some(said), _) if said > 0 && (width == said + 3 || width == said + 6) => after_root(said),
        (Some(said), _) => {
            Err(format!("has {width} numbers for {said} components; expected {said}, {} or {}", said + 3, said + 6))
        }
        (None, 48 | 51) => after_root(ROTATIONS),
        (None, 1..=ROTATIONS) if has_orient || USUAL.contains(&width) => all(width),
        (None, _) => Err(format!(
            "has {width} numbers, some of which may be the wrist's; say how many are components with \"num_pca_comps\""
        )),
    }
}

/// The numbers of one frame: a row of one of these widths, or all numbers if they are shared.
fn of_frame<'a>(values: &'a [f64], k: usize, count: usize, widths: &[usize]) -> &'a [f64] {
    match widths.iter().find(|width| values.len() == **width * count) {
        Some(width) => values.get(k * width..(k + 1) * width).unwrap_or_default(),
        None => values,
    }
}

fn hand(
    source: &Source,
    id: &str,
    side: Option<Side>,
    row: &[f64],
    parts: Parts,
    [orient, place, shape]: [&[f64]; 3],
) -> Result<super::PoseFrame, String> {
    if row.iter().all(|number| *number == 0.0) {
        return Err("is zero: there is no hand".into());
    }
    let (root, rest) = row.split_at_checked(if parts.root { 3 } else { 0 }).unwrap_or_default();
    let (components, own_place) = rest.split_at_checked(parts.components).unwrap_or_default();
    let zero = [0.0; 3];
    let root = if parts.root {
        root
    } else if orient.is_empty() {
        &zero
    } else {
        orient
    };
    let place = if own_place.is_empty() { place } else { own_place };
    frame(id, root, &rotations(source, side.unwrap_or(source.wanted), components)?, shape, place)
}

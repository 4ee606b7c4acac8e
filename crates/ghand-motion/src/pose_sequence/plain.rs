//! Arrays whose meaning follows from their shape.
//!
//! An array is an `.npy` file, numbers in JSON, the only such array of an `.npz` or a map, or one array for each frame
//! of a list. Meaning of the shapes (with a leading T, or without for one frame):
//!
//! | shape | meaning |
//! |---|---|
//! | (T, 45), (T, 15, 3) | axis-angle rotations of MANO's joints except the wrist |
//! | (T, 48), (T, 16, 3) | the same after the wrist's |
//! | (T, 51) | 48 and a translation |
//! | (T, 58) | 48 and 10 shape parameters |
//! | (T, 61) | FreiHAND's `mano`: 48, 10 shape parameters, image place and scale of the root, which are not used |
//! | (T, 15, 3, 3), (T, 135); (T, 16, 3, 3), (T, 144) | the same as matrices, row by row |
//! | (T, 21, 3), (T, 63) | landmarks in MediaPipe's order, which is FreiHAND's |
//! | (T, 25 or 26, 7 or 16 or 4, 4), (T, 400 or 416) | joints of WebXR or OpenXR (`xr.rs`) |
//! | (T, n_b, 3) for a model of other `n_b` joints | rotations of the model's own joints |
//!
//! Axes of length 1 are ignored. Next to the array, `global_orient`, `root_orient` or `rot` may give the wrist's
//! rotation, `trans`, `transl` or `translation` its position, and `betas` or `shape` the hand's shape. Rotations are
//! measured from the flat hand, FreiHAND's from MANO's mean pose; `flat_hand_mean` overrides this.

use ghand_core::{Pose, Side};
use ghand_files::npz::NumericArray;
use ghand_files::value::Value;
use glam::DVec3;

use super::landmarks;
use super::recording::{LandmarkFrame, ManoRows, Rows};
use super::source::{fps_of_times, frames_of, id_of, side_of};
use super::{Motion, PoseError, PoseFrame, Recording, Skipped, Source, mano, xr};

/// Names of the array itself, which take precedence.
const ARRAY_NAMES: [&str; 12] = [
    "pose",
    "poses",
    "mano_pose",
    "mano_poses",
    "full_pose",
    "fullpose",
    "hand_pose",
    "rotations",
    "xyz",
    "joints",
    "keypoints_3d",
    "joints_3d",
];
const ORIENT_NAMES: [&str; 6] = ["global_orient", "root_orient", "rot", "root_pose", "wrist_rotation", "orient"];
const PLACE_NAMES: [&str; 5] = ["trans", "transl", "translation", "root_trans", "cam_t"];
const SHAPE_NAMES: [&str; 3] = ["betas", "shape", "beta"];
/// Arrays that are never the pose: accompanying data, landmarks of an image, and DexYCB's principal components.
const NOT_THE_POSE: [&[&str]; 5] =
    [&ORIENT_NAMES, &PLACE_NAMES, &SHAPE_NAMES, &landmarks::IMAGE_NAMES, &super::refusal::COMPONENT_NAMES];
const SIDE_NAMES: [&str; 5] = ["side", "handedness", "hand_side", "hand", "is_right"];

/// The meaning of a frame's numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Meaning {
    /// MANO's joints: with the wrist or without, numbers of a rotation, numbers of translation and of shape after them.
    Mano {
        joints: usize,
        width: usize,
        translation: usize,
        shape: usize,
        from_mean: bool,
    },
    Landmarks,
    /// The model's own joints.
    Own,
}

/// The array of the frames with its meaning.
struct Found<'a> {
    array: &'a NumericArray,
    meaning: Meaning,
    /// Numbers per frame.
    size: usize,
    is_single: bool,
}

pub(super) fn read(source: &Source, value: &Value) -> Option<Result<Recording, PoseError>> {
    let top = value.get("frames").unwrap_or(value);
    let whole = [top, value].into_iter().find_map(|value| array_of(source, value));
    if let Some(array) = whole {
        if xr::is_joints(array) {
            return Some(xr::numbers_of_joints(source, value, array));
        }
        return Some(recording_of_array(source, value, found(source, array)?));
    }
    let frames = frames_of(value)?;
    let frames: Vec<(&Value, Option<Found>)> = frames.iter().map(|frame| (frame, single(source, frame))).collect();
    let meaning = frames.iter().find_map(|(_, found)| Some(found.as_ref()?.meaning))?;
    Some(recording_of_frames(source, value, &frames, meaning))
}

/// The array that a value is or contains.
fn array_of<'a>(source: &Source, value: &'a Value) -> Option<&'a Value> {
    let is_one = |value: &Value| found(source, value).is_some() || xr::is_joints(value);
    match value {
        Value::Numbers(_) => is_one(value).then_some(value),
        // ghand's own rows, regardless of other arrays.
        Value::Map(_) if value.get("pose").is_some_and(|pose| is_own_rows(source, pose)) => None,
        Value::Map(entries) => {
            let is_pose = |(name, value): &(&str, &Value)| {
                let is_beside = NOT_THE_POSE.iter().any(|names| names.contains(name));
                let is_hand = side_of(&Value::Text((*name).into())).is_some();
                !is_beside && !is_hand && is_one(value)
            };
            let named = ARRAY_NAMES.iter().filter_map(|name| Some((*name, value.get(name)?))).find(is_pose);
            let mut all = entries.iter().map(|(name, value)| (name.as_str(), value)).filter(is_pose);
            let only = all.next().filter(|_| all.next().is_none());
            named.or(only).map(|(_, value)| value)
        }
        _ => None,
    }
}

/// Whether rows of three numbers named "pose" are those of ghand's own files: one row for each joint of a model.
fn is_own_rows(source: &Source, value: &Value) -> bool {
    match value.numbers().map(|array| &array.shape[..]) {
        Some([rows, 3] | [_, rows, 3]) => *rows != 15 || source.joint_count == 15,
        _ => false,
    }
}

/// The array of a frame of a list.
fn single<'a>(source: &Source, frame: &'a Value) -> Option<Found<'a>> {
    found(source, array_of(source, frame)?).filter(|found| found.is_single)
}

fn found<'a>(source: &Source, value: &'a Value) -> Option<Found<'a>> {
    let array = value.numbers()?;
    let axes: Vec<usize> = array.shape.iter().copied().filter(|axis| *axis != 1).collect();
    let of = |frame: &[usize]| meaning(source, frame).map(|meaning| (meaning, frame.iter().product::<usize>()));
    let (is_single, (meaning, size)) = match of(&axes) {
        Some(found) => (true, found),
        None => (false, of(axes.get(1..)?)?),
    };
    Some(Found { array, meaning, size, is_single })
}

/// The meaning of a frame of that shape.
fn meaning(source: &Source, shape: &[usize]) -> Option<Meaning> {
    let mano = |joints, width| Meaning::Mano { joints, width, translation: 0, shape: 0, from_mean: false };
    Some(match *shape {
        [45] | [15, 3] => mano(15, 3),
        [48] | [16, 3] => mano(16, 3),
        [135] | [15, 3, 3] => mano(15, 9),
        [144] | [16, 3, 3] => mano(16, 9),
        [51] => Meaning::Mano { joints: 16, width: 3, translation: 3, shape: 0, from_mean: false },
        [58] => Meaning::Mano { joints: 16, width: 3, translation: 0, shape: 10, from_mean: false },
        [61] => Meaning::Mano { joints: 16, width: 3, translation: 0, shape: 10, from_mean: true },
        [63] | [21, 3] => Meaning::Landmarks,
        [joints, 3] if joints == source.joint_count => Meaning::Own,
        _ => return None,
    })
}

fn recording_of_array(source: &Source, value: &Value, found: Found) -> Result<Recording, PoseError> {
    let count = found.array.values.len().checked_div(found.size).unwrap_or(0);
    let ids = value.get("ids").and_then(|ids| match ids {
        Value::List(ids) if ids.len() == count => ids.iter().map(|id| id.text().map(str::to_owned)).collect(),
        _ => None::<Vec<String>>,
    });
    let beside = |names: &[&'static str], widths: &[usize]| beside(source, value, names, widths, count);
    let orients = beside(&ORIENT_NAMES, &[3, 9])?;
    let places = beside(&PLACE_NAMES, &[3])?;
    let shapes = beside(&SHAPE_NAMES, &[])?;
    let mut reader = Reader::new(found.meaning);
    for (k, numbers) in found.array.values.chunks_exact(found.size.max(1)).enumerate() {
        let id = ids.as_ref().and_then(|ids| ids.get(k).cloned()).unwrap_or_else(|| format!("{k:04}"));
        reader.add(id, numbers, orients.of(k), places.of(k), shapes.of(k));
    }
    reader.finish(source, value, None, None)
}

fn recording_of_frames(
    source: &Source,
    value: &Value,
    frames: &[(&Value, Option<Found>)],
    meaning: Meaning,
) -> Result<Recording, PoseError> {
    let mut reader = Reader::new(meaning);
    for (number, (frame, found)) in frames.iter().enumerate() {
        let id = id_of(frame, number);
        let Some(found) = found else {
            let known: Vec<&str> = frame.entries().iter().map(|(name, _)| name.as_str()).collect();
            let found = if known.is_empty() { frame.kind() } else { known.join(", ") };
            reader.skip(&id, format!("has no array of a known shape, but {found}"));
            continue;
        };
        if found.meaning != meaning {
            reader.skip(&id, format!("has numbers of the shape {:?}, unlike the previous frames", found.array.shape));
            continue;
        }
        let numbers = |names: &[&str]| -> &[f64] {
            let found = names.iter().find_map(|name| frame.get(name)?.numbers());
            found.map(|array| array.values.as_slice()).unwrap_or_default()
        };
        reader.add(id, &found.array.values, numbers(&ORIENT_NAMES), numbers(&PLACE_NAMES), numbers(&SHAPE_NAMES));
    }
    let items: Vec<Value> = frames.iter().map(|(frame, _)| without_numbers(frame)).collect();
    let side = frames.iter().find_map(|(frame, _)| side_in(frame));
    let flat = frames.iter().find_map(|(frame, _)| frame.get("flat_hand_mean")?.number());
    let mut recording = reader.finish(source, value, flat, fps_of_times(&items))?;
    recording.side = recording.side.or(side);
    Ok(recording)
}

/// Data of a frame besides its arrays: small enough to be copied.
fn without_numbers(frame: &Value) -> Value {
    let is_small = |(_, value): &&(String, Value)| value.number().is_some();
    Value::Map(frame.entries().iter().filter(is_small).cloned().collect())
}

fn side_in(value: &Value) -> Option<Side> {
    SIDE_NAMES.iter().find_map(|name| value.get(name)).and_then(side_of)
}

/// Numbers beside the array: one row per frame, or one row for all.
struct Beside<'a> {
    values: &'a [f64],
    width: usize,
    is_shared: bool,
}

impl Beside<'_> {
    fn of(&self, frame: usize) -> &[f64] {
        let first = if self.is_shared { 0 } else { frame * self.width };
        self.values.get(first..first + self.width).unwrap_or_default()
    }
}

/// The numbers with one of these names for this many frames, with one of these widths if any are given.
fn beside<'a>(
    source: &Source,
    value: &'a Value,
    names: &[&'static str],
    widths: &[usize],
    count: usize,
) -> Result<Beside<'a>, PoseError> {
    let named = names.iter().find_map(|name| Some((name, value.get(name)?.numbers()?)));
    let Some((name, array)) = named else { return Ok(Beside { values: &[], width: 0, is_shared: true }) };
    let total = array.values.len();
    let fits = |width: usize| width > 0 && (widths.is_empty() || widths.contains(&width));
    match array.shape[..] {
        [rows, _, ..] if rows == count && count > 0 && fits(total / count) => {
            Ok(Beside { values: &array.values, width: total / count, is_shared: false })
        }
        [] | [_] | [1, ..] if fits(total) => {
            source.copied(name, total, count)?;
            Ok(Beside { values: &array.values, width: total, is_shared: true })
        }
        _ => {
            let width = widths.first().map_or("n".into(), usize::to_string);
            let problem =
                format!("has the shape {:?} for {count} frames, expected ({count}, {width}) or ({width})", array.shape);
            Err(source.invalid(name, problem))
        }
    }
}

/// Frames in their order.
struct Reader {
    meaning: Meaning,
    posed: Vec<PoseFrame>,
    seen: Vec<LandmarkFrame>,
    skipped: Skipped,
    skipped_count: usize,
}

impl Reader {
    fn new(meaning: Meaning) -> Reader {
        Reader { meaning, posed: vec![], seen: vec![], skipped: Skipped::default(), skipped_count: 0 }
    }

    fn add(&mut self, id: String, numbers: &[f64], orient: &[f64], place: &[f64], shape: &[f64]) {
        let problem = match self.meaning {
            Meaning::Landmarks => match landmarks::points_of(numbers) {
                Ok(points) => return self.seen.push(LandmarkFrame { id, points }),
                Err(problem) => problem,
            },
            Meaning::Own => match own(&id, numbers, place, shape) {
                Ok(frame) => return self.posed.push(frame),
                Err(problem) => problem,
            },
            Meaning::Mano { joints, width, translation, shape: shapes, .. } => {
                let (rotations, rest) = numbers.split_at_checked(joints * width).unwrap_or((numbers, &[]));
                let (own_place, rest) = rest.split_at_checked(translation).unwrap_or((&[], &[]));
                let own_shape = rest.get(..shapes).unwrap_or_default();
                let (root, fingers) = if joints == 16 { rotations.split_at(width) } else { (&[0.0; 3][..], rotations) };
                let root = if joints == 15 && !orient.is_empty() { orient } else { root };
                let place = if translation > 0 { own_place } else { place };
                let shape = if shapes > 0 { own_shape } else { shape };
                match mano::frame(&id, root, fingers, shape, place) {
                    Ok(frame) => return self.posed.push(frame),
                    Err(problem) => problem,
                }
            }
        };
        self.skip(&id, problem);
    }

    fn skip(&mut self, id: &str, problem: String) {
        self.skipped_count += 1;
        self.skipped.add(id, problem);
    }

    fn finish(
        self,
        source: &Source,
        value: &Value,
        flat: Option<f64>,
        fps: Option<f64>,
    ) -> Result<Recording, PoseError> {
        let total = self.posed.len() + self.seen.len() + self.skipped_count;
        let warnings = self.skipped.finish(source, total)?.into_iter().collect();
        let flat = value.get("flat_hand_mean").and_then(Value::number).or(flat).map(|flat| flat != 0.0);
        let side = side_in(value);
        let fps = source.fps(value, &["fps", "frame_rate", "mocap_framerate"])?.or(fps);
        let (motion, side) = match self.meaning {
            Meaning::Landmarks => (Motion::Landmarks { frames: self.seen, tip_inset: 0.0 }, side),
            Meaning::Own => {
                let from_mean = !flat.unwrap_or(true);
                let rows = Rows { rig: None, frames: self.posed, capture_kind: None, from_mean, side };
                (Motion::Rows(Box::new(rows)), side)
            }
            Meaning::Mano { from_mean, .. } => {
                let rows =
                    ManoRows { frames: self.posed, from_mean: flat.map_or(from_mean, |flat| !flat), opengl: false };
                // FreiHAND has only right hands.
                (Motion::Mano(rows), side.or(from_mean.then_some(Side::Right)))
            }
        };
        Ok(Recording { side, fps, motion, warnings })
    }
}

fn own(id: &str, numbers: &[f64], place: &[f64], shape: &[f64]) -> Result<PoseFrame, String> {
    let translation = match place {
        [] => DVec3::ZERO,
        [x, y, z] => DVec3::new(*x, *y, *z),
        other => return Err(format!("has a translation of {} numbers, expected 3", other.len())),
    };
    let rotations = numbers.chunks_exact(3).map(DVec3::from_slice).collect();
    Ok(PoseFrame { id: id.into(), pose: Pose { rotations, translation }, shape: shape.to_vec() })
}

//! Arrays of rotations or landmarks.
//!
//! An array is an `.npy` file, numbers in JSON, an array of an `.npz` or a map, or one array for each frame of a list. In a
//! map, names decide ([`named`]): an array with a name that says nothing is read only if there is no other. Meaning of the
//! shapes (with a leading T, or without for one frame):
//!
//! | shape | meaning |
//! |---|---|
//! | (T, 45), (T, 15, 3) | axis-angle rotations of MANO's joints except the wrist |
//! | (T, 48), (T, 16, 3) | the same after the wrist's |
//! | (T, 51) | 48 and a translation |
//! | (T, 58) | 48 and 10 shape parameters |
//! | (T, 61) | FreiHAND's `mano`: 48, 10 shape parameters, image place and scale of the root, which are not used |
//! | (T, 15, 3, 3), (T, 135); (T, 16, 3, 3), (T, 144) | the same as matrices, row by row |
//! | (T, 21, 3), (T, 63) | landmarks in MediaPipe's order, which is FreiHAND's; also MANO's with tips, or InterHand2.6M's |
//! | (T, 25 or 26, 7 or 16 or 4, 4), (T, 400 or 416) | joints of WebXR or OpenXR (`xr.rs`) |
//! | (T, 25 or 26, 3) named as positions, or that are a hand | positions of the same joints |
//! | (T, n_b, 3) for a model of other `n_b` joints | rotations of the model's own joints |
//!
//! Axes of length 1 are ignored. Landmarks must have a hand's proportions and rotations must be radians. Next to the array, `global_orient`, `root_orient` or `rot` may give the wrist's
//! rotation, `trans`, `transl` or `translation` its position, and `betas` or `shape` the hand's shape. Rotations are
//! measured from the flat hand, FreiHAND's from MANO's mean pose; `flat_hand_mean` overrides this.

use ghand_core::pose::LARGEST_ANGLE;
use ghand_core::{Pose, Side};
use ghand_files::npz::NumericArray;
use ghand_files::value::Value;
use glam::DVec3;

use super::{landmarks, mano, xr};
use crate::pose_sequence::reading::names::{Named, named};
use crate::pose_sequence::reading::recording::{LandmarkFrame, ManoRows, Rows};
use crate::pose_sequence::reading::source::{frames_of, id_of, side_of};
use crate::pose_sequence::transfer::proportions;
use crate::pose_sequence::{Motion, PoseError, PoseFrame, Recording, Skipped, Source};

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
/// Other data of the frames.
const BESIDE_NAMES: [&str; 13] = [
    "fps",
    "ids",
    "time",
    "times",
    "timestamp",
    "timestamps",
    "frame",
    "frames",
    "frame_ids",
    "frame_indices",
    "mirrored",
    "flat_hand_mean",
    "gender",
];
/// Arrays that are never the pose: accompanying data, landmarks of an image, and DexYCB's principal components.
const NOT_THE_POSE: [&[&str]; 5] = [
    &ORIENT_NAMES,
    &PLACE_NAMES,
    &SHAPE_NAMES,
    &landmarks::IMAGE_NAMES,
    &crate::pose_sequence::reading::refusal::COMPONENT_NAMES,
];
const SIDE_NAMES: [&str; 5] = ["side", "handedness", "hand_side", "hand", "is_right"];

/// Most frames that are looked at to see what an array is.
const MOST_JUDGED: usize = 200;

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
    /// Positions of WebXR's joints.
    XrPositions,
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
    /// Whether its name says nothing.
    is_bare: bool,
}

pub(crate) fn read(source: &Source, value: &Value) -> Option<Result<Recording, PoseError>> {
    let top = value.get("frames").unwrap_or(value);
    let mut whole = None;
    for holder in [top, value] {
        whole = match array_of(source, holder) {
            Ok(found) => whole.or(found),
            Err(problem) => return Some(Err(source.invalid("arrays", problem))),
        };
    }
    if let Some((name, array)) = whole {
        if xr::is_joints(array) {
            return Some(xr::numbers_of_joints(source, value, array));
        }
        return Some(recording_of_array(source, value, found(source, name, array)?));
    }
    let frames = frames_of(value)?;
    let frames: Vec<(&Value, Option<Found>)> = frames.iter().map(|frame| (frame, single(source, frame))).collect();
    let meaning = frames.iter().find_map(|(_, found)| Some(found.as_ref()?.meaning))?;
    Some(recording_of_frames(source, value, &frames, meaning))
}

/// The array that a value is or contains, with what its name says; a problem if it has several that could be meant.
fn array_of<'a>(source: &Source, value: &'a Value) -> Result<Option<(Named, &'a Value)>, String> {
    let is_one = |named: Named, value: &Value| found(source, named, value).is_some() || xr::is_joints(value);
    let entries = match value {
        Value::Numbers(_) => return Ok(is_one(Named::Nothing, value).then_some((Named::Nothing, value))),
        // ghand's own rows, regardless of other arrays.
        Value::Map(_) if value.get("pose").is_some_and(|pose| is_own_rows(source, pose)) => return Ok(None),
        Value::Map(entries) => entries,
        _ => return Ok(None),
    };
    let is_beside = |name: &str| NOT_THE_POSE.iter().any(|names| names.contains(&name)) || BESIDE_NAMES.contains(&name);
    let is_side = |name: &str, value: &Value| {
        SIDE_NAMES.contains(&name) && value.numbers().is_some_and(|array| array.shape.len() < 2)
    };
    let is_array = |value: &Value| value.numbers().is_some_and(|array| array.values.len() > 1);
    let arrays: Vec<(&str, Named, &Value)> = entries
        .iter()
        .filter(|(name, value)| is_array(value) && !is_beside(name) && !is_side(name, value))
        .filter(|(name, _)| side_of(&Value::Text(name.clone())).is_none())
        .map(|(name, value)| (name.as_str(), named(name), value))
        .collect();
    let exact = ARRAY_NAMES
        .iter()
        .find_map(|wanted| arrays.iter().find(|(name, kind, value)| name == wanted && is_one(*kind, value)));
    if let Some((_, kind, array)) = exact {
        return Ok(Some((*kind, array)));
    }
    let of_hands: Vec<_> = arrays
        .iter()
        .filter(|(_, kind, value)| !matches!(kind, Named::Nothing | Named::Other) && is_one(*kind, value))
        .collect();
    match of_hands[..] {
        [(_, kind, array)] => return Ok(Some((*kind, array))),
        [] => {}
        _ => {
            let names: Vec<String> = of_hands.iter().map(|(name, ..)| format!("{name:?}")).collect();
            return Err(format!(
                "{} could all be the pose; keep one of them, or call it \"poses\" (rotations) or \"xyz\" (positions)",
                names.join(", ")
            ));
        }
    }
    Ok(match arrays[..] {
        [(_, Named::Nothing, array)] if is_one(Named::Nothing, array) => Some((Named::Nothing, array)),
        _ => None,
    })
}

/// Whether one of a value's arrays is a hand's pose.
pub(crate) fn has_hand(source: &Source, value: &Value) -> bool {
    matches!(array_of(source, value), Ok(Some((name, _))) if name != Named::Nothing)
}

/// Why none of a value's arrays is read, if their names are the cause.
pub(crate) fn problem_of_names(source: &Source, value: &Value) -> Option<String> {
    let has_shape = |value: &Value| found(source, Named::Nothing, value).is_some();
    let shaped = value.entries().iter().filter(|(_, value)| has_shape(value));
    let (other, unclear): (Vec<_>, Vec<_>) = shaped.partition(|(name, _)| named(name) == Named::Other);
    let list = |entries: &[&(String, Value)]| {
        entries.iter().take(6).map(|(name, _)| format!("{name:?}")).collect::<Vec<_>>().join(", ")
    };
    if !unclear.is_empty() && value.entries().len() > 1 {
        let names = list(&unclear);
        return Some(format!(
            "has several arrays, and the names do not say which is the hand's pose ({names}); call it \"poses\" (rotations) or \
             \"xyz\" (positions), or keep it alone"
        ));
    }
    let names = list(&other);
    let (whose, hold) = if other.len() == 1 { ("its name", "holds") } else { ("their names", "hold") };
    (!other.is_empty()).then(|| {
        format!(
            "has no hand: by {whose}, {names} {hold} a body's pose, a shape, a face or the like; a hand's pose is \
             called \"hand_pose\", \"right_hand_pose\" or \"poses\""
        )
    })
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
    let (name, array) = array_of(source, frame).ok()??;
    found(source, name, array).filter(|found| found.is_single)
}

fn found<'a>(source: &Source, name: Named, value: &'a Value) -> Option<Found<'a>> {
    let array = value.numbers()?;
    let axes: Vec<usize> = array.shape.iter().copied().filter(|axis| *axis != 1).collect();
    let of =
        |frame: &[usize]| meaning(source, name, frame, array).map(|meaning| (meaning, frame.iter().product::<usize>()));
    let (is_single, (meaning, size)) = match of(&axes) {
        Some(found) => (true, found),
        None => (false, of(axes.get(1..)?)?),
    };
    Some(Found { array, meaning, size, is_single, is_bare: name == Named::Nothing })
}

/// The meaning of a frame of that shape in an array with such a name.
fn meaning(source: &Source, name: Named, shape: &[usize], array: &NumericArray) -> Option<Meaning> {
    let mano = |joints, width| Meaning::Mano { joints, width, translation: 0, shape: 0, from_mean: false };
    let is_positions = || name == Named::Positions || (name != Named::Rotations && is_xr_hand(array));
    Some(match *shape {
        [63] if name == Named::Rotations => return None,
        [63] | [21, 3] => Meaning::Landmarks,
        [25 | 26, 3] | [75 | 78] if is_positions() => Meaning::XrPositions,
        [joints, 3] if joints == source.joint_count && !matches!(joints, 15 | 16) && name != Named::Positions => {
            Meaning::Own
        }
        _ if name == Named::Positions => return None,
        [45] | [15, 3] => mano(15, 3),
        [48] | [16, 3] => mano(16, 3),
        [135] | [15, 3, 3] => mano(15, 9),
        [144] | [16, 3, 3] => mano(16, 9),
        [51] => Meaning::Mano { joints: 16, width: 3, translation: 3, shape: 0, from_mean: false },
        [58] => Meaning::Mano { joints: 16, width: 3, translation: 0, shape: 10, from_mean: false },
        [61] => Meaning::Mano { joints: 16, width: 3, translation: 0, shape: 10, from_mean: true },
        _ => return None,
    })
}

/// Whether rows of three numbers are the positions of a hand's joints in WebXR's order.
fn is_xr_hand(array: &NumericArray) -> bool {
    let joints = if array.values.len().is_multiple_of(26 * 3) && array.shape.iter().any(|axis| matches!(axis, 26 | 78))
    {
        26
    } else {
        25
    };
    let frame = |numbers: &[f64]| {
        let at = |k: usize| {
            numbers
                .get(3 * (k + joints - 25)..)
                .and_then(<[f64]>::first_chunk)
                .map_or(DVec3::NAN, |p| DVec3::from_array(*p))
        };
        proportions::XR_ORDER.map(at)
    };
    let frames: Vec<_> = array.values.chunks_exact(3 * joints).take(MOST_JUDGED).map(frame).collect();
    !frames.is_empty() && proportions::is_hand(&frames)
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
    if found.meaning == Meaning::XrPositions {
        let rows = found.array.values.len() / 3;
        let joints = if found.size == 78 { 26 } else { 25 };
        let shape = vec![rows / joints, joints, 3];
        return xr::positions_alone(source, value, &NumericArray { shape, values: found.array.values.clone() });
    }
    check_radians(source, &found)?;
    let mut reader = Reader::new(found.meaning);
    for (k, numbers) in found.array.values.chunks_exact(found.size.max(1)).enumerate() {
        let id = ids.as_ref().and_then(|ids| ids.get(k).cloned()).unwrap_or_else(|| format!("{k:04}"));
        reader.add(id, numbers, orients.of(k), places.of(k), shapes.of(k));
    }
    reader.finish(source, value, None)
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
    let side = frames.iter().find_map(|(frame, _)| side_in(frame));
    let flat = frames.iter().find_map(|(frame, _)| frame.get("flat_hand_mean")?.number());
    let mut recording = reader.finish(source, value, flat)?;
    recording.side = recording.side.or(side);
    Ok(recording)
}

/// Rejects rotations of an array without a telling name if no hand can have them.
fn check_radians(source: &Source, found: &Found) -> Result<(), PoseError> {
    let Meaning::Mano { joints, width: 3, .. } = found.meaning else { return Ok(()) };
    let length = |row: &[f64]| DVec3::from_slice(row).length();
    let rows = found.array.values.chunks_exact(found.size).flat_map(|frame| frame.chunks_exact(3).take(joints));
    let largest = rows.map(length).filter(|length| *length <= LARGEST_ANGLE).fold(0.0, f64::max);
    if !found.is_bare || largest < std::f64::consts::TAU {
        return Ok(());
    }
    let problem = format!(
        "has rotations of up to {largest:.1}, which radians of a hand's joints are not; are they degrees? give radians \
         (numpy.deg2rad), or name the array \"poses\" if it is right"
    );
    Err(source.invalid("rotations", problem))
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
}

impl Reader {
    fn new(meaning: Meaning) -> Reader {
        Reader { meaning, posed: vec![], seen: vec![], skipped: Skipped::default() }
    }

    fn add(&mut self, id: String, numbers: &[f64], orient: &[f64], place: &[f64], shape: &[f64]) {
        let problem = match self.meaning {
            Meaning::Landmarks | Meaning::XrPositions => match landmarks::points_of(numbers) {
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
        self.skipped.add(id, problem);
    }

    fn finish(mut self, source: &Source, value: &Value, flat: Option<f64>) -> Result<Recording, PoseError> {
        let flat = value.get("flat_hand_mean").and_then(Value::number).or(flat).map(|flat| flat != 0.0);
        let side = side_in(value);
        let mut warnings = vec![];
        let (motion, side) = match self.meaning {
            Meaning::Landmarks | Meaning::XrPositions => {
                if !self.seen.is_empty() {
                    let order = proportions::put_in_order(&mut self.seen);
                    warnings.extend(order.map_err(|problem| source.invalid("landmarks", problem))?);
                }
                (Motion::Landmarks { frames: self.seen, tip_inset: 0.0 }, side)
            }
            Meaning::Own => {
                let from_mean = !flat.unwrap_or(true);
                let rows = Rows { rig: None, frames: self.posed, capture_kind: None, from_mean, side };
                (Motion::Rows(Box::new(rows)), side)
            }
            Meaning::Mano { from_mean, .. } => {
                let left = mano::left_rotations(&[value]);
                let from_mean_too = flat.map_or(from_mean, |flat| !flat);
                let rows = ManoRows { frames: self.posed, from_mean: from_mean_too, opengl: false, left };
                // FreiHAND has only right hands.
                (Motion::Mano(rows), side.or(from_mean.then_some(Side::Right)))
            }
        };
        Ok(Recording { side, usual_fps: None, motion, skipped: self.skipped, warnings })
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

//! Arrays of pixels: (T, 21, 2 or 3) of one camera, (T, cameras, 21, 2 or 3) or (cameras, T, 21, 2 or 3); InterHand2.6M's 42
//! joints in place of the 21, right hand first, with `joint_valid`; and FreeMoCap's (cameras, T, points, 2 or 3) with a
//! body of 33 points, hands and a face.

use ghand_core::Side;
use ghand_files::npz::NumericArray;
use ghand_files::value::Value;

use super::view::{Content, Landmarks, Problem, View, Views, from_interhand, point, problem};
use super::{LANDMARK_COUNT, MEDIAPIPE_TIP_INSET};

/// Points of MediaPipe's body, and its wrists.
const BODY: usize = 33;
const LEFT_WRIST: usize = 15;
const RIGHT_WRIST: usize = 16;
/// FreeMoCap's points without a face.
const BODY_AND_HANDS: usize = BODY + 2 * LANDMARK_COUNT;
/// Joints of InterHand2.6M, and the first one of the left hand.
const BOTH_HANDS: usize = 2 * LANDMARK_COUNT;

/// Names of arrays that say how sure or valid each point is.
const SCORE_NAMES: [&str; 9] =
    ["joint_valid", "valid", "scores", "score", "confidence", "confidences", "conf", "likelihood", "visibility"];
/// Names of the points of one frame beside `joint_valid`.
const JOINT_NAMES: [&str; 6] = ["joint_img", "joints_2d", "joint_2d", "joints2d", "keypoints_2d", "keypoints"];

/// What the points of an array are.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Layout {
    Hand,
    InterHand,
    FreeMoCap,
}

impl Layout {
    fn of(points: usize) -> Option<Layout> {
        match points {
            LANDMARK_COUNT => Some(Layout::Hand),
            BOTH_HANDS => Some(Layout::InterHand),
            BODY_AND_HANDS.. => Some(Layout::FreeMoCap),
            _ => None,
        }
    }
}

/// An array by itself, or the first fitting one of a map. `cameras` is their number.
pub(super) fn read(value: &Value, side: Side, cameras: usize) -> Option<Result<Content, Problem>> {
    if let Some(content) = interhand_frames(value, side) {
        return Some(content);
    }
    // Vertices of meshes have three axes, too.
    let fits = |value: &Value| {
        value.numbers().is_some_and(|array| match array.shape[..] {
            [_, LANDMARK_COUNT | BOTH_HANDS, 2 | 3] => true,
            [_, _, points, 2 | 3] => Layout::of(points).is_some(),
            _ => false,
        })
    };
    let (name, array) = match value {
        Value::Numbers(array) if fits(value) => ("array", array),
        Value::Map(entries) => {
            let (name, found) = entries.iter().find(|(_, value)| fits(value))?;
            (name.as_str(), found.numbers()?)
        }
        _ => return None,
    };
    let scores = SCORE_NAMES.iter().find_map(|name| value.get(name)?.numbers());
    let mut content = content(name, array, scores, side, cameras);
    if let Ok(content) = &mut content {
        content.fps = value.get("fps").and_then(Value::number);
    }
    Some(content)
}

fn content(
    name: &str,
    array: &NumericArray,
    scores: Option<&NumericArray>,
    side: Side,
    cameras: usize,
) -> Result<Content, Problem> {
    let (outer, points, width) = match array.shape[..] {
        [frames, points, width] => ([1, frames], points, width),
        [first, second, points, width] => ([first, second], points, width),
        _ => return problem(name, "must have three or four axes"),
    };
    let is_single = array.shape.len() == 3;
    let layout = Layout::of(points).unwrap_or(Layout::Hand);
    let mut remarks = vec![];
    let is_camera_first = match outer {
        _ if is_single || layout == Layout::FreeMoCap => true,
        [first, second] if first == cameras && second == cameras => {
            remarks.push(format!(
                "has {cameras} cameras and {cameras} frames: its first axis is taken as that of the frames"
            ));
            false
        }
        [first, _] if first == cameras => true,
        [_, second] if second == cameras => false,
        _ => {
            let text = format!(
                "has the shape {:?}, of which no axis has the number of cameras, {cameras}; give (T, cameras, 21, 2 or 3)",
                array.shape
            );
            return problem(name, text);
        }
    };
    let [views, frames] = if is_camera_first { outer } else { [outer[1], outer[0]] };
    if !is_single && views != cameras {
        let text =
            format!("is of {views} cameras, and there are {cameras}; give the cameras that filmed it, in its order");
        return problem(name, text);
    }
    let places = views.saturating_mul(frames).saturating_mul(points);
    let scores = match scores.map(|scores| scores.values.as_slice()) {
        Some(scores) if scores.len() == places => scores,
        Some(scores) => {
            let text = format!("has {} numbers, and {name} has {places} points; give one for each point", scores.len());
            return problem("joint_valid or scores", text);
        }
        None => &[],
    };
    // A third number from 0 to 1 is a score, else a depth.
    let thirds =
        || array.values.chunks_exact(width).filter_map(|values| values.get(2)).filter(|third| third.is_finite());
    let has_scores = width == 3 && layout != Layout::FreeMoCap && thirds().all(|third| (0.0..=1.0).contains(third));
    if width == 3 && layout == Layout::Hand && !has_scores {
        remarks.push("has third numbers that are not from 0 to 1: they are taken as depths and not used".into());
    }
    let at = |place: usize| {
        let values = array.values.get(place * width..(place + 1) * width)?;
        let third = values.get(2).filter(|_| has_scores).copied().unwrap_or(1.0);
        let score = scores.get(place).copied().unwrap_or(1.0);
        point(*values.first()?, *values.get(1)?, third * score)
    };
    let first_of =
        |view: usize, frame: usize| points * if is_camera_first { view * frames + frame } else { frame * views + view };
    let hand_at = |view: usize, frame: usize, offset: usize| -> Landmarks {
        std::array::from_fn(|k| at(first_of(view, frame) + offset + k))
    };
    let offset = match layout {
        Layout::Hand => 0,
        Layout::InterHand if side == Side::Left => LANDMARK_COUNT,
        Layout::InterHand => 0,
        Layout::FreeMoCap => {
            let near = |offset: usize| {
                let wrist = if side == Side::Right { RIGHT_WRIST } else { LEFT_WRIST };
                let distance = |view, frame| {
                    let first = first_of(view, frame);
                    Some(at(first + wrist)?.at.distance(at(first + offset)?.at))
                };
                let all = (0..views).flat_map(|view| (0..frames).filter_map(move |frame| distance(view, frame)));
                crate::ik::median(all.collect())
            };
            freemocap_offset(points, side, near)
        }
    };
    let view = |view: usize| -> View {
        let hand = |frame: usize| {
            let found = hand_at(view, frame, offset);
            (frame as u64, if layout == Layout::InterHand { from_interhand(&found) } else { found })
        };
        (0..frames).map(hand).collect()
    };
    let views = if is_single { Views::One(view(0)) } else { Views::All((0..views).map(view).collect()) };
    let tip_inset = if layout == Layout::InterHand { 0.0 } else { MEDIAPIPE_TIP_INSET };
    // FreeMoCap tracks with MediaPipe; 21 points alone may be anybody's.
    Ok(Content { remarks, is_mediapipe: layout == Layout::FreeMoCap, ..Content::new(views, tip_inset) })
}

/// The first point of a hand: FreeMoCap has written the right hand, the left one and the face behind the body, and in
/// other versions the face, the left hand and the right one. A hand begins where the body's wrist is. `near` says how far
/// the point of a number is from it, pixels.
fn freemocap_offset(points: usize, side: Side, near: impl Fn(usize) -> f64) -> usize {
    let [first, second] = [BODY, BODY + LANDMARK_COUNT];
    let last = points - LANDMARK_COUNT;
    let (usual, other) = match side {
        Side::Right => (first, last),
        Side::Left => (second, last - LANDMARK_COUNT),
    };
    if near(other) < near(usual) { other } else { usual }
}

/// Frames with 42 joints and `joint_valid` each.
fn interhand_frames(value: &Value, side: Side) -> Option<Result<Content, Problem>> {
    let is_frame =
        |frame: &Value| frame.get("joint_valid").is_some() && JOINT_NAMES.iter().any(|name| frame.get(name).is_some());
    let frames = ["frames", "annotations"].iter().find_map(|name| value.get(name)).unwrap_or(value);
    let frames = match frames {
        Value::List(frames) if frames.iter().any(is_frame) => frames,
        _ => return None,
    };
    let view = (0..).zip(frames).map(|(number, frame): (u64, &Value)| {
        let field = |name: &str| format!("frames[{number}].{name}");
        let Some((name, points)) = JOINT_NAMES.iter().find_map(|name| Some((*name, frame.get(name)?))) else {
            return Ok((number, [None; LANDMARK_COUNT]));
        };
        let Some((points, width)) = points.numbers().and_then(|array| match array.shape[..] {
            [BOTH_HANDS, width @ (2 | 3)] => Some((&array.values, width)),
            _ => None,
        }) else {
            return problem(&field(name), format!("is {}, must be {BOTH_HANDS} pixels", points.kind()));
        };
        let valid = frame.get("joint_valid").and_then(Value::numbers).map(|array| array.values.as_slice());
        let Some(valid) = valid.filter(|valid| valid.len() == BOTH_HANDS) else {
            return problem(&field("joint_valid"), format!("must have {BOTH_HANDS} numbers"));
        };
        let first = if side == Side::Left { LANDMARK_COUNT } else { 0 };
        let at = |k: usize| {
            let values = points.get(k * width..)?;
            point(*values.first()?, *values.get(1)?, *valid.get(k)?)
        };
        Ok((number, from_interhand(&std::array::from_fn(|k| at(first + k)))))
    });
    Some(view.collect::<Result<View, Problem>>().map(|view| Content::new(Views::One(view), 0.0)))
}

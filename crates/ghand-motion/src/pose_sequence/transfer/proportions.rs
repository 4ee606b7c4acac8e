//! What 21 points say about themselves: whether they are a hand, in which order, of which side and in which unit.

use ghand_core::Side;
use glam::DVec3;

use crate::ik::{LANDMARK_COUNT, median};
use crate::pose_sequence::reading::recording::LandmarkFrame;

/// At least this part of what is true of hands must be true of points.
const LEAST_LIKENESS: f64 = 0.8;
/// Mean bend of the fingers that tells a side, radians: fingers cannot bend backwards as far.
const TELLING_BEND: f64 = 0.35;
/// Part of the frames that must agree on a side.
const AGREEING: f64 = 0.8;
/// Possible lengths of a hand from the wrist along the middle finger, metres; adults' are 0.16 to 0.22.
const LENGTHS: (f64, f64) = (0.07, 0.35);

/// Places of MediaPipe's landmarks in other orders.
const ORDERS: [(&str, [usize; LANDMARK_COUNT]); 3] = [
    ("MediaPipe's", [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20]),
    ("MANO's with the tips behind", MANO_ORDER),
    ("InterHand2.6M's", [20, 3, 2, 1, 0, 7, 6, 5, 4, 11, 10, 9, 8, 15, 14, 13, 12, 19, 18, 17, 16]),
];
/// The joint at each of MediaPipe's landmarks: MANO's joints, then the tips of thumb, index, middle, ring and little
/// finger.
pub const MANO_ORDER: [usize; LANDMARK_COUNT] =
    [0, 13, 14, 15, 16, 1, 2, 3, 17, 4, 5, 6, 18, 10, 11, 12, 19, 7, 8, 9, 20];
/// WebXR's joint at each of MediaPipe's landmarks.
pub(crate) const XR_ORDER: [usize; LANDMARK_COUNT] =
    [0, 1, 2, 3, 4, 6, 7, 8, 9, 11, 12, 13, 14, 16, 17, 18, 19, 21, 22, 23, 24];

type Points = [DVec3; LANDMARK_COUNT];

/// First landmarks of the four fingers.
const FINGERS: [usize; 4] = [5, 9, 13, 17];

/// The part of what is true of hands that is true of these points, whatever their size, place and side.
fn likeness(points: &Points) -> f64 {
    let within = |value: f64, low: f64, high: f64| (low..=high).contains(&value);
    let length = |a: usize, b: usize| points[a].distance(points[b]);
    let mut truths: Vec<bool> = vec![];
    for first in FINGERS {
        let palm = length(0, first);
        let [a, b, c] = [0, 1, 2].map(|k| length(first + k, first + k + 1) / palm);
        truths.extend([within(a + b + c, 0.5, 1.7), within(a, 0.2, 0.85), within(b, 0.1, 0.65), within(c, 0.08, 0.6)]);
        if first > FINGERS[0] {
            truths.push(within(length(first - 4, first) / palm, 0.08, 0.55));
        }
    }
    let palm = length(0, 9);
    let [a, b, c, d] = [(0, 1), (1, 2), (2, 3), (3, 4)].map(|(from, to)| length(from, to) / palm);
    truths.extend([within(a, 0.1, 0.8), within(b, 0.15, 0.9), within(c, 0.1, 0.7), within(d, 0.1, 0.7)]);
    truths.iter().filter(|truth| **truth).count() as f64 / truths.len() as f64
}

/// Whether points have a hand's proportions in MediaPipe's order.
pub(crate) fn is_hand(frames: &[Points]) -> bool {
    median(frames.iter().map(likeness).collect()) >= LEAST_LIKENESS
}

/// Puts landmarks into MediaPipe's order, with a remark if they were in another one; the problem if they are no hand.
pub(crate) fn put_in_order(frames: &mut [LandmarkFrame]) -> Result<Option<String>, String> {
    for (name, order) in ORDERS {
        let ordered: Vec<Points> = frames.iter().map(|frame| order.map(|k| frame.points[k])).collect();
        if !is_hand(&ordered) {
            continue;
        }
        let changed = order != ORDERS[0].1;
        frames.iter_mut().zip(ordered).for_each(|(frame, points)| frame.points = points);
        return Ok(
            changed.then(|| format!("the landmarks are read in {name} order, the only one in which they are a hand"))
        );
    }
    Err("the points do not have a hand's proportions in MediaPipe's order, nor in MANO's or InterHand2.6M's; give 21 \
         landmarks: wrist, then thumb to little finger, four each from the palm to the tip"
        .into())
}

/// The unit that points are probably in, if they are not metres: the problem.
pub(crate) fn unit_problem(frames: &[Points]) -> Option<String> {
    let chain = |points: &Points| {
        [(0, 9), (9, 10), (10, 11), (11, 12)].iter().map(|(a, b)| points[*a].distance(points[*b])).sum()
    };
    let length = median(frames.iter().map(chain).collect());
    let (low, high) = LENGTHS;
    if length.is_nan() || length == 0.0 || (low..=high).contains(&length) {
        return None;
    }
    let units = [(1000.0, "millimetres"), (100.0, "centimetres"), (39.37, "inches"), (10.0, "decimetres")];
    let unit = units.iter().find(|(factor, _)| (0.12..=0.26).contains(&(length / factor)));
    let guess = match unit {
        Some((factor, name)) => format!("they seem to be {name}: divide them by {factor}"),
        None => "they may be pixels, or without a scale".into(),
    };
    Some(format!("the hand is {length:.4} m long from the wrist along the middle finger; give metres ({guess})"))
}

/// The side of a hand whose fingers bend far enough to tell: bent fingers point to the palm.
pub(crate) fn side_by_bend<'a>(frames: impl Iterator<Item = &'a Points>) -> Option<Side> {
    let bends: Vec<f64> = frames.map(right_bend).collect();
    let part = |sign: f64| bends.iter().filter(|bend| **bend * sign > 0.0).count() as f64 / bends.len().max(1) as f64;
    let bend = median(bends.clone());
    match bend {
        _ if bend > TELLING_BEND && part(1.0) >= AGREEING => Some(Side::Right),
        _ if bend < -TELLING_BEND && part(-1.0) >= AGREEING => Some(Side::Left),
        _ => None,
    }
}

/// How far the fingers of a hand are bent if it is a right one; negative for a left one, radians.
pub(crate) fn right_bend(points: &Points) -> f64 {
    let across = (points[5] - points[17]).normalize_or_zero();
    let bend = |first: usize| -> f64 {
        let bones = [(0, first), (first, first + 1), (first + 1, first + 2), (first + 2, first + 3)];
        let directions = bones.map(|(from, to)| (points[to] - points[from]).normalize_or_zero());
        directions.windows(2).map(|pair| pair[0].cross(pair[1]).dot(across).atan2(pair[0].dot(pair[1]))).sum()
    };
    FINGERS.into_iter().map(bend).sum::<f64>() / FINGERS.len() as f64
}

/// Directions out of the back of a hand and along its palm, if its points are not on a line.
pub(crate) fn back_of_hand(points: &Points, side: Side) -> Option<DVec3> {
    let back = (points[9] - points[0]).cross(points[5] - points[17]).try_normalize()?;
    Some(if side == Side::Right { back } else { -back })
}

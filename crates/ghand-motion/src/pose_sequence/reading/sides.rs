//! Poses of one hand inside `{"right": .., "left": ..}`, for the whole file or in each frame.

use ghand_core::Side;
use ghand_files::value::Value;

use super::source::{frames_of, id_of, side_of};

/// One hand's poses from a file that separates hands.
pub(crate) struct OneHand {
    pub side: Side,
    pub value: Value,
    /// Remark for the user.
    pub warning: Option<String>,
}

/// The wanted hand if the value has it, else the other one; `None` for a value that does not separate hands.
pub(crate) fn one_hand(value: &Value, wanted: Side) -> Option<OneHand> {
    let other = wanted.other();
    let of = |side: Side| hand(value, side).map(|hand| (side, hand));
    if let Some((side, hand)) = of(wanted).or_else(|| of(other)) {
        let inner = match hand {
            Value::Map(_) => hand.clone(),
            poses => Value::Map(vec![("frames".into(), poses.clone())]),
        };
        return Some(OneHand { side, value: with_small(inner, value), warning: None });
    }
    let frames = frames_of(value)?;
    let has = |side: Side| frames.iter().any(|frame| hand(frame, side).is_some());
    let side = [wanted, other].into_iter().find(|side| has(*side))?;
    let mut found = Vec::with_capacity(frames.len());
    for (number, frame) in frames.iter().enumerate() {
        let Some(hand) = hand(frame, side) else { continue };
        let id = ("id".to_owned(), Value::Text(id_of(frame, number)));
        let inner = match hand {
            Value::Map(entries) => {
                let own = entries.iter().filter(|(name, _)| name != "id").cloned();
                Value::Map(std::iter::once(id).chain(own).collect())
            }
            poses => Value::Map(vec![id, ("poses".into(), poses.clone())]),
        };
        found.push(with_small(inner, frame));
    }
    let missing = frames.len() - found.len();
    let warning = (missing > 0).then(|| format!("{missing} of {} frames have no {side} hand", frames.len()));
    let outer = Value::Map(vec![("frames".to_owned(), Value::List(found))]);
    Some(OneHand { side, value: with_small(outer, value), warning })
}

/// Whether the frames of a hand are listed by its side.
pub(crate) fn holds_lists(value: &Value) -> bool {
    [Side::Left, Side::Right].into_iter().any(|side| match hand(value, side) {
        Some(Value::List(_)) => true,
        Some(hand) => matches!(hand.get("frames"), Some(Value::List(_))),
        None => false,
    })
}

/// The hand of that side, if it exists.
fn hand(value: &Value, side: Side) -> Option<&Value> {
    let is_it = |(name, hand): &&(String, Value)| {
        side_of(&Value::Text(name.clone())) == Some(side)
            && matches!(hand, Value::Map(_) | Value::List(_) | Value::Numbers(_))
    };
    value.entries().iter().find(is_it).map(|(_, hand)| hand)
}

/// A map extended by the simple fields of the enclosing one, such as the rate.
fn with_small(inner: Value, outer: &Value) -> Value {
    let Value::Map(mut entries) = inner else { return inner };
    for (name, value) in outer.entries() {
        let is_small = value.number().is_some() || value.text().is_some();
        if is_small && entries.iter().all(|(known, _)| known != name) {
            entries.push((name.clone(), value.clone()));
        }
    }
    Value::Map(entries)
}

//! JSON and JSON Lines, including the way in which Python's `json` writes numbers that are not finite, and JavaScript
//! writes typed arrays.

use std::borrow::Cow;
use std::fmt::{self, Display};

use serde::de::{DeserializeSeed, Deserializer, Error, MapAccess, SeqAccess, Visitor};

use super::Value;
use super::budget::Budget;
use super::collect::Items;
use crate::json_error::plain_json_error;
use crate::npz::NumericArray;

/// Whether the bytes begin like an object or an array. A pickle may begin with `(` or `}`, but not with these.
pub(super) fn recognises_bytes(bytes: &[u8]) -> bool {
    let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes).trim_ascii_start();
    matches!(text.first(), Some(b'{' | b'['))
}

pub(super) fn from_json(bytes: &[u8]) -> Result<Value, String> {
    let bytes = without_nan(bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes));
    let mut input = serde_json::Deserializer::from_slice(&bytes);
    let budget = Budget::new();
    let wrong =
        |error: serde_json::Error| format!("{}; correct the file there, or export it again", plain_json_error(&error));
    let value = Seed(&budget).deserialize(&mut input).map_err(wrong)?;
    match input.end() {
        Ok(()) => Ok(value),
        Err(_) if is_lines(&bytes) => from_lines(&bytes),
        Err(error) => Err(wrong(error)),
    }
}

/// Whether the first line that is not blank is a complete JSON value, as in JSON Lines.
fn is_lines(bytes: &[u8]) -> bool {
    let first = bytes.split(|byte| *byte == b'\n').find(|line| !line.trim_ascii().is_empty());
    first.is_some_and(|line| serde_json::from_slice::<serde::de::IgnoredAny>(line).is_ok())
}

/// One value on each line; blank lines are skipped.
fn from_lines(bytes: &[u8]) -> Result<Value, String> {
    let budget = Budget::new();
    let mut items = Items::Nothing(0);
    for (number, line) in (1..).zip(bytes.split(|byte| *byte == b'\n')) {
        if line.trim_ascii().is_empty() {
            continue;
        }
        let mut input = serde_json::Deserializer::from_slice(line);
        let value = Seed(&budget).deserialize(&mut input).and_then(|value| input.end().map(|()| value));
        let value = value
            .map_err(|error| format!("line {number}: {}; correct that line or remove it", plain_json_error(&error)))?;
        items.push(value, &budget)?;
    }
    Ok(items.finish())
}

/// Converts `{"0":a,"1":b,...}`, which JavaScript's `JSON.stringify` writes for a typed array, to an array.
fn typed_array(entries: &[(String, Value)]) -> Option<NumericArray> {
    let number = |(place, (name, value)): (usize, &(String, Value))| match value {
        Value::Numbers(array) if array.shape.is_empty() && *name == place.to_string() => array.values.first().copied(),
        _ => None,
    };
    let values: Vec<f64> = entries.iter().enumerate().map(number).collect::<Option<_>>()?;
    (values.len() > 1).then(|| NumericArray { shape: vec![values.len()], values })
}

/// Python writes `NaN` and `Infinity`, which are not JSON; they become `null`, which among numbers is read as NaN.
fn without_nan(bytes: &[u8]) -> Cow<'_, [u8]> {
    const WORDS: [&[u8]; 3] = [b"-Infinity", b"Infinity", b"NaN"];
    let mut out: Vec<u8> = Vec::new();
    let mut at = 0;
    let mut copied = 0;
    let mut in_text = false;
    while let Some(&byte) = bytes.get(at) {
        let rest = bytes.get(at..).unwrap_or_default();
        let word = if in_text || !matches!(byte, b'-' | b'I' | b'N') {
            None
        } else {
            WORDS.iter().find(|word| rest.starts_with(word))
        };
        at += match (word, byte) {
            (Some(word), _) => {
                out.extend_from_slice(bytes.get(copied..at).unwrap_or_default());
                out.extend_from_slice(b"null");
                copied = at + word.len();
                word.len()
            }
            (None, b'\\') if in_text => 2,
            (None, b'"') => {
                in_text = !in_text;
                1
            }
            _ => 1,
        };
    }
    if copied == 0 {
        return Cow::Borrowed(bytes);
    }
    out.extend_from_slice(bytes.get(copied..).unwrap_or_default());
    Cow::Owned(out)
}

#[derive(Clone, Copy)]
struct Seed<'a>(&'a Budget);

impl Seed<'_> {
    fn number<E: Error>(self, value: f64) -> Result<Value, E> {
        self.0.numbers(1).map_err(E::custom)?;
        Ok(Value::Numbers(NumericArray { shape: vec![], values: vec![value] }))
    }
}

impl<'de> DeserializeSeed<'de> for Seed<'_> {
    type Value = Value;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Value, D::Error> {
        deserializer.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Seed<'_> {
    type Value = Value;

    fn expecting(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
        "a value".fmt(formatter)
    }

    fn visit_unit<E: Error>(self) -> Result<Value, E> {
        Ok(Value::Nothing)
    }

    fn visit_bool<E: Error>(self, value: bool) -> Result<Value, E> {
        self.number(f64::from(u8::from(value)))
    }

    fn visit_i64<E: Error>(self, value: i64) -> Result<Value, E> {
        self.number(value as f64)
    }

    fn visit_u64<E: Error>(self, value: u64) -> Result<Value, E> {
        self.number(value as f64)
    }

    fn visit_f64<E: Error>(self, value: f64) -> Result<Value, E> {
        self.number(value)
    }

    fn visit_str<E: Error>(self, value: &str) -> Result<Value, E> {
        self.0.values(1).map_err(E::custom)?;
        Ok(Value::Text(value.into()))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut sequence: A) -> Result<Value, A::Error> {
        let mut items = Items::Nothing(0);
        while let Some(item) = sequence.next_element_seed(self)? {
            items.push(item, self.0).map_err(A::Error::custom)?;
        }
        Ok(items.finish())
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Value, A::Error> {
        let mut entries: Vec<(String, Value)> = Vec::new();
        while let Some(key) = map.next_key::<String>()? {
            self.0.values(1).map_err(A::Error::custom)?;
            entries.push((key, map.next_value_seed(self)?));
        }
        let mut names: Vec<&str> = entries.iter().map(|(name, _)| name.as_str()).collect();
        names.sort_unstable();
        if let Some(pair) = names.windows(2).find(|pair| pair[0] == pair[1]) {
            return Err(A::Error::custom(format!("{:?} occurs twice in one object", pair[0])));
        }
        Ok(typed_array(&entries).map_or(Value::Map(entries), Value::Numbers))
    }
}

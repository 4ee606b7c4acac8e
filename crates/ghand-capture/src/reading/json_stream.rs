//! Streams JSON from files too large for memory, one value at a time, with bounds on the size of a value.

use std::fmt;
use std::io::{self, BufReader, Read};
use std::marker::PhantomData;
use std::path::Path;

use ghand_files::input_file;
use ghand_files::json_error::plain_json_error;
use serde::Deserialize;
use serde::de::{DeserializeSeed, Deserializer, Error, IgnoredAny, MapAccess, SeqAccess, Visitor};

use crate::error::CaptureError;

/// Longest string or number, bytes; names and numbers in data sets have about ten.
const LONGEST_TOKEN: usize = 1 << 12;
/// Deepest nesting; annotations are six deep.
const DEEPEST: usize = 64;
/// Bytes read at a time.
const BUFFER: usize = 1 << 16;

/// Reads a whole JSON file with `seed`.
pub(crate) fn read_streaming<'de, S: DeserializeSeed<'de>>(
    path: &Path,
    seed: S,
    remedy: &'static str,
) -> Result<S::Value, CaptureError> {
    let file = input_file::open(path).map_err(|source| CaptureError::Io {
        path: path.into(),
        action: "read the annotations",
        source,
        remedy,
    })?;
    read_json(file, seed).map_err(|error| CaptureError::Json { path: path.into(), problem: plain_json_error(&error) })
}

/// Reads JSON with `seed`; nothing may follow it.
fn read_json<'de, S: DeserializeSeed<'de>>(json: impl Read, seed: S) -> serde_json::Result<S::Value> {
    let mut json = serde_json::Deserializer::from_reader(BufReader::with_capacity(BUFFER, Bounded::new(json)));
    let value = seed.deserialize(&mut json)?;
    json.end()?;
    Ok(value)
}

/// A JSON text being read. A string or number that is too long, or brackets that are too deep for a parser's memory,
/// are errors.
struct Bounded<R> {
    inner: R,
    in_string: bool,
    escaped: bool,
    token: usize,
    depth: usize,
}

impl<R> Bounded<R> {
    fn new(inner: R) -> Bounded<R> {
        Bounded { inner, in_string: false, escaped: false, token: 0, depth: 0 }
    }

    fn pass(&mut self, byte: u8) -> io::Result<()> {
        self.token += 1;
        match byte {
            _ if self.escaped => self.escaped = false,
            b'\\' if self.in_string => self.escaped = true,
            b'"' => {
                self.in_string = !self.in_string;
                self.token = 0;
            }
            _ if self.in_string => {}
            b'[' | b'{' => {
                self.depth += 1;
                self.token = 0;
            }
            b']' | b'}' => {
                self.depth = self.depth.saturating_sub(1);
                self.token = 0;
            }
            b',' | b':' | b' ' | b'\n' | b'\r' | b'\t' => self.token = 0,
            _ => {}
        }
        if self.token > LONGEST_TOKEN {
            return Err(io::Error::other(format!("a string or number is longer than {LONGEST_TOKEN} bytes")));
        }
        if self.depth > DEEPEST {
            return Err(io::Error::other(format!("brackets are nested deeper than {DEEPEST}")));
        }
        Ok(())
    }
}

impl<R: Read> Read for Bounded<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.inner.read(buffer)?;
        buffer.iter().take(count).try_for_each(|byte| self.pass(*byte))?;
        Ok(count)
    }
}

/// Exactly N numbers, in one array or in arrays of them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Numbers<const N: usize>(pub [f64; N]);

impl<'de, const N: usize> Deserialize<'de> for Numbers<N> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Fill<const N: usize>;
        impl<'de, const N: usize> Visitor<'de> for Fill<N> {
            type Value = [f64; N];

            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                write!(f, "{N} finite numbers")
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut sequence: A) -> Result<Self::Value, A::Error> {
                let mut values = [0.0; N];
                for (i, value) in values.iter_mut().enumerate() {
                    *value = sequence.next_element()?.ok_or_else(|| A::Error::invalid_length(i, &self))?;
                }
                match sequence.next_element::<f64>()? {
                    None => Ok(values),
                    Some(_) => Err(A::Error::custom(format!("more than the expected {N} numbers"))),
                }
            }
        }
        deserializer.deserialize_seq(Fill::<N>).map(Numbers)
    }
}

/// A name that files store as text or as an integer.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Name(pub String);

impl<'de> Deserialize<'de> for Name {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Either;
        impl Visitor<'_> for Either {
            type Value = Name;

            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str("text or a whole number")
            }

            fn visit_str<E: Error>(self, text: &str) -> Result<Name, E> {
                Ok(Name(text.into()))
            }

            fn visit_u64<E: Error>(self, number: u64) -> Result<Name, E> {
                Ok(Name(number.to_string()))
            }
        }
        deserializer.deserialize_any(Either)
    }
}

/// Reads an array item by item and passes each to a function.
pub(crate) struct ForEach<T, F> {
    each: F,
    item: PhantomData<T>,
}

impl<T, F> ForEach<T, F> {
    pub fn new(each: F) -> ForEach<T, F> {
        ForEach { each, item: PhantomData }
    }
}

impl<'de, T: Deserialize<'de>, F: FnMut(T) -> Result<(), String>> DeserializeSeed<'de> for ForEach<T, F> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_seq(self)
    }
}

impl<'de, T: Deserialize<'de>, F: FnMut(T) -> Result<(), String>> Visitor<'de> for ForEach<T, F> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("an array")
    }

    fn visit_seq<A: SeqAccess<'de>>(mut self, mut sequence: A) -> Result<(), A::Error> {
        while let Some(item) = sequence.next_element()? {
            (self.each)(item).map_err(A::Error::custom)?;
        }
        Ok(())
    }
}

/// Receives the values of a streamed object.
pub(crate) trait Keys {
    /// Reads the value of a key, or skips it.
    fn value<'de, A: MapAccess<'de>>(&mut self, key: &str, map: &mut A) -> Result<(), A::Error>;
}

/// Reads an object key by key.
pub(crate) struct Object<'a, K>(pub &'a mut K);

impl<'de, K: Keys> DeserializeSeed<'de> for Object<'_, K> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_map(self)
    }
}

impl<'de, K: Keys> Visitor<'de> for Object<'_, K> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("an object")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<(), A::Error> {
        while let Some(key) = map.next_key::<String>()? {
            self.0.value(&key, &mut map)?;
        }
        Ok(())
    }
}

/// Skips a value.
pub(crate) fn skip<'de, A: MapAccess<'de>>(map: &mut A) -> Result<(), A::Error> {
    map.next_value::<IgnoredAny>().map(|_| ())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message<T: for<'de> Deserialize<'de>>(json: &str) -> String {
        read_json(json.as_bytes(), PhantomData::<T>).err().expect("refused").to_string()
    }

    #[test]
    fn arrays_have_exactly_the_requested_length() {
        let read = read_json("[1, 2.5, -3e2]".as_bytes(), PhantomData::<Numbers<3>>).unwrap();
        assert_eq!(read.0, [1.0, 2.5, -300.0]);
        for (json, part) in [
            ("[1, 2]", "3 finite numbers"),
            ("[1, 2, 3, 4]", "more than the expected 3"),
            ("[1, NaN, 3]", "expected value"),
            ("[1, null, 3]", "null"),
            ("[1, 1e999, 3]", "out of range"),
            ("7", "3 finite numbers"),
        ] {
            let message = message::<Numbers<3>>(json);
            assert!(message.contains(part) && message.contains("line 1"), "{message:?} of {json}");
        }
    }

    #[test]
    fn names_are_text_or_whole_numbers() {
        let read = |json: &str| read_json(json.as_bytes(), PhantomData::<Name>).map(|n| n.0).ok();
        assert_eq!(read("\"400262\"").as_deref(), Some("400262"));
        assert_eq!(read("400262").as_deref(), Some("400262"));
        assert_eq!(read("[]"), None);
        assert_eq!(read("1 2"), None);
    }

    #[test]
    fn unbounded_memory_use_is_rejected() {
        let long = format!("[\"{}\"]", "x".repeat(LONGEST_TOKEN + 1));
        let key = format!("{{\"{}\": 1}}", "\\\"".repeat(LONGEST_TOKEN));
        let digits = format!("[{}]", "7".repeat(LONGEST_TOKEN + 1));
        for json in [long, key, digits] {
            assert!(message::<IgnoredAny>(&json).contains("longer than"), "{json:.20}");
        }
        assert!(message::<IgnoredAny>(&"[".repeat(1000)).contains("deeper than"));
        let fine = format!("[\"{}\", [{}1{}]]", "[{\\\"".repeat(500), "[".repeat(60), "]".repeat(60));
        read_json(fine.as_bytes(), PhantomData::<IgnoredAny>).unwrap();
    }
}

//! The content of data files in any format: JSON, JSON Lines, or Python's pickles, `.npz` archives and `.npy` arrays,
//! also those of joblib and PyTorch, and any of them compressed by zlib or gzip.
//!
//! Nothing in a file is executed. Memory is bounded: too many bytes, numbers or other values in a file are an error.

mod budget;
mod collect;
mod compressed;
mod json;
mod other_formats;
mod python;
mod pytorch;
mod yaml;

use std::path::Path;

use crate::input_file;
use crate::npz::{Npz, NumericArray};
use crate::pickle::Graph;

/// Most bytes of a file; all poses of InterHand2.6M together take about a tenth.
const MAX_BYTES: u64 = 1 << 29;

/// A value of a data file.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    /// JSON's `null`, Python's `None`.
    Nothing,
    /// A number (without axes), or an array of numbers. `true` is 1, `false` is 0, and a missing number among others is
    /// NaN.
    Numbers(NumericArray),
    /// Text.
    Text(String),
    /// A list of anything else.
    List(Vec<Value>),
    /// Values by name, in the order of the file; no name occurs twice.
    Map(Vec<(String, Value)>),
    /// An unreadable value, with the reason; an error only if it is needed.
    Unreadable(String),
}

/// Why a data file cannot be read, and what to do about it.
#[derive(Debug, thiserror::Error)]
pub enum ValueError {
    /// The file system reports an error.
    #[error("cannot be read: {0}")]
    Io(#[from] std::io::Error),
    /// It is of no kind that can be read.
    #[error("is neither JSON nor an .npz, .npy, .pt or pickle file; export it as JSON or with numpy.savez")]
    UnknownKind,
    /// The content is invalid.
    #[error("{0}")]
    Content(String),
}

impl Value {
    /// Reads a file of any of these kinds, recognised from its first bytes.
    ///
    /// # Errors
    /// [`ValueError`] if it cannot be opened, is larger than 512 MiB, is not of a supported kind, or is damaged.
    pub fn read(path: &Path) -> Result<Value, ValueError> {
        let Some(bytes) = input_file::read(path, MAX_BYTES)? else {
            let problem = format!("is larger than {} MiB; split it, or keep only what is needed", MAX_BYTES >> 20);
            return Err(ValueError::Content(problem));
        };
        Value::from_bytes(&bytes)
    }

    /// Reads the bytes of a file of any of these kinds, recognised from the first bytes.
    ///
    /// # Errors
    /// [`ValueError::UnknownKind`] if they are not of a supported kind, [`ValueError::Content`] if they are damaged or too
    /// large.
    pub fn from_bytes(bytes: &[u8]) -> Result<Value, ValueError> {
        match compressed::unpacked(bytes, MAX_BYTES).map_err(ValueError::Content)? {
            Some(unpacked) => Value::from_plain_bytes(&unpacked),
            None => Value::from_plain_bytes(bytes),
        }
    }

    /// Reads the first document of a text in YAML. All scalars are [`Value::Text`], also numbers: [`Value::read`] does not
    /// recognise YAML, because it has no signs of its own.
    ///
    /// # Errors
    /// The problem, as the end of a sentence about the text.
    pub fn from_yaml(text: &str) -> Result<Value, String> {
        yaml::from_yaml(text)
    }

    fn from_plain_bytes(bytes: &[u8]) -> Result<Value, ValueError> {
        let value = if pytorch::recognises_bytes(bytes) {
            pytorch::from_torch(bytes)
        } else if Npz::recognises_bytes(bytes) {
            python::from_npz(bytes)
        } else if bytes.starts_with(b"\x93NUMPY") {
            python::from_npy(bytes)
        } else if json::recognises_bytes(bytes) {
            json::from_json(bytes)
        } else if let Some(problem) = other_formats::problem(bytes) {
            Err(problem)
        } else if Graph::recognises_bytes(bytes) {
            python::from_pickle(bytes)
        } else {
            return Err(ValueError::UnknownKind);
        };
        match value {
            Ok(Value::Unreadable(problem)) | Err(problem) => Err(ValueError::Content(problem)),
            Ok(value) => Ok(value),
        }
    }

    /// The value of that name, if this is a map that has it.
    pub fn get(&self, name: &str) -> Option<&Value> {
        self.entries().iter().find(|(key, _)| key == name).map(|(_, value)| value)
    }

    /// Names and values; empty if this is not a map.
    pub fn entries(&self) -> &[(String, Value)] {
        match self {
            Value::Map(entries) => entries,
            _ => &[],
        }
    }

    /// The numbers, if this is a number or an array of numbers.
    pub fn numbers(&self) -> Option<&NumericArray> {
        match self {
            Value::Numbers(array) => Some(array),
            _ => None,
        }
    }

    /// The number, if this is a single number.
    pub fn number(&self) -> Option<f64> {
        match self.numbers()?.values[..] {
            [number] => Some(number),
            _ => None,
        }
    }

    /// The text, if this is text.
    pub fn text(&self) -> Option<&str> {
        match self {
            Value::Text(text) => Some(text),
            _ => None,
        }
    }

    /// The kind of value, for messages.
    pub fn kind(&self) -> String {
        match self {
            Value::Nothing => "nothing".into(),
            Value::Numbers(array) if array.shape.is_empty() => "a number".into(),
            Value::Numbers(array) => format!("numbers of the shape {:?}", array.shape),
            Value::Text(_) => "text".into(),
            Value::List(items) => format!("a list of {}", items.len()),
            Value::Map(entries) => format!("a map of {} names", entries.len()),
            Value::Unreadable(problem) => format!("unreadable ({problem})"),
        }
    }

    /// Its items, if it is a list or an array with at least one axis.
    pub fn items(&self) -> Option<Vec<Value>> {
        match self {
            Value::List(items) => Some(items.clone()),
            Value::Numbers(array) => {
                let (_, inner) = array.shape.split_first()?;
                let size = inner.iter().product::<usize>().max(1);
                let item =
                    |values: &[f64]| Value::Numbers(NumericArray { shape: inner.to_vec(), values: values.to_vec() });
                Some(array.values.chunks(size).map(item).collect())
            }
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests;

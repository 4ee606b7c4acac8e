//! What data files hold, whatever they are written as: JSON, JSON Lines, or Python's pickles, `.npz` archives and
//! `.npy` arrays.
//!
//! Nothing that a file names is run. Memory is bounded: a file may hold so many bytes, numbers and other values, and
//! what goes beyond is an error, not an attempt.

mod budget;
mod collect;
mod json;
mod python;

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
    /// A number (without axes), or numbers in an array whose rows are all alike. `true` is 1, `false` is 0, and a
    /// missing number among others is NaN.
    Numbers(NumericArray),
    /// Text.
    Text(String),
    /// Anything else in a row.
    List(Vec<Value>),
    /// Values by name, in the order of the file; no name occurs twice.
    Map(Vec<(String, Value)>),
    /// What cannot be read, with the reason; no harm where nobody asks for it.
    Unreadable(String),
}

/// Why a data file cannot be read, and what to do about it.
#[derive(Debug, thiserror::Error)]
pub enum ValueError {
    /// The file system says so.
    #[error("cannot be read: {0}")]
    Io(#[from] std::io::Error),
    /// The content says so.
    #[error("{0}")]
    Content(String),
}

impl Value {
    /// Reads a file of any of the kinds, told by its first bytes.
    ///
    /// # Errors
    /// [`ValueError`] when it cannot be opened, is larger than 512 MiB, is of no kind that is read, or is damaged.
    pub fn read(path: &Path) -> Result<Value, ValueError> {
        let Some(bytes) = input_file::read(path, MAX_BYTES)? else {
            let problem = format!("is larger than {} MiB; split it, or keep only what is needed", MAX_BYTES >> 20);
            return Err(ValueError::Content(problem));
        };
        Value::from_bytes(&bytes)
    }

    /// Reads the bytes of a file of any of the kinds, told by the first of them.
    ///
    /// # Errors
    /// [`ValueError::Content`] when they are of no kind that is read, damaged, or hold too much.
    pub fn from_bytes(bytes: &[u8]) -> Result<Value, ValueError> {
        let value = if Npz::recognizes(bytes) {
            python::from_npz(bytes)
        } else if bytes.starts_with(b"\x93NUMPY") {
            python::from_npy(bytes)
        } else if json::recognizes(bytes) {
            json::from_json(bytes)
        } else if Graph::recognizes(bytes) {
            python::from_pickle(bytes)
        } else {
            Err("is neither JSON nor an .npz, .npy or pickle file; export it as JSON or with numpy.savez".into())
        };
        value.map_err(ValueError::Content)
    }

    /// The value of that name, if this is a map that has one.
    pub fn get(&self, name: &str) -> Option<&Value> {
        self.entries().iter().find(|(key, _)| key == name).map(|(_, value)| value)
    }

    /// Names and values, if this is a map; else none.
    pub fn entries(&self) -> &[(String, Value)] {
        match self {
            Value::Map(entries) => entries,
            _ => &[],
        }
    }

    /// The numbers, if these are some.
    pub fn numbers(&self) -> Option<&NumericArray> {
        match self {
            Value::Numbers(array) => Some(array),
            _ => None,
        }
    }

    /// The number, if this is a single one.
    pub fn number(&self) -> Option<f64> {
        match self.numbers()?.values[..] {
            [number] => Some(number),
            _ => None,
        }
    }

    /// The text, if this is one.
    pub fn text(&self) -> Option<&str> {
        match self {
            Value::Text(text) => Some(text),
            _ => None,
        }
    }

    /// What kind of value it is, for messages.
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

    /// Its items one by one, if it is a list or an array with at least one axis.
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

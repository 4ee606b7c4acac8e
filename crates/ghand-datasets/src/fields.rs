//! Values of data files, with the names that messages need.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use ghand_files::npz::NumericArray;
use ghand_files::{Value, input_file};
use glam::{DMat3, DQuat, DVec3};

use crate::DatasetError;
use crate::sequence::Rigid;

/// Largest text in YAML, bytes; DexYCB's have a few hundred.
const LARGEST_YAML: u64 = 1 << 20;
/// Columns of a matrix that are this far from orthonormal are not a rotation: files with four digits stay below.
const ROTATION_TOLERANCE: f64 = 1e-3;

/// A data file, read.
pub(crate) struct DataFile {
    path: PathBuf,
    value: Value,
}

impl DataFile {
    /// JSON, `.npz`, `.npy` or a pickle.
    pub fn read(path: &Path) -> Result<DataFile, DatasetError> {
        let value = Value::read(path).map_err(|error| DatasetError::file(path, error.to_string()))?;
        Ok(DataFile { path: path.into(), value })
    }

    /// The same of bytes; `path` is only for messages.
    pub fn of_bytes(path: PathBuf, bytes: &[u8]) -> Result<DataFile, DatasetError> {
        let value = Value::from_bytes(bytes).map_err(|error| DatasetError::file(&path, error.to_string()))?;
        Ok(DataFile { path, value })
    }

    pub fn read_yaml(path: &Path) -> Result<DataFile, DatasetError> {
        let fail = |problem: String| DatasetError::file(path, problem);
        let bytes = input_file::read(path, LARGEST_YAML).map_err(|error| fail(format!("cannot be read: {error}")))?;
        let bytes = bytes.ok_or_else(|| fail("is larger than 1 MiB; download it again".into()))?;
        let text = String::from_utf8(bytes).map_err(|_| fail("is not text in UTF-8; download it again".into()))?;
        let value = Value::from_yaml(&text).map_err(|problem| fail(format!("{problem}; download it again")))?;
        Ok(DataFile { path: path.into(), value })
    }

    pub fn root(&self) -> Field<'_> {
        Field { path: &self.path, name: String::new(), value: Cow::Borrowed(&self.value) }
    }
}

/// A value inside of a file.
#[derive(Clone)]
pub(crate) struct Field<'a> {
    path: &'a Path,
    name: String,
    value: Cow<'a, Value>,
}

impl<'a> Field<'a> {
    pub fn invalid(&self, problem: impl Into<String>) -> DatasetError {
        match self.name.as_str() {
            "" => DatasetError::file(self.path, problem),
            name => DatasetError::Field { path: self.path.into(), field: name.into(), problem: problem.into() },
        }
    }

    /// The value of a name, unless it is missing or Python's `None`.
    pub fn find(&self, name: &str) -> Option<Field<'a>> {
        let value = match &self.value {
            Cow::Borrowed(value) => Cow::Borrowed(value.get(name)?),
            Cow::Owned(value) => Cow::Owned(value.get(name)?.clone()),
        };
        let field = Field { path: self.path, name: self.below(name), value };
        (!matches!(*field.value, Value::Nothing)).then_some(field)
    }

    pub fn get(&self, name: &str) -> Result<Field<'a>, DatasetError> {
        self.find(name).ok_or_else(|| DatasetError::Field {
            path: self.path.into(),
            field: self.below(name),
            problem: "is missing; download the file again".into(),
        })
    }

    fn below(&self, name: &str) -> String {
        if self.name.is_empty() { name.into() } else { format!("{}.{name}", self.name) }
    }

    /// Names of a map, in the order of the file.
    pub fn names(&self) -> Vec<String> {
        self.value.entries().iter().map(|(name, _)| name.clone()).collect()
    }

    /// The item of that number, of a list or along the first axis of an array.
    pub fn item(&self, number: usize) -> Option<Field<'a>> {
        let value = match (&self.value, self.value.numbers()) {
            (_, Some(array)) => {
                let (count, shape) = array.shape.split_first()?;
                let size = shape.iter().product::<usize>();
                let values = array.values.get(number.checked_mul(size)?..(number + 1).checked_mul(size)?)?;
                let item = NumericArray { shape: shape.to_vec(), values: values.to_vec() };
                (number < *count).then_some(Cow::Owned(Value::Numbers(item)))?
            }
            (Cow::Borrowed(Value::List(items)), _) => Cow::Borrowed(items.get(number)?),
            (Cow::Owned(Value::List(items)), _) => Cow::Owned(items.get(number)?.clone()),
            _ => return None,
        };
        Some(Field { path: self.path, name: format!("{}[{number}]", self.name), value })
    }

    /// The items of a list, or along the first axis of an array.
    pub fn items(&self) -> Result<Vec<Field<'a>>, DatasetError> {
        let count = match (&*self.value, self.value.numbers()) {
            (Value::List(items), _) => items.len(),
            (_, Some(array)) if !array.shape.is_empty() => array.shape.first().copied().unwrap_or(0),
            (other, _) => {
                let kind = other.kind();
                return Err(self.invalid(format!("is {kind}, expected a list; download the file again")));
            }
        };
        Ok((0..count).filter_map(|number| self.item(number)).collect())
    }

    /// Text, or a number as text.
    pub fn text(&self) -> Result<String, DatasetError> {
        match (self.value.text(), self.value.number()) {
            (Some(text), _) => Ok(text.into()),
            (None, Some(number)) => Ok(number.to_string()),
            (None, None) => Err(self.invalid(format!("is {}, expected text", self.value.kind()))),
        }
    }

    /// All numbers at any depth, row by row; finite.
    fn all_numbers(&self) -> Result<Vec<f64>, DatasetError> {
        fn collect(value: &Value, numbers: &mut Vec<f64>) -> Option<()> {
            match value {
                Value::Numbers(array) => numbers.extend(&array.values),
                Value::Text(text) => numbers.push(text.trim().parse().ok()?),
                Value::List(items) => items.iter().try_for_each(|item| collect(item, numbers))?,
                Value::Nothing | Value::Map(_) | Value::Unreadable(_) => return None,
            }
            Some(())
        }
        let mut numbers = vec![];
        match collect(&self.value, &mut numbers) {
            None => {
                let kind = self.value.kind();
                Err(self.invalid(format!("is {kind}, expected numbers; download the file again")))
            }
            Some(()) if numbers.iter().any(|number| !number.is_finite()) => {
                Err(self.invalid("has a number that is not finite; download the file again"))
            }
            Some(()) => Ok(numbers),
        }
    }

    /// This many numbers, whatever their axes.
    pub fn numbers(&self, count: usize) -> Result<Vec<f64>, DatasetError> {
        let numbers = self.all_numbers()?;
        if numbers.len() == count {
            return Ok(numbers);
        }
        Err(self.invalid(format!("has {} numbers, expected {count}; download the file again", numbers.len())))
    }

    /// Rows of this many numbers each.
    pub fn rows(&self, width: usize) -> Result<Vec<Vec<f64>>, DatasetError> {
        let numbers = self.all_numbers()?;
        if numbers.len() % width == 0 {
            return Ok(numbers.chunks_exact(width).map(<[f64]>::to_vec).collect());
        }
        let count = numbers.len();
        Err(self.invalid(format!("has {count} numbers, expected rows of {width}; download the file again")))
    }

    pub fn number(&self) -> Result<f64, DatasetError> {
        Ok(self.numbers(1)?.first().copied().unwrap_or_default())
    }

    /// Whether it is a number other than 0, such as `true`.
    pub fn is_true(&self) -> bool {
        self.value.number().is_some_and(|number| number != 0.0)
    }

    /// A count of at most `most`.
    pub fn count(&self, most: usize) -> Result<usize, DatasetError> {
        let number = self.number()?;
        if number >= 0.0 && number <= most as f64 && number.fract() == 0.0 {
            return Ok(number as usize);
        }
        Err(self.invalid(format!("is {number}, expected a whole number up to {most}")))
    }

    pub fn point(&self) -> Result<DVec3, DatasetError> {
        Ok(DVec3::from_slice(&self.numbers(3)?))
    }

    /// A matrix of three rows that turns, and does not mirror.
    pub fn rotation(&self) -> Result<DMat3, DatasetError> {
        self.checked(rows(&self.numbers(9)?))
    }

    fn checked(&self, matrix: DMat3) -> Result<DMat3, DatasetError> {
        let off = (matrix * matrix.transpose() - DMat3::IDENTITY).to_cols_array();
        if off.iter().all(|value| value.abs() < ROTATION_TOLERANCE) && matrix.determinant() > 0.0 {
            return Ok(matrix);
        }
        Err(self.invalid("is not a rotation; download the file again"))
    }

    /// A rigid motion: the first three rows of a matrix (3, 4) or (4, 4).
    pub fn rigid(&self) -> Result<Rigid, DatasetError> {
        let numbers = self.all_numbers()?;
        match numbers[..] {
            [a, b, c, x, d, e, f, y, g, h, i, z] | [a, b, c, x, d, e, f, y, g, h, i, z, _, _, _, _] => Ok(Rigid {
                rotation: self.checked(rows(&[a, b, c, d, e, f, g, h, i]))?,
                translation: DVec3::new(x, y, z),
            }),
            _ => {
                let count = numbers.len();
                Err(self.invalid(format!("has {count} numbers, expected a matrix of 3 or 4 rows and 4 columns")))
            }
        }
    }

    /// A rigid motion by a quaternion (w, x, y, z) and a translation with these names.
    pub fn by_quaternion(&self, quaternion: &str, translation: &str) -> Result<Rigid, DatasetError> {
        let field = self.get(quaternion)?;
        let numbers = field.numbers(4)?;
        let [w, x, y, z] = numbers[..] else { return Err(field.invalid("must have 4 numbers")) };
        let turn = DQuat::from_xyzw(x, y, z, w);
        if (turn.length() - 1.0).abs() > ROTATION_TOLERANCE {
            return Err(field.invalid(format!("has the length {}, expected 1; download the file again", turn.length())));
        }
        let rotation = DMat3::from_quat(turn.normalize());
        Ok(Rigid { rotation, translation: self.get(translation)?.point()? })
    }
}

/// A matrix of nine numbers, row by row.
fn rows(numbers: &[f64]) -> DMat3 {
    let mut all = [0.0; 9];
    all.iter_mut().zip(numbers).for_each(|(all, number)| *all = *number);
    DMat3::from_cols_array(&all).transpose()
}

//! Bounded reading of flatbuffers: tables, vectors and numbers, each offset checked.
//!
//! Reads what a TensorFlow Lite file needs, little-endian and aligned or not. Nothing is trusted: an offset that points
//! outside of the file is an error.

use crate::TrackerError;

/// Most entries that a vector of tables may have.
const MOST_TABLES: usize = 4096;

/// A table inside the bytes of a file.
#[derive(Clone, Copy)]
pub struct Table<'a> {
    bytes: &'a [u8],
    position: usize,
}

fn outside() -> TrackerError {
    TrackerError::Network("has an offset that points outside of it".into())
}

/// `N` bytes at a position.
fn at<const N: usize>(bytes: &[u8], position: usize) -> Result<[u8; N], TrackerError> {
    let rest = bytes.get(position..).ok_or_else(outside)?;
    rest.first_chunk().copied().ok_or_else(outside)
}

fn u32_at(bytes: &[u8], position: usize) -> Result<u32, TrackerError> {
    Ok(u32::from_le_bytes(at(bytes, position)?))
}

/// The position that the offset at `position` points to.
fn follow(bytes: &[u8], position: usize) -> Result<usize, TrackerError> {
    position.checked_add(u32_at(bytes, position)? as usize).filter(|&to| to < bytes.len()).ok_or_else(outside)
}

impl<'a> Table<'a> {
    /// The root table of a file with this identifier.
    ///
    /// # Errors
    /// If the identifier differs, or the file is too short.
    pub fn root(bytes: &'a [u8], identifier: &[u8; 4]) -> Result<Self, TrackerError> {
        if at::<4>(bytes, 4)? != *identifier {
            return Err(TrackerError::Network("is not a TensorFlow Lite file".into()));
        }
        Ok(Table { bytes, position: follow(bytes, 0)? })
    }

    /// The position of a field, or `None` if the table has the field's default.
    fn field(&self, index: usize) -> Result<Option<usize>, TrackerError> {
        let back = i64::from(i32::from_le_bytes(at(self.bytes, self.position)?));
        let layout = usize::try_from(self.position as i64 - back).map_err(|_| outside())?;
        let size = usize::from(u16::from_le_bytes(at(self.bytes, layout)?));
        let entry = 4 + 2 * index;
        if entry + 2 > size {
            return Ok(None);
        }
        let offset = u16::from_le_bytes(at(self.bytes, layout + entry)?);
        Ok((offset != 0).then(|| self.position + usize::from(offset)))
    }

    /// A number of one byte, also a bool; absent: zero.
    ///
    /// # Errors
    /// If an offset points outside of the file.
    pub fn byte(&self, index: usize) -> Result<u8, TrackerError> {
        let position = self.field(index)?;
        position.map_or(Ok(0), |position| at::<1>(self.bytes, position).map(|[byte]| byte))
    }

    /// A signed number of four bytes; absent: `default`.
    ///
    /// # Errors
    /// If an offset points outside of the file.
    pub fn int(&self, index: usize, default: i32) -> Result<i32, TrackerError> {
        let position = self.field(index)?;
        position.map_or(Ok(default), |position| at(self.bytes, position).map(i32::from_le_bytes))
    }

    /// A table in a field.
    ///
    /// # Errors
    /// If it is missing, or an offset points outside of the file.
    pub fn table(&self, index: usize) -> Result<Table<'a>, TrackerError> {
        let missing = || TrackerError::Network("lacks options of an operator".into());
        let position = self.field(index)?.ok_or_else(missing)?;
        Ok(Table { bytes: self.bytes, position: follow(self.bytes, position)? })
    }

    /// The entries of a vector whose entries have `size` bytes each; absent: empty.
    ///
    /// # Errors
    /// If an offset points outside of the file.
    pub fn vector(&self, index: usize, size: usize) -> Result<&'a [u8], TrackerError> {
        let Some(position) = self.field(index)? else { return Ok(&[]) };
        let start = follow(self.bytes, position)?;
        let length = (u32_at(self.bytes, start)? as usize).checked_mul(size).ok_or_else(outside)?;
        self.bytes.get(start + 4..).and_then(|rest| rest.get(..length)).ok_or_else(outside)
    }

    /// A vector of signed numbers; absent: empty.
    ///
    /// # Errors
    /// If an offset points outside of the file.
    pub fn ints(&self, index: usize) -> Result<Vec<i32>, TrackerError> {
        Ok(self.vector(index, 4)?.as_chunks().0.iter().map(|bytes| i32::from_le_bytes(*bytes)).collect())
    }

    /// A vector of tables; absent: empty.
    ///
    /// # Errors
    /// If it has more than 4096 entries, or an offset points outside of the file.
    pub fn tables(&self, index: usize) -> Result<Vec<Table<'a>>, TrackerError> {
        let Some(position) = self.field(index)? else { return Ok(Vec::new()) };
        let entries = follow(self.bytes, position)? + 4;
        let count = self.vector(index, 4)?.len() / 4;
        if count > MOST_TABLES {
            return Err(TrackerError::Network(format!("has a list of {count} parts, more than {MOST_TABLES}")));
        }
        let table = |k| Ok(Table { bytes: self.bytes, position: follow(self.bytes, entries + 4 * k)? });
        (0..count).map(table).collect()
    }
}

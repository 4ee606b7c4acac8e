//! Reads `.npz` archives: arrays by name, as `numpy.savez` and `numpy.savez_compressed` write them.

mod array;
mod header;

use std::io::{Cursor, Read};

pub use array::{ArrayError, NumericArray};
pub(crate) use array::{ElementKind, ElementType, element_count};

use header::{Header, split_header};

/// Most bytes that are unpacked from one archive, so that a small file cannot exhaust memory or time: twice the size of
/// a whole body's model.
const MAX_UNPACKED: usize = 1 << 29;

/// Most arrays in an archive.
const MAX_ARRAYS: usize = 4096;

/// An `.npz` archive.
#[derive(Debug)]
pub struct Npz<'a> {
    archive: zip::ZipArchive<Cursor<&'a [u8]>>,
    /// Bytes that may still be unpacked.
    budget: usize,
}

impl<'a> Npz<'a> {
    /// Whether the bytes begin like an archive.
    pub fn recognises_bytes(bytes: &[u8]) -> bool {
        bytes.starts_with(b"PK\x03\x04") || bytes.starts_with(b"PK\x05\x06")
    }

    /// Opens the bytes of an `.npz` file.
    ///
    /// # Errors
    /// [`ArrayError`] if they are not a zip archive, or one with more than 4096 files.
    pub fn open(bytes: &'a [u8]) -> Result<Npz<'a>, ArrayError> {
        let archive = zip::ZipArchive::new(Cursor::new(bytes)).map_err(|error| {
            ArrayError(format!("is not a readable archive (.npz or .pt: {error}); copy or download it again"))
        })?;
        if archive.len() > MAX_ARRAYS {
            let problem = format!("has {} arrays; at most {MAX_ARRAYS} are read, store less in it", archive.len());
            return Err(ArrayError(problem));
        }
        Ok(Npz { archive, budget: MAX_UNPACKED })
    }

    /// Names of the arrays, in the archive's order.
    pub fn names(&self) -> Vec<String> {
        let names = self.archive.file_names().filter_map(Result::ok);
        names.filter_map(|name| name.strip_suffix(".npy").map(str::to_owned)).collect()
    }

    /// Whether an array of this name exists.
    pub fn contains(&self, name: &str) -> bool {
        self.archive.index_for_name(&format!("{name}.npy")).is_some()
    }

    /// The numbers of the array `name`.
    ///
    /// # Errors
    /// [`ArrayError`] if it does not exist, is damaged or too large, is compressed by a method other than deflation, or
    /// is not numeric. The unpacked arrays of an archive together are limited to 512 MiB.
    pub fn numbers(&mut self, name: &str) -> Result<NumericArray, ArrayError> {
        self.stored(name)?.numbers()
    }

    /// The array `name` as stored: its bytes with their type.
    ///
    /// # Errors
    /// As for [`Npz::numbers`], except that elements of any type are accepted.
    pub fn stored(&mut self, name: &str) -> Result<StoredArray, ArrayError> {
        read_npy(self.file(&format!("{name}.npy"))?)
    }

    /// Names of all files, in the archive's order.
    pub(crate) fn files(&self) -> Vec<String> {
        self.archive.file_names().filter_map(Result::ok).map(|name| name.to_string()).collect()
    }

    /// The bytes of a file of the archive.
    pub(crate) fn file(&mut self, name: &str) -> Result<Vec<u8>, ArrayError> {
        let damaged =
            |error: &dyn std::fmt::Display| ArrayError(format!("cannot be unpacked ({error}); write the file again"));
        let index = self.archive.index_for_name(name);
        let index = index.ok_or_else(|| ArrayError("is not in the archive; store it under this name".into()))?;
        let file = self.archive.by_index(index).map_err(|error| damaged(&error))?;
        let mut bytes = Vec::new();
        // One byte more than allowed distinguishes a full budget from an exceeded one. The size that the file declares
        // is not trusted.
        file.take(self.budget as u64 + 1).read_to_end(&mut bytes).map_err(|error| damaged(&error))?;
        self.budget = self.budget.checked_sub(bytes.len()).ok_or_else(|| {
            ArrayError(format!(
                "is too large when unpacked: an archive may have {MAX_UNPACKED} bytes, store less in it"
            ))
        })?;
        Ok(bytes)
    }
}

/// The array of an `.npy` file from its bytes.
///
/// # Errors
/// [`ArrayError`] if its header is damaged.
pub(crate) fn read_npy(mut bytes: Vec<u8>) -> Result<StoredArray, ArrayError> {
    let (Header { elements, fortran, shape }, data) = split_header(&bytes)?;
    let header_length = bytes.len() - data.len();
    bytes.drain(..header_length);
    Ok(StoredArray { elements, fortran, shape, data: bytes })
}

/// An array as stored.
#[derive(Debug)]
pub struct StoredArray {
    pub(crate) elements: ElementType,
    /// Whether the first index runs fastest.
    pub(crate) fortran: bool,
    pub(crate) shape: Vec<usize>,
    pub(crate) data: Vec<u8>,
}

impl StoredArray {
    /// Its numbers.
    ///
    /// # Errors
    /// [`ArrayError`] if it is not numeric, or the number of its bytes does not match its shape.
    pub fn numbers(&self) -> Result<NumericArray, ArrayError> {
        self.elements.numbers(&self.data, &self.shape, self.fortran)
    }

    /// The pickle of its elements, if these are Python objects.
    pub fn pickle(&self) -> Option<&[u8]> {
        (self.elements.kind == ElementKind::Object).then_some(&*self.data)
    }

    /// Its text, if it is a text without axes.
    pub fn text(&self) -> Option<String> {
        if self.shape.is_empty() { self.elements.text(&self.data) } else { None }
    }
}

//! Files of MANO parameters: arrays by name.

use ghand_files::npz::NumericArray;

use super::fields::Fields;
use crate::HandModelError;

/// Arrays by name, from a pickled dictionary or an `.npz` archive. Nothing that a file names is executed.
pub struct NamedArrays<'a>(Fields<'a>);

impl<'a> NamedArrays<'a> {
    /// Opens the bytes of a file. `origin` is the file's name and `remedy` says what to do if the file is wrong, both
    /// for messages.
    ///
    /// # Errors
    /// [`HandModelError::Invalid`] if it is neither, is damaged, or names a class or function that no array needs.
    pub fn open(origin: &'a str, bytes: &'a [u8], remedy: &'a str) -> Result<NamedArrays<'a>, HandModelError> {
        Fields::open(origin, bytes, remedy).map(NamedArrays)
    }

    /// Whether an array of this name exists.
    pub fn contains(&self, name: &str) -> bool {
        self.0.contains(name)
    }

    /// The array of that name.
    ///
    /// # Errors
    /// [`HandModelError::Invalid`] if it is missing, damaged, too large, not numeric or not finite.
    pub fn numbers(&mut self, name: &str) -> Result<NumericArray, HandModelError> {
        self.0.numbers(name)
    }
}

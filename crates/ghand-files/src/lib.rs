//! Reading and writing of files for all other crates: within limits, and never half-written.
//!
//! [`input_file`] opens files named by a user, [`atomic_file`] replaces a file completely or not at all, [`temporary`]
//! knows what a signal must not leave behind, [`claim`] lets one process at a time write,
//! [`json_error`] puts a parser's messages into plain words. [`Value`] is the content of any data file; [`npz`] reads and writes
//! NumPy's arrays, [`pickle`] reads Python's objects without executing anything.

pub mod atomic_file;
pub mod claim;
pub mod folder_lock;
pub mod input_file;
pub mod json_error;
pub mod npz;
pub mod pickle;
pub mod temporary;
pub mod value;

pub use value::Value;

//! Files as every other crate reads and writes them: within bounds, and never left half-written.
//!
//! [`input_file`] opens whatever a user names, [`atomic_file`] replaces a file at once or not at all, [`json_error`] puts a
//! parser's message into plain words. [`Value`] is what any data file holds; [`npz`] reads and writes NumPy's arrays, [`pickle`]
//! reads Python's objects without running anything.

pub mod atomic_file;
pub mod input_file;
pub mod json_error;
pub mod npz;
pub mod pickle;
pub mod value;

pub use value::Value;

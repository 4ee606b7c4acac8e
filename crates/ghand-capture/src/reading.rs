//! What opens a capture, and what its readers share: files of JSON and text, and checks of what they hold.

pub(crate) mod json_file;
pub(crate) mod json_stream;
pub mod open;
pub(crate) mod opened;
pub(crate) mod text_file;
pub(crate) mod validation;

//! When each frame is, and what is between frames that were not seen.

pub(crate) mod gaps;
pub(crate) mod timeline;

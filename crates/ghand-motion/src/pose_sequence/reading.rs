//! What all readers share: the file, its names and sides, the recording that they make, and what is said of files that
//! none reads.

pub(crate) mod file_skeleton;
pub(crate) mod folder;
pub(crate) mod known_layouts;
pub(crate) mod names;
pub(crate) mod recording;
pub(crate) mod refusal;
pub(crate) mod sides;
pub(crate) mod source;
pub(crate) mod unreadable;

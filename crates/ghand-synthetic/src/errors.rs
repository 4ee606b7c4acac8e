//! The errors of a real capture: of tracked poses, of segmented masks, of exposures.

pub(crate) mod exposures;
pub(crate) mod masks;
pub(crate) mod poses;

//! Images of a capture: their files, colours and masks, the views that are cut from them, and which are skipped.

pub mod blur;
pub mod color_correction;
pub(crate) mod file;
pub(crate) mod mask_values;
pub mod skipped;
pub(crate) mod usable;
pub mod view;
pub mod view_store;

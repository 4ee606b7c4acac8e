//! Captures of all formats, written in their exact layouts from the synthetic capture and read back; and errors for
//! invalid files.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test fails by panicking")]

mod bad_images;
mod findings;
mod fixtures;
mod hand_appearance;
mod hand_appearance_files;
mod hostile;
mod inspection;
mod interhand;
mod interhand_annotations;
mod interhand_files;
mod interhand_masks;
mod mano_captures;
mod usable_images;
mod view_store;

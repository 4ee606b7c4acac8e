//! Captures of all formats, written in their exact layouts from the synthetic capture and read back; and errors for
//! invalid files.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test fails by panicking")]

mod bad_images;
mod findings;
mod hand_appearance;
mod hostile;
mod inspection;
mod interhand;
mod interhand_annotations;
mod interhand_masks;
mod mano_captures;
mod usable_images;
mod view_store;

//! Captures of all formats, written in exactly their layouts from the synthetic capture and read back; and what is wrong
//! with such files is told.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test fails by panicking")]

#[path = "../../../crates/ghand-hand-model/tests/support/mod.rs"]
mod support;

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

//! What an alignment has found: its figures and its picture, a review of its poses, and when it is rejected.

pub mod figures;
pub mod picture;
pub(crate) mod rejection;
pub mod review;

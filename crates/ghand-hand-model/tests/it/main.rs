//! Hand models from the outside: readers, the built-in hand, poses and surfaces.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test fails by panicking")]
#![allow(clippy::neg_cmp_op_on_partial_ord, reason = "`!(error <= bound)` rejects NaN too")]

mod builtin;
mod builtin_anatomy;
mod fuzz_corpus;
mod joint_limits;
mod mano;
mod named_poses;
mod pose_correctives;
mod surface;

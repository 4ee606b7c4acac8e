//! Whole trainings on small captures with known truth.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

#[path = "../../../ghand-fit/tests/it/common.rs"]
mod common;

mod device_loss;
mod exposure;
mod extreme_poses;
mod light;
mod light_where_nobody_looked;
mod lpips;
mod merged_texels;
mod planted;
mod planted_truth;
mod resume;
mod simplify;
mod stopping;
mod train;
mod unseen_poses;

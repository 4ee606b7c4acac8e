//! Whole trainings on small captures with known truth.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

#[path = "../../../ghand-fit/tests/it/common.rs"]
mod common;

mod device_loss;
mod exposure;
mod extreme_poses;
mod light;
mod lpips;
mod merged_texels;
mod planted;
mod planted_truth;
mod resume;
mod simplify;
mod stopping;
mod train;
mod unseen_poses;

/// Whether the tests are built with what a model needs.
fn is_built(model: &ghand_train::Model) -> bool {
    cfg!(feature = "networks") || *model != ghand_train::Model::Network
}

#[cfg(not(feature = "networks"))]
#[test]
fn networks_that_are_not_built_are_refused_with_the_remedy() {
    let settings = ghand_train::TrainSettings { model: ghand_train::Model::Network, ..Default::default() };
    let error = settings.check_build().unwrap_err().to_string();
    assert!(error.contains("model") && error.contains("--features networks"), "{error}");
}

//! SSIM in only some iterations.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod common;

use common::{make, small_options};
use ghand_avatar::PropertyTables;
use ghand_capture::Capture;
use ghand_render::{AdapterChoice, Gpu};
use ghand_synthetic::SyntheticOptions;
use ghand_train::{Align, LightChoice, TrainSettings, Trainer};

/// What so many iterations learn.
fn learned(gpu: &Gpu, capture: &Capture, iterations: u64, ssim_every: u64, ssim_weight: f64) -> PropertyTables {
    let settings = TrainSettings {
        iterations,
        ssim_every,
        ssim_weight,
        uv_resolution: 48,
        align: Align::None,
        light: LightChoice::None,
        ..TrainSettings::default()
    };
    Trainer::new(gpu, capture, "train", &settings).unwrap().train(|_| ()).unwrap().avatar.tables
}

#[test]
fn ssim_counts_in_every_nth_iteration_with_n_times_its_weight() {
    let gpu = Gpu::new(&AdapterChoice::from_env()).unwrap_or_else(|e| panic!("{e}"));
    let (capture, _folder) = make(&SyntheticOptions { views: 2, train_frames: 2, ..small_options(11) });
    // The schedule of the rates depends on the number of iterations, so runs of the same length are compared.
    let first = learned(&gpu, &capture, 1, 2, 0.2);
    assert!(first == learned(&gpu, &capture, 1, 1, 0.0), "the first of two iterations is without SSIM");
    assert!(first != learned(&gpu, &capture, 1, 1, 0.2));
    assert!(learned(&gpu, &capture, 2, 2, 0.2) != learned(&gpu, &capture, 2, 1, 0.0), "the second has it");
    let weight = |every, weight| learned(&gpu, &capture, 2, every, weight);
    assert!(weight(2, 0.2) != weight(2, 0.1), "its weight counts");
}

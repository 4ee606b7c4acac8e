//! Cameras with other exposures.

use crate::common::{make, small_options};
use ghand_fit::exposure::ExposureFit;
use ghand_render::{AdapterChoice, Gpu};
use ghand_synthetic::SyntheticOptions;
use ghand_test_support::long;
use ghand_train::{Align, ExposureChoice, LightChoice, TrainSettings, Trainer};

/// What a short run finds of the exposures of a capture with true poses.
fn found(exposure_noise: f64, exposure: ExposureChoice) -> Option<ExposureFit> {
    let options =
        SyntheticOptions { exposure_noise, pose_noise_degrees: 0.0, translation_noise: 0.0, ..small_options(6) };
    let (capture, _folder) = make(&options);
    let gpu = Gpu::new(&AdapterChoice::from_env()).unwrap_or_else(|e| panic!("{e}"));
    let settings = TrainSettings {
        iterations: 2,
        uv_resolution: 32,
        align: Align::Off,
        light: LightChoice::Off,
        exposure,
        ..Default::default()
    };
    let fit = Trainer::new(&gpu, &capture, "train", &settings).unwrap().train(|_| ()).unwrap().exposure;
    println!("{exposure_noise}: {:?}", fit.as_ref().map(|fit| (fit.spread, fit.squared_difference_left_out)));
    fit
}

#[test]
fn cameras_are_corrected_where_they_differ() {
    let fit = found(0.1, ExposureChoice::Auto).unwrap();
    assert!(fit.corrected && (0.04..0.2).contains(&fit.spread), "{fit:?}");
    let [without, with] = fit.squared_difference_left_out;
    assert!(with < 0.5 * without, "{fit:?}");
}

#[test]
fn cameras_that_are_alike_are_left_alone() {
    if !long() {
        return;
    }
    let fit = found(0.0, ExposureChoice::Auto).unwrap();
    assert!(!fit.corrected && fit.spread < 0.03, "{fit:?}");
    assert_eq!(found(0.0, ExposureChoice::Off), None);
}

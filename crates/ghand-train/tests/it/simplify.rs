//! Avatars as simple as their images allow.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use crate::common::{make, small_options};
use ghand_render::{AdapterChoice, Gpu};
use ghand_synthetic::SyntheticOptions;
use ghand_test_support::long;
use ghand_train::{Align, Checkpoints, LightChoice, Simplify, TrainError, TrainSettings, Trainer};

fn settings() -> TrainSettings {
    TrainSettings {
        simplify: Simplify::Auto,
        iterations: 60,
        uv_resolution: 64,
        align: Align::Off,
        light: LightChoice::Off,
        lpips_weight: 0.0,
        ..TrainSettings::default()
    }
}

#[test]
fn what_frames_left_out_do_not_require_is_left_out() {
    if !long() {
        return;
    }
    let gpu = Gpu::new(&AdapterChoice::from_env()).unwrap_or_else(|e| panic!("{e}"));
    let (capture, folder) = make(&small_options(7));
    let settings = settings();
    let train = |checkpoints: &str, stop_at: u64| {
        let stop = AtomicBool::new(false);
        let checkpoints = folder.path().join(checkpoints);
        let mut trainer = Trainer::new(&gpu, &capture, "train", &settings).unwrap();
        if let Some(checkpoint) = Checkpoints::latest(&checkpoints).unwrap() {
            trainer = trainer.resume(checkpoint).unwrap();
        }
        let trainer =
            trainer.stop_when(&stop).with_checkpoints(Checkpoints::new(&checkpoints, Duration::from_secs(1000), 0));
        let mut told = vec![];
        let trained = trainer.train(|p| {
            told.extend(p.trial.cloned());
            stop.store(p.iteration >= stop_at, Ordering::Relaxed);
        });
        (trained.unwrap(), told)
    };
    let (trained, told) = train("whole", u64::MAX);
    let found = trained.simplification.clone().unwrap();
    assert_eq!(told, found.trials);
    for trial in &found.trials {
        println!("{:?}: {} Gaussians, {:.2} dB, {} bytes", trial.changes, trial.gaussians, trial.psnr, trial.bytes);
    }
    println!("{}", found.summary());
    let [set, taken] = [&found.trials[0], &found.trials[found.taken]];
    assert!(set.changes.is_empty() && taken.psnr >= set.psnr - 0.15);
    // After so few iterations bases and colours of the pose bring nothing; fewer Gaussians do harm at some point.
    assert!(taken.bytes < set.bytes && taken.gaussians > 100, "{}", found.summary());
    assert!(found.trials.last().unwrap().psnr < set.psnr - 0.15, "the search ends where something is lost");
    assert_eq!((found.frames_left_out, found.images), (2, 12));
    // The avatar has what was taken.
    assert_eq!(trained.settings, found.apply(&settings).unwrap());
    // The images that were left out show a little more of the hand.
    let gaussians = trained.avatar.template.len();
    let tried = taken.gaussians;
    assert!(gaussians.abs_diff(tried) * 50 <= tried, "{gaussians} Gaussians, {tried} were tried");
    assert_eq!(trained.avatar.config, trained.settings.avatar());
    // A run that is interrupted afterwards does not try again, and ends with the same avatar.
    assert!(train("parts", 30).0.stopped);
    let (resumed, told) = train("parts", u64::MAX);
    assert!(told.is_empty());
    assert_eq!(resumed.simplification.unwrap().taken, found.taken);
    assert!(resumed.avatar == trained.avatar);
    // It may be stopped in a trial.
    let stop = AtomicBool::new(true);
    let stopped = Trainer::new(&gpu, &capture, "train", &settings).unwrap().stop_when(&stop).train(|_| ());
    assert!(matches!(stopped, Err(TrainError::Stopped { .. })));
}

#[test]
fn too_few_frames_leave_the_avatar_as_set() {
    let gpu = Gpu::new(&AdapterChoice::from_env()).unwrap_or_else(|e| panic!("{e}"));
    let (capture, _folder) = make(&SyntheticOptions { train_frames: 3, ..small_options(7) });
    let settings = TrainSettings { iterations: 10, ..settings() };
    let trained = Trainer::new(&gpu, &capture, "train", &settings).unwrap().train(|_| ()).unwrap();
    assert!(trained.simplification.is_none() && trained.settings == settings);
}

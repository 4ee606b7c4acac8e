//! Runs that go on from a checkpoint.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use crate::is_built;
use ghand_capture::Capture;
use ghand_render::{AdapterChoice, Gpu};
use ghand_synthetic::SyntheticOptions;
use ghand_synthetic::make_capture::make_capture;
use ghand_test_support::long;
use ghand_train::{Align, Checkpoints, GlossChoice, LightChoice, Model, TrainError, TrainSettings, Trained, Trainer};

/// Runs `test` with a device and a small capture.
fn with_capture(test: impl FnOnce(&Gpu, &Capture)) {
    let gpu = Gpu::new(&AdapterChoice::from_env()).unwrap_or_else(|e| panic!("{e}"));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("capture");
    let options = SyntheticOptions {
        views: 5,
        train_frames: 3,
        test_frames: 0,
        width: 64,
        height: 96,
        ..SyntheticOptions::default()
    };
    make_capture(&gpu, &options, &path).unwrap();
    test(&gpu, &Capture::open(&path).unwrap());
}

fn settings() -> TrainSettings {
    TrainSettings { iterations: 40, uv_resolution: 32, lpips_weight: 0.0, ..Default::default() }
}

/// Runs until iteration `stop_at`, from the newest checkpoint of the folder on if there is one.
fn run(gpu: &Gpu, capture: &Capture, settings: &TrainSettings, folder: &Path, stop_at: u64) -> Option<Trained> {
    let stop = AtomicBool::new(false);
    let mut trainer = Trainer::new(gpu, capture, "train", settings).unwrap();
    if let Some(checkpoint) = Checkpoints::latest(folder).unwrap() {
        trainer = trainer.resume(checkpoint).unwrap();
    }
    let trainer = trainer.stop_when(&stop).with_checkpoints(Checkpoints::new(folder, Duration::from_secs(1000), 0));
    let trained = trainer.train(|p| stop.store(p.iteration >= stop_at, Ordering::Relaxed));
    match trained {
        Ok(trained) => Some(trained),
        Err(TrainError::Stopped { .. }) => None,
        Err(error) => panic!("{error}"),
    }
}

fn bytes(trained: &Trained) -> Vec<u8> {
    let file = tempfile::NamedTempFile::new().unwrap();
    trained.avatar.save(file.path()).unwrap();
    std::fs::read(file.path()).unwrap()
}

#[test]
fn an_interrupted_run_ends_with_the_same_bytes() {
    if !long() {
        return;
    }
    with_capture(|gpu, capture| {
        let lpips_weight = TrainSettings::default().lpips_weight;
        let lit =
            TrainSettings { light: LightChoice::Transfer, gloss: GlossChoice::Always, lpips_weight, ..settings() };
        let stages = TrainSettings { align: Align::Paper, light: LightChoice::Off, ..settings() };
        let network = TrainSettings { model: Model::Network, iterations: 8, ..stages.clone() };
        // Of large networks the first steps overshoot: slow ones here.
        let slow = TrainSettings { rate_networks: 1e-5, rate_feature_tensor: 1e-5, ..network.clone() };
        let batch = TrainSettings { network: ghand_train::Network::Paper, iterations: 4, ..slow };
        let cases = [(lit, &[1, 17, 33, 39][..]), (stages, &[7, 19, 20, 21, 30]), (network, &[2, 5, 6]), (batch, &[3])];
        for (settings, stops) in cases.into_iter().filter(|(settings, _)| is_built(&settings.model)) {
            let [unused, folder] = [tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap()];
            let whole = run(gpu, capture, &settings, unused.path(), u64::MAX).unwrap();
            for stop_at in stops {
                let part = run(gpu, capture, &settings, folder.path(), *stop_at);
                assert!(part.is_none_or(|part| part.stopped && part.iterations == *stop_at), "{stop_at}");
            }
            let resumed = run(gpu, capture, &settings, folder.path(), u64::MAX).unwrap();
            assert_eq!((resumed.iterations, resumed.stopped), (settings.iterations, false));
            assert!(bytes(&whole) == bytes(&resumed), "{:?}, align {:?}", settings.model, settings.align);
            assert_eq!(whole.poses, resumed.poses);
            assert_eq!(whole.light.as_ref().map(|fit| &fit.light), resumed.light.as_ref().map(|fit| &fit.light));
            // The last checkpoint is that of the end.
            let again = run(gpu, capture, &settings, folder.path(), u64::MAX).unwrap();
            assert!(bytes(&whole) == bytes(&again));
        }
    });
}

#[test]
fn a_checkpoint_of_another_run_is_refused_with_what_differs() {
    with_capture(|gpu, capture| {
        let folder = tempfile::tempdir().unwrap();
        let none = TrainSettings { align: Align::Off, light: LightChoice::Off, ..settings() };
        run(gpu, capture, &none, folder.path(), 3);
        let refusal = |capture: &Capture, settings: &TrainSettings| {
            let checkpoint = Checkpoints::latest(folder.path()).unwrap().unwrap();
            Trainer::new(gpu, capture, "train", settings).unwrap().resume(checkpoint).err().unwrap().to_string()
        };
        let message = refusal(capture, &TrainSettings { rate_joints: 0.5, ..none.clone() });
        assert!(message.contains("`rate_joints` was 0.0001") && message.contains("is 0.5 now"), "{message}");
        let mut moved = capture.clone();
        moved.frames[0].pose.translation.x += 1e-9;
        let message = refusal(&moved, &none);
        assert!(message.contains("its poses have changed"), "{message}");
    });
}

#[test]
fn a_run_of_limited_time_ends_in_time_with_its_rates_run_down() {
    with_capture(|gpu, capture| {
        let settings = TrainSettings { iterations: 1_000_000, max_seconds: 3.0, align: Align::Off, ..settings() };
        let trained = Trainer::new(gpu, capture, "train", &settings).unwrap().train(|_| ()).unwrap();
        assert!(!trained.stopped && (1..1_000_000).contains(&trained.iterations), "{}", trained.iterations);
    });
}

#[test]
fn an_avatar_that_is_shown_while_it_is_trained_ends_with_the_same_bytes() {
    if !long() {
        return;
    }
    with_capture(|gpu, capture| {
        let stages = TrainSettings { align: Align::Paper, ..settings() };
        let network = TrainSettings { model: Model::Network, iterations: 6, ..stages.clone() };
        for settings in [stages, network].into_iter().filter(|settings| is_built(&settings.model)) {
            let trainer = || Trainer::new(gpu, capture, "train", &settings).unwrap();
            let alone = trainer().train(|_| ()).unwrap();
            let mut shown = vec![];
            let watched = trainer().with_preview(Duration::ZERO, |avatar| shown.push(avatar)).train(|_| ()).unwrap();
            assert!(bytes(&alone) == bytes(&watched), "{:?}", settings.model);
            assert_eq!(shown.len() as u64, settings.iterations, "one before each iteration");
            let folder = tempfile::tempdir().unwrap();
            for (k, avatar) in shown.iter().enumerate() {
                assert_eq!(avatar.provenance.iterations, k as u64);
                avatar.save(&folder.path().join("avatar.ghand")).unwrap();
            }
        }
    });
}

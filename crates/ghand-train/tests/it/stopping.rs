//! Training runs that end early: by request, or because they fail.

use std::sync::atomic::{AtomicBool, Ordering};

use crate::is_built;
use ghand_avatar::{Avatar, PropertyTables};
use ghand_capture::Capture;
use ghand_fit::views::TrainViews;
use ghand_render::{AdapterChoice, Gpu};
use ghand_synthetic::SyntheticOptions;
use ghand_synthetic::make_capture::{make_capture, make_capture_unless};
use ghand_test_support::cases;
use ghand_train::step::{Rates, Step, StepOutcome};
use ghand_train::{Align, Model, TrainError, TrainSettings, Trained, Trainer};

fn options() -> SyntheticOptions {
    SyntheticOptions { views: 5, train_frames: 2, test_frames: 0, width: 64, height: 96, ..SyntheticOptions::default() }
}

/// Runs `test` with a device and a small capture.
fn with_capture(test: impl FnOnce(&Gpu, &Capture)) {
    let gpu = Gpu::new(&AdapterChoice::from_env()).unwrap_or_else(|e| panic!("{e}"));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("capture");
    make_capture(&gpu, &options(), &path).unwrap();
    test(&gpu, &Capture::open(&path).unwrap());
}

fn settings() -> TrainSettings {
    TrainSettings { iterations: 40, align: Align::Paper, uv_resolution: 32, lpips_weight: 0.0, ..Default::default() }
}

fn train(gpu: &Gpu, capture: &Capture, settings: &TrainSettings) -> Result<Trained, TrainError> {
    Trainer::new(gpu, capture, "train", settings).unwrap().train(|_| ())
}

#[test]
fn a_stop_in_stage_2_returns_the_avatar_and_a_stop_before_returns_none() {
    with_capture(|gpu, capture| {
        let run = |stop_at: u64| {
            let stop = AtomicBool::new(false);
            let mut last = 0;
            let trained = Trainer::new(gpu, capture, "train", &settings()).unwrap().stop_when(&stop).train(|p| {
                last = p.iteration;
                stop.store(p.iteration >= stop_at, Ordering::Relaxed);
            });
            assert_eq!(last, stop_at.min(40), "the run continued after the stop");
            trained
        };
        for stop_at in [3, 20] {
            let error = run(stop_at).unwrap_err();
            assert!(
                matches!(error, TrainError::Stopped { iteration, iterations: 40 } if iteration == stop_at),
                "{error}"
            );
            assert!(error.to_string().contains("no avatar to save yet"), "{error}");
        }
        let stopped = run(30).unwrap();
        assert_eq!((stopped.iterations, stopped.avatar.provenance.iterations), (30, 30));
        let whole = run(41).unwrap();
        assert_eq!((whole.iterations, whole.avatar.provenance.iterations), (40, 40));
        // A stop in the last iteration has no effect.
        assert!(run(40).unwrap().avatar.tables == whole.avatar.tables);
        assert!(stopped.avatar.tables != whole.avatar.tables);
    });
}

#[test]
fn numbers_that_are_not_finite_end_a_run_and_name_the_setting() {
    with_capture(|gpu, capture| {
        // The run ends long before its last iteration.
        let endless = TrainSettings { iterations: 100_000, align: Align::Off, rate_shape_basis: 1e38, ..settings() };
        let error = train(gpu, capture, &endless).unwrap_err();
        let message = error.to_string();
        assert!(matches!(error, TrainError::Diverged { stage: 2, iteration: 25, .. }), "{message}");
        assert!(message.contains("`rate_shape_basis` is too high: it is 1e38"), "{message}");
        assert!(!message.contains('\n'), "{message}");
    });
}

#[test]
fn a_step_whose_gradients_are_not_finite_changes_nothing() {
    with_capture(|gpu, capture| {
        let split = capture.split("train").unwrap();
        let views = TrainViews::new(capture, split, 16).unwrap();
        for model in [Model::Direct, Model::Network].into_iter().filter(is_built) {
            let settings = TrainSettings { model, ..settings() };
            let avatar = Avatar::untrained(&capture.template, &settings.avatar(), [0.8, 0.6, 0.5], 1).unwrap();
            let joints = avatar.template.joint_count();
            let learn = |losses: [f64; 3]| {
                let mut step =
                    Step::new(gpu, &avatar, split.frames.len(), views.len(), [64, 96], &vec![1.0; joints]).unwrap();
                for (at, frame) in split.frames.iter().enumerate() {
                    step.set_pose(gpu, at, &capture.frames[*frame].pose).unwrap();
                }
                let mut number = 0;
                for values in losses {
                    number += u64::from(values.is_normal());
                    let rates = Rates { step: number, tables: 1.0, pose: Some(1e-2), pose_step: number, lpips: false };
                    let view = views.get(0, 1).unwrap();
                    let outcome = step.run(gpu, &view, values, [0.0; 3], &settings, &rates).unwrap();
                    assert_eq!(outcome == StepOutcome::Updated, values.is_normal(), "{values}");
                }
                (step.tables(gpu).unwrap(), step.hand_parameters(gpu, split.frames.len()).unwrap().poses)
            };
            // The loss is a mean over so many values: over none it is infinite.
            let pixels = 3.0 * 64.0 * 96.0;
            let learned = learn([pixels, 0.0, pixels]);
            assert!(learned == learn([pixels, pixels, 0.0]), "{model:?}");
            assert!(learned == learn([0.0, pixels, pixels]), "{model:?}");
            assert!(learned.0 != avatar.tables, "nothing was learned");
        }
    });
}

#[test]
fn a_loss_that_rises_ends_a_run_and_names_the_setting() {
    with_capture(|gpu, capture| {
        for (setting, stage) in [("rate_shape_basis=1", 2), ("rate_joints=1", 1)] {
            let align = if stage == 1 { Align::Paper } else { Align::Off };
            let mut settings = TrainSettings { align, ..settings() };
            settings.set(setting).unwrap();
            let error = train(gpu, capture, &settings).err().unwrap_or_else(|| panic!("{setting}"));
            let message = error.to_string();
            assert!(matches!(error, TrainError::Diverged { stage: s, .. } if s == stage), "{setting}: {message}");
            assert!(message.contains("the loss rose from") && message.contains("is too high"), "{message}");
        }
    });
}

#[test]
fn runs_of_a_few_iterations_do_not_count_as_failed() {
    with_capture(|gpu, capture| {
        let paper = Align::Paper;
        let off = Align::Off;
        for (iterations, align) in [(1, paper), (2, paper), (4, paper), (4, off), (10, paper)] {
            for seed in 1..=cases(1, 3) {
                let trained = train(gpu, capture, &TrainSettings { iterations, align, seed, ..settings() });
                assert!(trained.is_ok(), "{iterations} iterations: {}", trained.unwrap_err());
            }
        }
    });
}

#[test]
fn measuring_the_loss_does_not_change_what_is_learned() {
    with_capture(|gpu, capture| {
        let split = capture.split("train").unwrap();
        let views = TrainViews::new(capture, split, 16).unwrap();
        let config = settings().avatar();
        let avatar = Avatar::untrained(&capture.template, &config, [0.8, 0.6, 0.5], 1).unwrap();
        let joints = avatar.template.joint_count();
        let learn = |look: bool| {
            let mut step =
                Step::new(gpu, &avatar, split.frames.len(), views.len(), [64, 96], &vec![1.0; joints]).unwrap();
            for (at, frame) in split.frames.iter().enumerate() {
                step.set_pose(gpu, at, &capture.frames[*frame].pose).unwrap();
            }
            let mut losses = vec![];
            for k in 0..4 {
                if look {
                    losses.push(step.measure(gpu, &views.get(9, 1).unwrap(), [0.0; 3], &settings()).unwrap());
                }
                let rates = Rates { step: k + 1, tables: 1.0, pose: Some(1e-2), pose_step: 1, lpips: false };
                let view = views.get(k as usize, 1).unwrap();
                let outcome = step.run(gpu, &view, 3.0 * 64.0 * 96.0, [0.0; 3], &settings(), &rates).unwrap();
                assert_eq!(outcome, StepOutcome::Updated);
            }
            assert!(losses.windows(2).all(|pair| pair[1] != pair[0]), "{losses:?}");
            step.tables(gpu).unwrap()
        };
        let tables = learn(false);
        assert!(tables == learn(true));
        assert!(tables != avatar.tables, "nothing was learned");
    });
}

#[test]
fn a_frame_that_must_grow_is_learned_from_once() {
    with_capture(|gpu, capture| {
        let split = capture.split("train").unwrap();
        let views = TrainViews::new(capture, split, 16).unwrap();
        let mut avatar = Avatar::untrained(&capture.template, &settings().avatar(), [0.8, 0.6, 0.5], 1).unwrap();
        // Gaussians of the largest possible size cover more tiles than the initial capacity.
        let PropertyTables::Direct(tables) = &mut avatar.tables else { unreachable!() };
        tables.appearance[..avatar.template.len()].fill(5.0);
        let joints = avatar.template.joint_count();
        let learn = |grow_first: bool| {
            let mut step =
                Step::new(gpu, &avatar, split.frames.len(), views.len(), [64, 96], &vec![1.0; joints]).unwrap();
            for (at, frame) in split.frames.iter().enumerate() {
                step.set_pose(gpu, at, &capture.frames[*frame].pose).unwrap();
            }
            let view = views.get(0, 1).unwrap();
            let at_first = step.scene().splatter().capacity();
            if grow_first {
                step.measure(gpu, &view, [0.0; 3], &settings()).unwrap();
                assert!(step.scene().splatter().capacity() > at_first);
            }
            let rates = Rates { step: 1, tables: 1.0, pose: Some(1e-2), pose_step: 1, lpips: false };
            let outcome = step.run(gpu, &view, 3.0 * 64.0 * 96.0, [0.0; 3], &settings(), &rates).unwrap();
            assert_eq!(outcome, StepOutcome::Updated);
            assert!(step.scene().splatter().capacity() > at_first, "the frame did not have to grow");
            (step.tables(gpu).unwrap(), step.hand_parameters(gpu, split.frames.len()).unwrap().poses)
        };
        let learned = learn(false);
        assert!(learned == learn(true));
        assert!(learned.0 != avatar.tables, "nothing was learned");
    });
}

#[test]
fn a_capture_stopped_while_being_made_leaves_no_files() {
    let gpu = Gpu::new(&AdapterChoice::from_env()).unwrap_or_else(|e| panic!("{e}"));
    let folder = tempfile::tempdir().unwrap();
    let stop = AtomicBool::new(true);
    let made = make_capture_unless(&gpu, &options(), &folder.path().join("capture"), &stop).unwrap();
    assert!(!made);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    stop.store(false, Ordering::Relaxed);
    assert!(make_capture_unless(&gpu, &options(), &folder.path().join("capture"), &stop).unwrap());
}

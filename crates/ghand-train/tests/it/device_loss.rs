//! Training whose device is lost.

use std::path::Path;
use std::sync::mpsc::channel;
use std::time::Duration;

use ghand_avatar::PropertyTables;
use ghand_capture::Capture;
use ghand_core::pose_error::moving_joints;
use ghand_fit::views::TrainViews;
use ghand_measure::baseline::Baseline;
use ghand_measure::evaluation::evaluate;
use ghand_render::splat::Purpose;
use ghand_render::{AdapterChoice, Gpu, RenderError};
use ghand_synthetic::SyntheticOptions;
use ghand_synthetic::make_capture::make_capture;
use ghand_train::step::{Rates, Step, StepOutcome};
use ghand_train::{Align, TrainSettings, Trained, Trainer};

/// Far longer than any test here takes.
const PATIENCE: Duration = Duration::from_secs(300);

/// Runs `work` on another thread, so that a call that waits forever fails the test instead of stopping it.
fn in_time(work: impl FnOnce() + Send + 'static) {
    let (sender, receiver) = channel();
    let thread = std::thread::spawn(move || {
        work();
        sender.send(()).unwrap();
    });
    if let Err(std::sync::mpsc::RecvTimeoutError::Timeout) = receiver.recv_timeout(PATIENCE) {
        panic!("it never returns");
    }
    thread.join().unwrap_or_else(|e| std::panic::resume_unwind(e));
}

fn gpu() -> Gpu {
    Gpu::new(&AdapterChoice::from_env()).unwrap_or_else(|e| panic!("{e}"))
}

fn small_capture(gpu: &Gpu, folder: &Path) -> Capture {
    let options = SyntheticOptions {
        views: 5,
        train_frames: 3,
        test_frames: 1,
        test_views: 1,
        width: 64,
        height: 96,
        ..SyntheticOptions::default()
    };
    make_capture(gpu, &options, folder).unwrap();
    Capture::open(folder).unwrap()
}

fn settings() -> TrainSettings {
    TrainSettings { iterations: 20, align: Align::Paper, uv_resolution: 40, lpips_weight: 0.0, ..Default::default() }
}

/// Trains, losing the device at iteration `lost_at`. Returns the run and the iterations that it reported.
fn train(capture: &Capture, lost_at: Option<u64>) -> (Trained, Vec<u64>) {
    let gpu = gpu();
    let mut iterations = Vec::new();
    let trained = Trainer::new(&gpu, capture, "train", &settings()).unwrap().train(|p| {
        iterations.push(p.iteration);
        if Some(p.iteration) == lost_at {
            // This is the first device: the run makes the next one itself.
            gpu.device.destroy();
        }
    });
    assert_eq!(gpu.is_lost(), lost_at.is_some());
    (trained.unwrap(), iterations)
}

#[test]
fn a_run_that_loses_its_device_ends_with_the_same_avatar() {
    in_time(|| {
        let folder = tempfile::tempdir().unwrap();
        let capture = small_capture(&gpu(), &folder.path().join("capture"));
        let (whole, iterations) = train(&capture, None);
        assert_eq!(iterations, (1..=20).collect::<Vec<_>>());
        // Iteration 12 is the last of stage 1, but its poses are still on the device.
        for (lost_at, first_of_stage) in [(4, 1), (12, 1), (13, 13), (18, 13)] {
            let (trained, iterations) = train(&capture, Some(lost_at));
            let repeated: Vec<u64> = (1..=lost_at).chain(first_of_stage..=20).collect();
            assert_eq!(iterations, repeated);
            assert!(trained.avatar.tables == whole.avatar.tables, "lost at {lost_at}: another avatar");
            assert!(trained.poses == whole.poses, "lost at {lost_at}: other poses");
        }
        // The comparison detects a single changed number.
        let mut wrong = whole.avatar.tables.clone();
        let PropertyTables::Direct(tables) = &mut wrong else { unreachable!() };
        tables.shape_basis[3] += f32::EPSILON;
        assert!(wrong != whole.avatar.tables);
    });
}

#[test]
fn a_step_an_evaluation_and_a_capture_report_a_lost_device() {
    in_time(|| {
        let gpu = gpu();
        let folder = tempfile::tempdir().unwrap();
        let capture = small_capture(&gpu, &folder.path().join("capture"));
        let (trained, _) = train(&capture, None);
        let split = capture.split("train").unwrap();
        let views = TrainViews::new(&capture, split, 16).unwrap();
        let view = &views.get(0, 1).unwrap();
        let size = [64, 96];
        let poses: Vec<_> = split.frames.iter().map(|f| capture.frames[*f].pose.clone()).collect();
        let mobility: Vec<f32> = moving_joints(&poses).iter().map(|m| f32::from(*m)).collect();
        let mut step = Step::new(&gpu, &trained.avatar, poses.len(), views.len(), size, &mobility).unwrap();
        let rates = Rates { step: 1, tables: 1.0, pose: Some(1e-2), pose_step: 1, lpips: false };
        let mut run = |gpu: &Gpu| step.run(gpu, view, 1e4, [0.0; 3], &settings(), &rates);
        assert_eq!(run(&gpu).unwrap(), StepOutcome::Updated);
        let baseline = Baseline::new(&gpu, &capture, split, &poses, 4).unwrap();
        gpu.device.destroy();
        assert!(matches!(run(&gpu), Err(RenderError::Lost(_))));
        assert!(matches!(step.loss(&gpu, view), Err(RenderError::Lost(_))));
        let made = ghand_avatar::Scene::new(&gpu, &[&trained.avatar], Purpose::Images, 1, size);
        assert!(matches!(made.map(drop), Err(RenderError::Lost(_))));
        let sentences = [
            evaluate(&gpu, &trained.avatar, &capture, "test", &baseline, |_| ()).unwrap_err().to_string(),
            baseline.render(&poses[0], &capture.cameras[0], [0.0; 3]).unwrap_err().to_string(),
            make_capture(&gpu, &SyntheticOptions::default(), &folder.path().join("other")).unwrap_err().to_string(),
        ];
        for sentence in sentences {
            assert!(sentence.contains("was lost") && !sentence.contains('\n'), "{sentence}");
        }
        assert!(!folder.path().join("other").exists());
    });
}

//! LPIPS in the training step and in a whole run.

use std::path::Path;
use std::sync::Arc;

use ghand_avatar::Avatar;
use ghand_capture::Capture;
use ghand_fit::views::{TrainView, TrainViews};
use ghand_measure::lpips::{Lpips, Pair, SMALLEST_SIDE};
use ghand_render::{AdapterChoice, Gpu, buffers};
use ghand_synthetic::SyntheticOptions;
use ghand_synthetic::make_capture::make_capture;
use ghand_test_support::long;
use ghand_train::step::{Rates, Step, StepOutcome};
use ghand_train::{TrainSettings, Trainer};

fn gpu() -> Gpu {
    Gpu::new(&AdapterChoice::from_env()).unwrap_or_else(|e| panic!("{e}"))
}

fn small_capture(gpu: &Gpu, folder: &Path) -> Capture {
    let options = SyntheticOptions {
        views: 3,
        train_frames: 2,
        test_frames: 1,
        test_views: 1,
        width: 96,
        height: 128,
        ..SyntheticOptions::default()
    };
    make_capture(gpu, &options, folder).unwrap();
    Capture::open(folder).unwrap()
}

fn settings() -> TrainSettings {
    TrainSettings { iterations: 6, uv_resolution: 32, ..TrainSettings::default() }
}

/// The image's gradient and the image in a first step on a view.
fn first_step(
    gpu: &Gpu,
    capture: &Capture,
    view: &TrainView,
    value_count: f64,
    lpips: Option<&Arc<Lpips>>,
) -> [Vec<[f32; 4]>; 2] {
    let settings = settings();
    let avatar = Avatar::untrained(&capture.template, &settings.avatar(), [0.5; 3], 1).unwrap();
    let mobility = vec![0.0; avatar.template.joint_count()];
    let mut step = Step::new(gpu, &avatar, 1, 1, [96, 128], &mobility).unwrap();
    step.set_pose(gpu, 0, &capture.frames[0].pose).unwrap();
    lpips.into_iter().for_each(|lpips| step.use_lpips(lpips));
    let rates = Rates { step: 1, tables: 1.0, pose: None, pose_step: 1, lpips: true };
    let outcome = step.run(gpu, view, value_count, [0.2, 0.3, 0.4], &settings, &rates).unwrap();
    assert_eq!(outcome, StepOutcome::Updated);
    let splatter = step.scene().splatter();
    [buffers::read(gpu, splatter.d_image(), view.pixels.len()).unwrap(), splatter.read_image(gpu).unwrap().rgba]
}

/// Display values padded with grey to the smallest side.
fn padded(size: [u32; 2], pixel: impl Fn(usize) -> [f32; 3]) -> Vec<[f32; 3]> {
    let [width, height] = size.map(|side| side.max(SMALLEST_SIDE));
    let places = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    let value = |(x, y)| if x < size[0] && y < size[1] { pixel((y * size[0] + x) as usize) } else { [0.5; 3] };
    places.map(value).collect()
}

#[test]
fn the_gradient_of_lpips_is_added_to_that_of_the_other_terms() {
    let gpu = gpu();
    let folder = tempfile::tempdir().unwrap();
    let capture = small_capture(&gpu, &folder.path().join("capture"));
    let views = TrainViews::new(&capture, capture.split("train").unwrap(), 16).unwrap();
    let lpips = Arc::new(Lpips::built_in().unwrap());
    let whole = views.get(0, 1).unwrap();
    // The second is smaller than AlexNet can process; the third has a mean over twice as many values.
    let small = whole.reduced(6);
    assert!(small.size[0] < SMALLEST_SIDE);
    for (view, value_count) in [(&whole, 30_000.0), (&small, 900.0), (&whole, 60_000.0)] {
        let mut view = TrainView { frame: 0, ..view.clone() };
        // All of it is hand: there is no outline, which would be left out.
        view.pixels.iter_mut().for_each(|[.., mask]| *mask = 255);
        let [without, image] = first_step(&gpu, &capture, &view, value_count, None);
        let [with, same] = first_step(&gpu, &capture, &view, value_count, Some(&lpips));
        assert!(image == same);
        let size = view.size.map(|side| side.max(SMALLEST_SIDE));
        let picture = padded(view.size, |k| [image[k][0], image[k][1], image[k][2]]);
        let truth = padded(view.size, |k| [0, 1, 2].map(|c| f32::from(view.pixels[k][c]) / 255.0));
        let pair = Pair { size, picture: &picture, truth: &truth };
        let (_, gradient) = lpips.distance_and_gradient(&pair).unwrap();
        // As for the other terms, a pixel's weight is one over `value_count`, whatever the size of the crop.
        let scale = (0.2 * 3.0 * picture.len() as f64 / value_count) as f32;
        let mut moved = 0;
        for (k, (with, without)) in with.iter().zip(&without).enumerate() {
            let [x, y] = [k as u32 % view.size[0], k as u32 / view.size[0]];
            let added = gradient[(y * size[0] + x) as usize];
            let [r, g, b] = [0, 1, 2].map(|c| without[c] + scale * added[c]);
            assert_eq!(*with, [r, g, b, without[3]], "pixel {x}, {y}");
            moved += usize::from(with != without);
        }
        assert!(moved > view.pixels.len() / 2, "LPIPS moved {moved} pixels");
    }
}

#[test]
fn a_run_with_lpips_is_repeatable_and_a_weight_of_zero_is_a_run_without() {
    if !long() {
        return;
    }
    let gpu = gpu();
    let folder = tempfile::tempdir().unwrap();
    let capture = small_capture(&gpu, &folder.path().join("capture"));
    let bytes = |with_lpips: bool, lpips_weight: f64| {
        let settings = TrainSettings { lpips_weight, ..settings() };
        let lpips = with_lpips.then(|| Arc::new(Lpips::built_in().unwrap()));
        let trainer = Trainer::new(&gpu, &capture, "train", &settings).unwrap().with_lpips(lpips);
        let path = folder.path().join("avatar.ghand");
        trainer.train(|_| ()).unwrap().avatar.save(&path).unwrap();
        std::fs::read(path).unwrap()
    };
    let without = bytes(false, 0.2);
    assert!(bytes(true, 0.0) == without);
    let with = bytes(true, 0.2);
    assert!(with != without, "LPIPS has no effect");
    assert!(with == bytes(true, 0.2), "two runs with one seed differ");
}

//! Coarse Gaussians where no image looks.

use crate::common::{make, small_options};
use ghand_avatar::Avatar;
use ghand_capture::Capture;
use ghand_hand_model::surface::sample_surface;
use ghand_hand_model::surface::smooth::smoothed;
use ghand_render::{AdapterChoice, Gpu};
use ghand_synthetic::SyntheticOptions;
use ghand_train::{Align, LightChoice, Model, TrainSettings, Trained, Trainer};

const RESOLUTION: u32 = 64;

/// A capture whose training images are all from one camera.
fn seen_from_one_side() -> (Capture, tempfile::TempDir) {
    let (mut capture, folder) = make(&SyntheticOptions { views: 3, train_frames: 4, ..small_options(9) });
    let split = capture.splits.get_mut("train").unwrap();
    let camera = split.views[0].camera;
    split.views.retain(|view| view.camera == camera);
    (capture, folder)
}

fn train(gpu: &Gpu, capture: &Capture, merge_below: f64) -> Trained {
    let settings = TrainSettings {
        merge_below,
        iterations: 60,
        uv_resolution: RESOLUTION,
        align: Align::Off,
        light: LightChoice::Off,
        ..TrainSettings::default()
    };
    Trainer::new(gpu, capture, "train", &settings).unwrap().train(|_| ()).unwrap()
}

#[test]
fn what_no_image_shows_gets_few_gaussians_and_the_rest_stays_as_fine() {
    let gpu = Gpu::new(&AdapterChoice::from_env()).unwrap_or_else(|e| panic!("{e}"));
    let (capture, folder) = seen_from_one_side();
    let fine = smoothed(&capture.template);
    let samples = sample_surface(&capture.template, RESOLUTION).unwrap().on_smoothed(&capture.template, &fine);
    let [whole, merged] = [0.0, 0.01].map(|pixels| train(&gpu, &capture, pixels).avatar);
    let (n, m) = (samples.len(), merged.template.len());
    assert_eq!(whole.template.len(), n);
    // Half of the hand is hidden, three quarters of whose Gaussians go, but for the blocks at its border.
    println!("{m} Gaussians instead of {n}");
    assert!((0.45..0.85).contains(&(m as f64 / n as f64)), "{m} of {n}");
    // What is coarse fills hardly any pixels.
    let seen = merged.seen.as_ref().unwrap();
    let place = |p: usize| [0, 1, 2].map(|c| merged.template.rest[c * m + p]);
    let is_coarse = |p: usize| {
        let texel = samples.positions.iter().position(|at| at.as_vec3().to_array() == place(p)).unwrap();
        f64::from(merged.template.spacings[p]) > 1.1 * samples.spacings[texel]
    };
    let (coarse, fine): (Vec<usize>, Vec<usize>) = (0..m).partition(|p| is_coarse(*p));
    let filled = |points: &[usize]| {
        let area: f32 = points.iter().map(|p| merged.template.spacings[*p].powi(2)).sum();
        points.iter().map(|p| seen[*p]).sum::<f32>() / area
    };
    let [coarse, fine] = [coarse, fine].map(|points| filled(&points));
    println!("pixels per square metre: {fine} of fine ones, {coarse} of coarse ones");
    assert!(fine > 5.0 * coarse);
    // The file keeps them.
    let path = folder.path().join("avatar.ghand");
    merged.save(&path).unwrap();
    let read = Avatar::load(&path).unwrap();
    assert!((&read.template, &read.tables) == (&merged.template, &merged.tables));
}

#[test]
fn networks_need_all_texels() {
    let settings = TrainSettings { merge_below: 1.0, model: Model::Network, ..TrainSettings::default() };
    let message = settings.check().unwrap_err().to_string();
    assert!(message.contains("merge_below") && message.contains("model=network"), "{message}");
}

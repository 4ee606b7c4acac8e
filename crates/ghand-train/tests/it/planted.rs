//! Captures whose truth is known down to each Gaussian: the parts of the method recover what they are for, and nothing
//! that is not there.

use crate::planted_truth::plant;
use ghand_avatar::properties::PropertyTables;
use ghand_avatar::{Avatar, AvatarConfig, DirectTables};
use ghand_capture::Capture;
use ghand_core::Pose;
use ghand_core::pose_response::{PoseResponse, UNLIMITED, pose_features};
use ghand_hand_model::surface::sample_surface;
use ghand_hand_model::surface::smooth::smoothed;
use ghand_measure::baseline::Baseline;
use ghand_measure::evaluation::evaluate;
use ghand_render::{AdapterChoice, Gpu};
use ghand_synthetic::SyntheticOptions;
use ghand_synthetic::make_capture::make_capture;
use ghand_test_support::long;
use ghand_train::settings::Components;
use ghand_train::{Align, ExposureChoice, LightChoice, TrainSettings, Trained, Trainer};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const RESOLUTION: u32 = 64;
/// Where Gaussians start in training, so that the truth is the start but for what is planted.
const INSET: f64 = 1.0;

/// A capture of an avatar that starts as the template's plain surface with a colour for each Gaussian, and that `change`
/// makes the truth.
struct Planted {
    gpu: Gpu,
    _folder: tempfile::TempDir,
    capture: Capture,
    truth: Avatar,
}

fn tables(avatar: &mut Avatar) -> &mut DirectTables {
    match &mut avatar.tables {
        PropertyTables::Direct(tables) => tables,
        _ => unreachable!(),
    }
}

fn config() -> AvatarConfig {
    AvatarConfig { uv_resolution: RESOLUTION, color_components: 0, ..settings(Components::Full).avatar() }
}

fn settings(components: Components) -> TrainSettings {
    TrainSettings {
        iterations: 500,
        uv_resolution: RESOLUTION,
        color_components: 0,
        align: Align::Off,
        light: LightChoice::Off,
        lpips_weight: 0.0,
        exposure: ExposureChoice::Off,
        color_roughness: 0.0,
        rate_joints: 0.0,
        components,
        ..TrainSettings::default()
    }
}

fn planted(change: impl FnOnce(&mut Avatar)) -> Planted {
    let gpu = Gpu::new(&AdapterChoice::from_env()).unwrap_or_else(|e| panic!("{e}"));
    let folder = tempfile::tempdir().unwrap();
    let options = SyntheticOptions {
        views: 6,
        train_frames: 10,
        test_frames: 4,
        test_views: 3,
        width: 112,
        height: 168,
        pose_noise_degrees: 0.0,
        translation_noise: 0.0,
        pose_bias_degrees: 0.0,
        ..SyntheticOptions::default()
    };
    make_capture(&gpu, &options, folder.path()).unwrap();
    let mut capture = Capture::open(folder.path()).unwrap();
    let truth = capture.truth.clone().unwrap();
    for (frame, pose) in capture.frames.iter_mut().zip(truth) {
        frame.pose = pose.unwrap();
    }
    let template = &capture.template;
    let fine = smoothed(template);
    let samples = sample_surface(template, config().uv_resolution).unwrap().on_smoothed(template, &fine);
    let mut avatar = Avatar::untrained_at(&fine, &samples, &config(), [0.5; 3], INSET, 1).unwrap();
    avatar.model = template.without_blend_shapes();
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    let colors: Vec<[f64; 3]> =
        (0..avatar.template.len()).map(|_| [0.75, 0.55, 0.45].map(|mean| mean + rng.random_range(-0.2..0.2))).collect();
    avatar.tables.set_base_colors(&colors);
    change(&mut avatar);
    plant(&gpu, &capture, &avatar).unwrap();
    Planted { gpu, _folder: folder, capture, truth: avatar }
}

impl Planted {
    /// An avatar with these parts, and its PSNR on the hand in poses that it has not seen.
    fn train(&self, settings: &TrainSettings) -> (Trained, f64) {
        let trained = Trainer::new(&self.gpu, &self.capture, "train", settings).unwrap().train(|_| ()).unwrap();
        let split = self.capture.split("train").unwrap();
        let baseline = Baseline::new(&self.gpu, &self.capture, split, &trained.poses, 40).unwrap();
        let result = evaluate(&self.gpu, &trained.avatar, &self.capture, "test", &baseline, |_| ()).unwrap();
        (trained, result.avatar.psnr_hand)
    }

    /// The Gaussians that training saw well.
    fn seen(&self, trained: &Trained) -> Vec<usize> {
        let seen = trained.avatar.seen.as_ref().unwrap();
        let mut sorted = seen.clone();
        sorted.sort_by(f32::total_cmp);
        let median = sorted[sorted.len() / 2];
        (0..seen.len()).filter(|p| seen[*p] > 0.5 * median).collect()
    }
}

/// Root mean square.
fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0), |(sum, count), value| (sum + value * value, count + 1));
    (sum / f64::from(count.max(1))).sqrt()
}

/// Residual weights less their mean over the joints, of one Gaussian.
fn effective_weights(avatar: &Avatar, p: usize) -> Vec<f64> {
    let PropertyTables::Direct(tables) = &avatar.tables else { unreachable!() };
    let n = avatar.template.len();
    let joints = avatar.template.joint_count();
    let values: Vec<f64> = (0..joints).map(|k| f64::from(tables.residual_weights[k * n + p])).collect();
    let mean = values.iter().sum::<f64>() / joints as f64;
    values.iter().map(|value| value - mean).collect()
}

/// The offset of each Gaussian in a pose, metres.
fn offsets(avatar: &Avatar, pose: &Pose) -> Vec<[f64; 3]> {
    let PropertyTables::Direct(tables) = &avatar.tables else { unreachable!() };
    let n = avatar.template.len();
    let channels = avatar.config.channels();
    let wide = |values: &[f32]| values.iter().map(|value| f64::from(*value)).collect::<Vec<_>>();
    let (bias, gain) = tables.response.split_at(channels);
    let limits = vec![UNLIMITED; channels * avatar.template.joint_count()];
    let response = PoseResponse { bias: wide(bias), gain: wide(gain), limits };
    let coefficients = response.evaluate(&wide(&avatar.template.weights), &pose_features(pose), n);
    let offset = |p: usize, c: usize| -> f64 {
        let one = |i: usize| coefficients[i * n + p] * f64::from(tables.shape_basis[(3 * i + c) * n + p]);
        (0..avatar.config.shape_bases).map(one).sum()
    };
    (0..n).map(|p| [0, 1, 2].map(|c| offset(p, c))).collect()
}

#[test]
fn where_plain_skinning_is_the_truth_the_residual_skeleton_gains_nothing() {
    if !long() {
        return;
    }
    let planted = planted(|_| ());
    let (_, hgbs) = planted.train(&settings(Components::Hgbs));
    let (full, with) = planted.train(&settings(Components::Full));
    let residual = rms(planted.seen(&full).into_iter().flat_map(|p| effective_weights(&full.avatar, p)));
    println!("plain skinning: hgbs {hgbs:.2} dB, full {with:.2} dB; residual weights of {residual:.4}");
    // Measured: 42.99 and 41.59 dB, 0.0054.
    assert!((hgbs - 2.0..hgbs + 0.3).contains(&with), "hgbs {hgbs} dB, full {with} dB");
    assert!(residual < 0.007, "residual weights of {residual}");
}

#[test]
fn where_the_surface_deforms_linearly_with_the_pose_the_bases_recover_it() {
    if !long() {
        return;
    }
    let planted = planted(|avatar| {
        let n = avatar.template.len();
        let joints = avatar.template.joint_count();
        let channels = avatar.config.channels();
        let normals = avatar.template.normals.clone().unwrap();
        let tables = tables(avatar);
        // One basis along the normal, which swells as joints bend.
        for p in 0..n {
            for c in 0..3 {
                tables.shape_basis[(3 + c) * n + p] = 0.004 * normals[c * n + p];
            }
        }
        for joint in 1..joints {
            // The trace of R - I, which is 0 at rest and falls with the angle.
            for diagonal in [0, 4, 8] {
                tables.response[channels + (joints + joint) * 9 + diagonal] = -1.0;
            }
        }
    });
    let (base, baseline) = planted.train(&settings(Components::Baseline));
    let (bases, hgbs) = planted.train(&settings(Components::Hgbs));
    let mean = |avatar: &Avatar, frames: &[usize]| -> Vec<Vec<[f64; 3]>> {
        frames.iter().map(|frame| offsets(avatar, &planted.capture.frames[*frame].pose)).collect()
    };
    // What changes with the pose.
    let error = |trained: &Trained, split: &str| {
        let frames = &planted.capture.split(split).unwrap().frames;
        let truth = mean(&planted.truth, frames);
        let found = mean(&trained.avatar, frames);
        let seen = planted.seen(trained);
        let centred = |of: &[Vec<[f64; 3]>], f: usize, p: usize, c: usize| {
            of[f][p][c] - of.iter().map(|frame| frame[p][c]).sum::<f64>() / of.len() as f64
        };
        let each = || (0..frames.len()).flat_map(|f| seen.iter().flat_map(move |p| (0..3).map(move |c| (f, *p, c))));
        let size = rms(each().map(|(f, p, c)| centred(&truth, f, p, c)));
        (rms(each().map(|(f, p, c)| centred(&truth, f, p, c) - centred(&found, f, p, c))), size)
    };
    let [of_baseline, _] = error(&base, "test").into();
    let [of_bases, size] = error(&bases, "test").into();
    println!(
        "linear deformation: baseline {baseline:.2} dB, hgbs {hgbs:.2} dB; offsets in new poses off by {:.2} and {:.2} mm of {:.2}",
        1e3 * of_baseline,
        1e3 * of_bases,
        1e3 * size
    );
    // Measured: 0.46.
    assert!(of_bases < 0.55 * size, "offsets off by {of_bases} m of {size} m");
}

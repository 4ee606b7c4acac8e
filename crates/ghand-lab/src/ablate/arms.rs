//! The ablation: which part of the method brings what, with intervals.
//!
//! Each arm is trained several times, with other seeds, and compared with the images of a split. Intervals are
//! bootstrapped over the split's poses: other poses are what an avatar is for.

use ghand_core::residual_skeleton::ResidualSkeleton;
use ghand_core::skinning::ResidualWeights;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use ghand_train::settings::{Components, Model, TrainSettings};

/// What is trained.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Arm {
    /// Its name.
    pub name: &'static str,
    /// What it is, for people.
    pub description: &'static str,
    /// The property model.
    pub model: Model,
    /// The parts of the method.
    pub components: Components,
    /// Whether residual weights sum to zero and the residual skeleton starts at the rest joints, instead of the paper's form.
    pub corrected: bool,
    /// The arm that lacks only what this one adds.
    pub against: Option<&'static str>,
}

const fn arm(
    name: &'static str,
    description: &'static str,
    model: Model,
    (components, corrected): (Components, bool),
    against: Option<&'static str>,
) -> Arm {
    Arm { name, description, model, components, corrected, against }
}

/// All arms.
pub const ARMS: [Arm; 8] = [
    arm(
        "network-baseline",
        "an offset for each Gaussian from the pose",
        Model::Network,
        (Components::Baseline, true),
        None,
    ),
    arm("network-hgbs", "+ blend shapes", Model::Network, (Components::Hgbs, true), Some("network-baseline")),
    arm(
        "network-full-paper",
        "+ residual skeleton, as in the paper",
        Model::Network,
        (Components::Full, false),
        Some("network-hgbs"),
    ),
    arm(
        "network-full",
        "+ residual skeleton, anchored, zero sum",
        Model::Network,
        (Components::Full, true),
        Some("network-hgbs"),
    ),
    arm(
        "direct-baseline",
        "an offset for each Gaussian from the pose",
        Model::Direct,
        (Components::Baseline, true),
        None,
    ),
    arm("direct-hgbs", "+ blend shapes", Model::Direct, (Components::Hgbs, true), Some("direct-baseline")),
    arm(
        "direct-full-paper",
        "+ residual skeleton, as in the paper",
        Model::Direct,
        (Components::Full, false),
        Some("direct-hgbs"),
    ),
    arm(
        "direct-full",
        "+ residual skeleton, anchored, zero sum",
        Model::Direct,
        (Components::Full, true),
        Some("direct-hgbs"),
    ),
];

impl Arm {
    /// The settings of this arm: those of `base` but for what the arm is about.
    pub fn settings(&self, base: &TrainSettings) -> TrainSettings {
        let (residual_weights, residual_skeleton) = match self.corrected {
            true => (ResidualWeights::ZeroSum, ResidualSkeleton::Anchored),
            false => (ResidualWeights::Paper, ResidualSkeleton::Paper),
        };
        let images_per_step = if self.model == Model::Network { base.images_per_step } else { 1 };
        let Arm { model, components, .. } = *self;
        TrainSettings { model, components, residual_weights, residual_skeleton, images_per_step, ..base.clone() }
    }
}

/// The figures of one image.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ImageFigures {
    /// Id of the frame.
    pub frame: String,
    /// Id of the camera.
    pub camera: String,
    /// PSNR, dB.
    pub psnr: f64,
    /// PSNR over the mask, dB.
    pub psnr_hand: f64,
    /// SSIM.
    pub ssim: f64,
}

/// One training of an arm.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ArmRun {
    /// Name of the arm.
    pub arm: String,
    /// The seed.
    pub seed: u64,
    /// Iterations done.
    pub iterations: u64,
    /// Wall-clock time of training, seconds.
    pub seconds: f64,
    /// The images of the split.
    pub images: Vec<ImageFigures>,
}

/// A mean with its 95 % interval.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Interval {
    /// The mean over poses.
    pub mean: f64,
    /// 2.5th percentile.
    pub low: f64,
    /// 97.5th percentile.
    pub high: f64,
}

/// The figures of an arm.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ArmFigures {
    /// Name of the arm.
    pub arm: String,
    /// What it is, for people.
    pub description: String,
    /// Number of trainings.
    pub seeds: usize,
    /// Mean number of iterations.
    pub iterations: f64,
    /// Mean wall-clock time of training, seconds.
    pub seconds: f64,
    /// PSNR, dB.
    pub psnr: Interval,
    /// PSNR over the masks, dB.
    pub psnr_hand: Interval,
    /// SSIM.
    pub ssim: Interval,
    /// The arm that lacks only what this one adds.
    pub against: Option<String>,
    /// How much larger the PSNR over the masks is than that arm's, dB, pose by pose.
    pub gain: Option<Interval>,
    /// Standard deviation of the mean PSNR over the masks between seeds, dB; absent with one seed.
    pub seed_deviation: Option<f64>,
}

/// Resamples of the poses.
const RESAMPLES: usize = 4000;

/// The figures of all arms that were run, in the order of [`ARMS`].
pub fn figures(runs: &[ArmRun]) -> Vec<ArmFigures> {
    let of = |name: &str| runs.iter().filter(|run| run.arm == name).collect::<Vec<_>>();
    let one = |arm: &Arm| {
        let runs = of(arm.name);
        let count = runs.len();
        let mean = |value: &dyn Fn(&ArmRun) -> f64| runs.iter().map(|run| value(run)).sum::<f64>() / count as f64;
        let interval = |value: fn(&ImageFigures) -> f64| bootstrap(&by_frame(&runs, value));
        let against = arm.against.filter(|name| !of(name).is_empty());
        let hand = |image: &ImageFigures| image.psnr_hand;
        let gain = against.map(|name| {
            let these = by_frame(&runs, hand);
            let those = by_frame(&of(name), hand);
            bootstrap(&these.iter().zip(&those).map(|(a, b)| a - b).collect::<Vec<_>>())
        });
        let means: Vec<f64> = runs.iter().map(|run| average(&by_frame(&[run], hand))).collect();
        let squares = means.iter().map(|value| (value - average(&means)).powi(2)).sum::<f64>();
        (count > 0).then(|| ArmFigures {
            arm: arm.name.into(),
            description: arm.description.into(),
            seeds: count,
            iterations: mean(&|run| run.iterations as f64),
            seconds: mean(&|run| run.seconds),
            psnr: interval(|image| image.psnr),
            psnr_hand: interval(hand),
            ssim: interval(|image| image.ssim),
            against: against.map(str::to_owned),
            gain,
            seed_deviation: (count > 1).then(|| (squares / (count - 1) as f64).sqrt()),
        })
    };
    ARMS.iter().filter_map(one).collect()
}

fn average(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

/// The mean over the runs and the images of each frame, in the order of the frames' ids.
fn by_frame(runs: &[&ArmRun], value: fn(&ImageFigures) -> f64) -> Vec<f64> {
    let mut frames = std::collections::BTreeMap::<&str, Vec<f64>>::new();
    for image in runs.iter().flat_map(|run| &run.images) {
        frames.entry(&image.frame).or_default().push(value(image));
    }
    frames.values().map(|values| average(values)).collect()
}

/// The mean of values with its interval, by drawing as many of them again and again.
fn bootstrap(values: &[f64]) -> Interval {
    let mut rng = ChaCha8Rng::seed_from_u64(values.len() as u64);
    let mut resample = || (0..values.len()).map(|_| values[rng.random_range(0..values.len())]).sum::<f64>();
    let mut means: Vec<f64> = match values {
        [] => vec![],
        _ => (0..RESAMPLES).map(|_| resample() / values.len() as f64).collect(),
    };
    means.sort_by(f64::total_cmp);
    let at = |part: f64| means.get((part * RESAMPLES as f64) as usize).copied().unwrap_or(f64::NAN);
    Interval { mean: average(values), low: at(0.025), high: at(0.975) }
}

/// A table in Markdown.
pub fn table(figures: &[ArmFigures]) -> String {
    let mut text = String::from(
        "| arm | PSNR on the hand, dB | gain over | PSNR, dB | SSIM | iterations | seconds |\n\
         |---|---|---|---|---|---|---|\n",
    );
    for arm in figures {
        let ArmFigures { psnr, psnr_hand, ssim, .. } = arm;
        let gain = match (&arm.against, &arm.gain) {
            (Some(name), Some(gain)) => {
                format!("{:+.2} ({:+.2} to {:+.2}) `{name}`", gain.mean, gain.low, gain.high)
            }
            _ => String::new(),
        };
        text += &format!(
            "| `{}`: {} | {:.2} ({:.2} to {:.2}) | {gain} | {:.2} ({:.2} to {:.2}) | {:.4} | {:.0} | {:.0} |\n",
            arm.arm,
            arm.description,
            psnr_hand.mean,
            psnr_hand.low,
            psnr_hand.high,
            psnr.mean,
            psnr.low,
            psnr.high,
            ssim.mean,
            arm.iterations,
            arm.seconds
        );
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(arm: &str, seed: u64, psnr_hand: &[f64]) -> ArmRun {
        let images = psnr_hand.iter().enumerate().map(|(k, value)| ImageFigures {
            frame: format!("{}", k / 2),
            camera: format!("{}", k % 2),
            psnr: value + 5.0,
            psnr_hand: *value,
            ssim: 0.9,
        });
        ArmRun { arm: arm.into(), seed, iterations: 10, seconds: 2.0, images: images.collect() }
    }

    #[test]
    fn gains_are_paired_by_pose() {
        // Poses differ by far more than arms: only pairs show the gain.
        let poses = [20.0, 21.0, 30.0, 30.0, 25.0, 25.0, 15.0, 16.0];
        let more = poses.map(|value| value + 0.5);
        let runs = [run("direct-hgbs", 1, &poses), run("direct-full", 1, &more), run("direct-full", 2, &more)];
        let figures = figures(&runs);
        assert_eq!(figures.iter().map(|f| f.arm.as_str()).collect::<Vec<_>>(), ["direct-hgbs", "direct-full"]);
        let full = &figures[1];
        let gain = full.gain.unwrap();
        assert!([gain.mean, gain.low, gain.high].iter().all(|value| (value - 0.5).abs() < 1e-12), "{gain:?}");
        assert!(full.psnr_hand.high - full.psnr_hand.low > 4.0);
        assert_eq!((full.seeds, full.seed_deviation), (2, Some(0.0)));
        // The baseline was not run.
        assert_eq!((figures[0].against.as_ref(), figures[0].seed_deviation), (None, None));
        assert!(table(&figures).contains("| `direct-full`: + residual skeleton, anchored, zero sum | 23.25 ("));
    }

    #[test]
    fn intervals_hold_the_mean_of_other_draws_as_often_as_they_say() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let held = (0..200).filter(|_| {
            let values: Vec<f64> = (0..40).map(|_| rng.random_range(-1.0..1.0)).collect();
            let interval = bootstrap(&values);
            interval.low <= 0.0 && 0.0 <= interval.high
        });
        let held = held.count();
        assert!((178..=198).contains(&held), "{held} of 200");
    }

    #[test]
    fn every_arm_has_valid_settings_and_a_known_reference() {
        for arm in ARMS {
            arm.settings(&TrainSettings::default()).check().unwrap();
            assert!(arm.against.is_none_or(|name| ARMS.iter().any(|other| other.name == name)));
        }
    }
}

//! The figures of a run: on images that training did not see, and on poses with known truth.

use ghand_capture::{Capture, Split};
use ghand_render::Gpu;
use ghand_train::evaluate::{EvaluatedView, FloorMetrics, ImageMetrics, Metrics, PoseError, evaluate};
use ghand_train::floor::Floor;
use ghand_train::metrics::{moving_joints, pose_error_degrees};
use ghand_train::{TrainSettings, Trained};

use crate::say;

/// Number of views of the test split in the report.
const REPORT_VIEWS: usize = 5;
/// Number of views that the floor's colours are averaged over.
const FLOOR_VIEWS: usize = 200;

/// The figures on a split that has images, and some of them for the report.
///
/// # Errors
/// An error that names the unusable image, or the device if it failed.
pub fn evaluate_images(
    gpu: &Gpu,
    capture: &Capture,
    train: &Split,
    trained: &Trained,
    split: &str,
) -> anyhow::Result<(ImageMetrics, Vec<EvaluatedView>)> {
    let test = capture.split(split)?;
    let total = test.views.len();
    let floor = Floor::new(gpu, capture, train, &trained.poses, FLOOR_VIEWS)?;
    let mut shown: Vec<EvaluatedView> = Vec::new();
    let mut index = 0;
    let evaluation = evaluate(gpu, &trained.avatar, capture, split, &floor, |view| {
        // Evenly over the frames, a different camera each time.
        let rows = REPORT_VIEWS.min(total);
        if shown.len() < rows && index >= shown.len() * total / rows + shown.len() % test.cameras.len().max(1) {
            shown.push(view);
        }
        index += 1;
    })?;
    let (avatar, floor) = (evaluation.avatar, evaluation.floor);
    let metrics = ImageMetrics {
        split: split.into(),
        frames: evaluation.views,
        psnr: avatar.psnr,
        psnr_hand: avatar.psnr_hand,
        ssim: avatar.ssim,
        floor: FloorMetrics { psnr: floor.psnr, psnr_hand: floor.psnr_hand, ssim: floor.ssim },
        beats_floor: avatar.psnr > floor.psnr,
    };
    Ok((metrics, shown))
}

/// Joint-angle errors of the capture's and the refined training poses, if the truth of all of them is known.
pub fn pose_error(capture: &Capture, frames: &[usize], trained: &Trained) -> Option<PoseError> {
    let truth = capture.truth.as_ref()?;
    let truth: Option<Vec<_>> = frames.iter().map(|f| truth.get(*f)?.clone()).collect();
    let truth = truth?;
    let given: Vec<_> = frames.iter().map(|f| capture.frames[*f].pose.clone()).collect();
    let counts = moving_joints(&given);
    Some(PoseError {
        before: pose_error_degrees(&given, &truth, &counts),
        after: pose_error_degrees(&trained.poses, &truth, &counts),
    })
}

/// Prints the figures.
pub fn print_table(m: &Metrics) {
    if let Some(m) = &m.images {
        say!("\n{} images of split `{}` (new poses, new views)", m.frames, m.split);
        say!("            PSNR   PSNR on the hand   SSIM");
        say!("  floor    {:6.2}      {:6.2}         {:.4}", m.floor.psnr, m.floor.psnr_hand, m.floor.ssim);
        say!("  avatar   {:6.2}      {:6.2}         {:.4}", m.psnr, m.psnr_hand, m.ssim);
        say!(
            "  gain     {:+6.2}      {:+6.2}         {:+.4}",
            m.psnr - m.floor.psnr,
            m.psnr_hand - m.floor.psnr_hand,
            m.ssim - m.floor.ssim
        );
    }
    if let Some(e) = m.pose_error_deg {
        say!("pose error: {:.2} degrees given, {:.2} refined", e.before, e.after);
    }
    say!("{} Gaussians, {} iterations in {:.0} s\n", m.gaussians, m.iterations, m.seconds);
}

/// A message that the avatar does not beat its floor, with likely reasons; `None` if it does, or without figures on
/// images.
pub fn failure(metrics: &Metrics, settings: &TrainSettings) -> Option<String> {
    let images = metrics.images.as_ref().filter(|images| !images.beats_floor)?;
    let default = TrainSettings::default().iterations;
    let few = if metrics.iterations < default {
        format!("too few iterations ({}, the default is {default}), ", metrics.iterations)
    } else {
        String::new()
    };
    let plain = TrainSettings { seed: settings.seed, iterations: settings.iterations, ..Default::default() };
    let changed = if *settings == plain { "" } else { ", or settings that do not suit the capture" };
    Some(format!(
        "the training has failed: the avatar's PSNR of {:.2} dB is not above the {:.2} dB of its floor, the textured \
         template; likely reasons are {few}poses, cameras or masks that do not match the images (`ghand inspect` \
         shows that), too few images for the hand's motion{changed}",
        images.psnr, images.floor.psnr
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn metrics(psnr: f64, floor: f64, iterations: u64) -> Metrics {
        let floor_metrics = FloorMetrics { psnr: floor, psnr_hand: 0.0, ssim: 0.0 };
        let images = ImageMetrics {
            split: "test".into(),
            frames: 1,
            psnr,
            psnr_hand: 0.0,
            ssim: 0.0,
            floor: floor_metrics,
            beats_floor: psnr > floor,
        };
        Metrics {
            images: Some(images),
            pose_error_deg: None,
            seconds: 1.0,
            iterations,
            stopped_early: false,
            gaussians: 1,
        }
    }

    #[test]
    fn an_avatar_at_or_below_its_floor_is_a_failure() {
        let settings = TrainSettings::default();
        assert_eq!(failure(&metrics(20.1, 20.0, 9), &settings), None);
        assert_eq!(failure(&Metrics { images: None, ..metrics(0.0, 1.0, 9) }, &settings), None);
        for psnr in [20.0, 9.7, f64::NAN] {
            let text = failure(&metrics(psnr, 20.0, 9), &settings).unwrap();
            assert!(
                text.contains("too few iterations (9, the default is 2000)") && text.contains("20.00 dB"),
                "{text}"
            );
            assert!(text.contains("ghand inspect") && !text.contains("settings") && !text.contains('\n'), "{text}");
        }
        let other = TrainSettings { rate_color: 1.0, ..settings };
        let text = failure(&metrics(9.7, 20.0, 99_999), &other).unwrap();
        assert!(text.contains("settings that do not suit") && !text.contains("too few iterations"), "{text}");
    }
}

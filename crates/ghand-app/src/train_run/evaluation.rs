//! The figures of a run: on images that training did not see, and on poses with known truth.

use std::collections::HashSet;
use std::ops::ControlFlow;

use super::interruption::Interruption;
use super::metrics::{JointAngleErrors, Metrics};
use ghand_avatar::Avatar;
use ghand_capture::{Capture, Split};
use ghand_core::Pose;
use ghand_core::pose_error::{moving_joints, pose_error_degrees};
use ghand_fit::alignment::results::figures::AlignmentFigures;
use ghand_fit::exposure::ExposureFit;
use ghand_fit::light_fit::{LightFigures, LightReport};
use ghand_measure::baseline::Baseline;
use ghand_measure::evaluation::{EvaluatedView, ImageMetrics, SimilarityMetrics, TestViews, evaluate_views};
use ghand_measure::lpips::Lpips;
use ghand_measure::protocol::PosedView;
use ghand_measure::protocol::Protocol;
use ghand_render::Gpu;
use ghand_train::{TrainSettings, Trained};

use crate::say;

/// Number of views of the test split in the report.
const REPORT_VIEWS: usize = 5;
/// Number of views that the baseline's colours are averaged over.
const BASELINE_VIEWS: usize = 200;

/// What an avatar is compared with.
#[derive(Debug, Clone)]
pub struct TestImages<'a> {
    /// Where the images are.
    pub capture: &'a Capture,
    /// Name of their split.
    pub split: &'a str,
    /// How their poses were chosen.
    pub protocol: Protocol,
    /// The images with their poses.
    pub views: Vec<PosedView>,
    /// The weights for LPIPS, if there are any.
    pub lpips: Option<&'a Lpips>,
}

/// The figures on images, and some of the images for the report. The baseline's texture is made from the images of
/// `train`, whose frames are in the poses `train_poses`.
///
/// # Errors
/// An error that names the unusable image, or the device if it failed; [`Stopped`](crate::cli::Stopped) if a host wants an
/// end.
pub fn evaluate_images(
    gpu: &Gpu,
    avatar: &Avatar,
    test: &TestImages,
    train: &Split,
    train_poses: &[Pose],
    interruption: &Interruption,
) -> anyhow::Result<(ImageMetrics, Vec<EvaluatedView>)> {
    let total = test.views.len();
    let cameras = test.views.iter().map(|view| view.camera).collect::<HashSet<_>>().len();
    // Poses fitted to masks are poses of the avatar's template, whose proportions are the hand's.
    let of_avatar;
    let baseline_capture = match test.protocol {
        Protocol::Masks => {
            of_avatar = Capture { template: avatar.model.clone(), ..test.capture.clone() };
            &of_avatar
        }
        _ => test.capture,
    };
    let baseline = Baseline::new(gpu, baseline_capture, train, train_poses, BASELINE_VIEWS)?;
    let mut shown: Vec<EvaluatedView> = Vec::new();
    let mut index = 0;
    let &TestImages { capture, protocol, ref views, lpips, .. } = test;
    let compared = TestViews { capture, protocol, views, lpips };
    let evaluation = evaluate_views(gpu, avatar, &compared, &baseline, |view| {
        // Evenly over the frames, a different camera each time.
        let rows = REPORT_VIEWS.min(total);
        if shown.len() < rows && index >= shown.len() * total / rows + shown.len() % cameras.max(1) {
            shown.push(view);
        }
        index += 1;
        if interruption.ends() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    interruption.check()?;
    let evaluation = evaluation?;
    Ok((ImageMetrics::new(test.protocol, test.split, &evaluation), shown))
}

/// The figures of the training poses: those that a run started from, `start`'s, and the refined ones, and how they were
/// aligned. Errors are known if the truth of all of them is.
pub fn pose_figures(
    start: &Capture,
    frames: &[usize],
    trained: &Trained,
) -> (Option<JointAngleErrors>, Option<AlignmentFigures>) {
    let truth: Option<Vec<Pose>> =
        start.truth.as_ref().and_then(|truth| frames.iter().map(|f| truth.get(*f)?.clone()).collect());
    let before: Vec<Pose> = frames.iter().map(|f| start.frames[*f].pose.clone()).collect();
    let counts = moving_joints(&before);
    let error = truth.as_ref().map(|truth| JointAngleErrors {
        before: pose_error_degrees(&before, truth, &counts),
        after: pose_error_degrees(&trained.poses, truth, &counts),
    });
    let alignment = trained.alignment.as_ref();
    (error, alignment.map(|alignment| AlignmentFigures::new(alignment, &before, truth.as_deref())))
}

/// Prints the figures of a run.
pub fn print_table(m: &Metrics) {
    if let Some(images) = &m.images {
        print_image_table(images);
    }
    if let Some(given) = &m.given {
        say!(
            "with {}: {:.2} dB, {} in the square, {:.2} on the hand; floor {:.2}",
            given.protocol.description(),
            given.avatar.psnr,
            decibels(given.avatar.psnr_square),
            given.avatar.psnr_hand,
            given.baseline.psnr
        );
    }
    match m.pose_error_deg {
        Some(e) => {
            say!("training poses: {}; pose error: {:.2} degrees before, {:.2} refined", m.poses, e.before, e.after)
        }
        None => say!("training poses: {}", m.poses),
    }
    if let Some(alignment) = &m.alignment {
        print_alignment(alignment);
    }
    if m.blurred > 0 {
        say!("blurred training images, which were taken less often: {}", m.blurred);
    }
    if let Some(exposure) = &m.exposure {
        print_exposure(exposure);
    }
    if let Some(light) = &m.light {
        print_light(light);
    }
    say!("{} Gaussians, {} iterations in {:.0} s\n", m.gaussians, m.iterations, m.seconds);
}

fn print_alignment(figures: &AlignmentFigures) {
    let AlignmentFigures { given, found, .. } = figures;
    say!(
        "alignment: contours {:.2} pixels off the masks, {:.2} given; overlap {:.3}, {:.3} given; {:.0} s",
        found.contours_median_px,
        given.contours_median_px,
        found.overlap,
        given.overlap,
        figures.seconds
    );
    if figures.texture.is_some_and(|texture| texture.refined_frames + texture.kept_frames == 0) {
        say!("           texture refined nothing: no frame has a usable image and pose");
    } else if let Some(texture) = figures.texture {
        say!(
            "           texture refined {} frames, {} keep their poses; what was held out differs by {:.4}, {:.4} before",
            texture.refined_frames,
            texture.kept_frames,
            texture.held_out_after,
            texture.held_out_before
        );
    }
    if let Some(calibration) = &figures.calibration {
        say!(
            "           cameras refined ({}): held-out images overlap the hand by {:.3}, {:.3} as given",
            calibration.refined.join(", "),
            calibration.left_out_refined,
            calibration.left_out_given
        );
    }
    for odd in &figures.odd_cameras {
        say!("           {odd}");
    }
    for offset in &figures.time_offsets {
        say!("           {offset}");
    }
    if let Some(reason) = &figures.rejection {
        say!("           not used: {reason}");
    }
    if let Some(e) = figures.pose_error_deg {
        say!(
            "           pose error {:.2} degrees given, {:.2} by priors alone, {:.2} by contours alone",
            e.given,
            e.priors_alone,
            e.contours_alone
        );
        say!("           with texture {:.2} degrees, {:.2} without constant offsets", e.aligned, e.gauge_aligned);
        say!(
            "           translations {:.2} mm off given, {:.2} by contours alone, {:.2} with texture",
            e.given_translation_mm,
            e.contours_alone_translation_mm,
            e.aligned_translation_mm
        );
    }
}

fn print_exposure(fit: &ExposureFit) {
    let [without, with] = fit.squared_difference_left_out.map(|value| 1e3 * value);
    let done = if fit.corrected {
        format!("differ by {:.1} %: each camera's colours are corrected", 1e2 * fit.spread)
    } else {
        match fit.unexplained {
            None => "are alike enough: nothing is corrected".into(),
            Some(_) => {
                "differ, but corrected they are explained hardly better by light and gloss: nothing is corrected".into()
            }
        }
    };
    say!("exposures: cameras {done}");
    say!("           squared difference x 1000 between cameras in held-out frames: {without:.2}, {with:.2} corrected");
    if let Some([without, with]) = fit.unexplained.map(|both| both.map(|value| 1e3 * value)) {
        say!("           light and gloss leave {without:.2} of such frames' colours unexplained, {with:.2} corrected");
    }
}

/// From this distance on, metres, light hardly changes over a hand.
const FAR_LAMP: f64 = 5.0;

fn print_light(report: &LightReport) {
    let kind =
        if report.kind.is_some() { "apart from skin, from directions with shadows" } else { "not apart from skin" };
    let LightFigures { none, lamps, transfer, near, interreflection } = report.squared_error_left_out;
    say!("light: {kind}; found in {:.0} s", report.seconds);
    say!(
        "       squared error x 1000 of held-out frames: {:.2} without, {:.2} few lamps in an even sky, {:.2} all directions",
        1e3 * none,
        1e3 * lamps,
        1e3 * transfer
    );
    for lamp in &report.lamps {
        match lamp.distance {
            FAR_LAMP.. => say!("       a lamp too far from the hand to tell where"),
            distance => say!("       a lamp {distance:.2} m from the hand, {:.2} m wide", 2.0 * lamp.radius),
        }
    }
    if let Some(near) = near {
        let kept = if report.lamps.is_empty() { ": not kept" } else { "" };
        say!("       {:.2} with lamps near the hand{kept}", 1e3 * near);
    }
    if let Some(error) = interreflection {
        match report.interreflection {
            [0.0, 0.0, 0.0] => say!("       {:.2} with light that skin throws on skin: not kept", 1e3 * error),
            [r, g, b] => {
                say!("       {:.2} with light that skin throws on skin: {r:.2}, {g:.2}, {b:.2} of it", 1e3 * error)
            }
        }
    }
    if report.trusted < 1.0 {
        say!(
            "       images tell how much light falls on {:.0} % of all normals; on others it is the mean of these",
            1e2 * report.trusted
        );
    }
    if let Some(gloss) = &report.gloss {
        say!(
            "       gloss of roughness {} and mean strength {:.2} leaves {:.0} % of how images of a held-out frame differ",
            gloss.roughness,
            gloss.mean_strength,
            1e2 * gloss.squared_difference_left
        );
    }
    say!("       frames differ in brightness by {:.1} % beyond that", 1e2 * report.frames_differ);
}

/// Prints the figures on images.
pub fn print_image_table(m: &ImageMetrics) {
    say!("\n{} images of split `{}`, protocol `{}`: {}", m.frames, m.split, m.protocol, m.protocol.description());
    let rows = [("floor", &m.baseline), ("avatar", &m.avatar)];
    let heading = m.lpips_backbone.map_or(String::new(), |backbone| format!("      LPIPS ({backbone})"));
    say!("            PSNR   in the hand's square   on the hand   SSIM{heading}");
    for (name, SimilarityMetrics { psnr, psnr_square, psnr_hand, ssim, lpips, .. }) in rows {
        let lpips = lpips.map_or(String::new(), |lpips| format!("    {lpips:.4}"));
        let square = decibels(*psnr_square);
        say!("  {name:<6}  {psnr:6.2}         {square:>6}            {psnr_hand:6.2}      {ssim:.4}{lpips}");
    }
    let squares = m.avatar.psnr_square.zip(m.baseline.psnr_square);
    let square = squares.map_or("-".into(), |(avatar, baseline)| format!("{:+.2}", avatar - baseline));
    let lpips = m.avatar.lpips.zip(m.baseline.lpips).map(|(avatar, baseline)| format!("   {:+.4}", avatar - baseline));
    say!(
        "  gain    {:+6.2}         {square:>6}            {:+6.2}      {:+.4}{}",
        m.avatar.psnr - m.baseline.psnr,
        m.avatar.psnr_hand - m.baseline.psnr_hand,
        m.avatar.ssim - m.baseline.ssim,
        lpips.unwrap_or_default()
    );
    say!("squared error x 1000: outside the mask; inside, to 3 px from its outline; 3 to 8 px; deeper");
    for (name, figures) in rows {
        let e = figures.squared_error;
        let bands = [e.outside, e.inside_to_3_px, e.inside_3_to_8_px, e.inside_over_8_px];
        let [a, b, c, d] = bands.map(|error| error.map_or("-".into(), |error| format!("{:.2}", 1e3 * error)));
        say!("  {name:<6}  {a:>6}  {b:>6}  {c:>6}  {d:>6}");
    }
}

/// A PSNR, or a dash where there is none.
fn decibels(psnr: Option<f64>) -> String {
    psnr.map_or("-".into(), |psnr| format!("{psnr:.2}"))
}

/// A message that the avatar does not beat its baseline, with likely reasons; `None` if it does, or without figures on
/// images.
pub fn failure(metrics: &Metrics, settings: &TrainSettings) -> Option<String> {
    let images = metrics.images.as_ref().filter(|images| !images.beats_baseline)?;
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
        images.avatar.psnr, images.baseline.psnr
    ))
}

#[cfg(test)]
mod tests {
    use ghand_measure::evaluation::Evaluation;
    use ghand_measure::metrics::ImageSimilarity;
    use ghand_train::{Components, Model};

    use super::*;

    fn metrics(psnr: f64, baseline: f64, iterations: u64) -> Metrics {
        let similarity = |psnr: f64| ImageSimilarity { psnr, ..Default::default() };
        let evaluation =
            Evaluation { views: 1, avatar: similarity(psnr), baseline: similarity(baseline), lpips_backbone: None };
        let images = ImageMetrics::new(Protocol::Given, "test", &evaluation);
        Metrics {
            images: Some(images),
            given: None,
            preset: "standard".into(),
            model: Model::Direct,
            components: Components::Full,
            poses: "given".into(),
            pose_error_deg: None,
            alignment: None,
            blurred: 0,
            exposure: None,
            light: None,
            seconds: 1.0,
            iterations,
            stopped_early: false,
            skipped_steps: 0,
            gaussians: 1,
            simplification: None,
        }
    }

    #[test]
    fn an_avatar_at_or_below_its_baseline_is_a_failure() {
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
        let other = TrainSettings { rate_joints: 1.0, ..settings };
        let text = failure(&metrics(9.7, 20.0, 99_999), &other).unwrap();
        assert!(text.contains("settings that do not suit") && !text.contains("too few iterations"), "{text}");
    }
}

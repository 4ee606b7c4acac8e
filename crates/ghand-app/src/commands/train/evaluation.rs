//! What a run of `train` has achieved: its figures and pictures.

use ghand_capture::Capture;
use ghand_fit::alignment::results::picture::alignment_picture;
use ghand_fit::light_fit::LightFit;
use ghand_measure::protocol::Protocol;
use ghand_measure::protocol::given_views;
use ghand_render::Gpu;
use ghand_train::Trained;
use image::RgbImage;

use super::inputs::Inputs;
use super::plan::Plan;
use crate::lpips_weights::for_images;
use crate::train_run::evaluation::{TestImages, evaluate_images, pose_figures};
use crate::train_run::interruption::Interruption;
use crate::train_run::metrics::Metrics;
use crate::train_run::report_picture::report;

/// The figures and pictures of a run.
pub(super) struct Evaluated {
    pub metrics: Metrics,
    /// Images held out beside the avatar, if there are any.
    pub report: Option<RgbImage>,
    /// The template's outlines before and after the alignment, if there was one.
    pub outlines: Option<RgbImage>,
}

/// Compares the avatar with the images of the test split. `refined` is the capture as training left it.
pub(super) fn evaluate(
    gpu: &mut Gpu,
    plan: &Plan,
    inputs: &Inputs,
    trained: &Trained,
    refined: &Capture,
    interruption: &Interruption,
) -> anyhow::Result<Evaluated> {
    let Inputs { capture, start, train_split, lpips, .. } = inputs;
    let test_split = plan.test_split();
    let lpips = for_images(lpips, start, test_split);
    let mut shown = None;
    let mut images = None;
    let mut given = None;
    if let Some(split) = capture.splits.get(test_split).filter(|split| !split.views.is_empty()) {
        let mut cut = refined.clone();
        cut.images.aligned = trained.masks_of.clone();
        let test = |protocol, views| TestImages {
            // Poses that are fitted to masks come with the cameras, their colours and the masks of training.
            capture: if protocol == Protocol::Masks { &cut } else { capture },
            split: test_split,
            protocol,
            views,
            lpips,
        };
        let mut evaluate = |test: &TestImages| {
            gpu.retry_on_device_loss("the evaluation", |gpu| {
                evaluate_images(gpu, &trained.avatar, test, train_split, &trained.poses, interruption)
            })
        };
        let as_given = evaluate(&test(Protocol::Given, given_views(capture, split)))?;
        // Without exact poses, given ones say more about the tracker than about the avatar.
        let (headline, views) = match &trained.held_out {
            Some(held_out) => {
                given = Some(as_given.0);
                evaluate(&test(Protocol::Masks, held_out.clone()))?
            }
            None => as_given,
        };
        shown = Some(report(&views));
        images = Some(headline);
    }
    let (pose_error_deg, alignment) = pose_figures(start, &train_split.frames, trained);
    let metrics = Metrics {
        images,
        given,
        preset: plan.record.preset.clone(),
        model: trained.settings.model,
        components: trained.settings.components,
        poses: inputs.poses.to_string(),
        pose_error_deg,
        alignment,
        blurred: trained.blurred,
        exposure: trained.exposure.clone(),
        light: trained.light.as_ref().map(LightFit::report),
        seconds: trained.seconds,
        iterations: trained.iterations,
        stopped_early: trained.stopped,
        skipped_steps: trained.skipped_steps,
        gaussians: trained.avatar.template.len(),
        simplification: trained.simplification.clone(),
    };
    let alignment = trained.alignment.as_ref();
    let outlines = alignment.map(|alignment| alignment_picture(start, train_split, alignment)).transpose()?;
    Ok(Evaluated { metrics, report: shown, outlines })
}

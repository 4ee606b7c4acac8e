//! The figures of a run, as they stand in `metrics.json`.

use ghand_fit::alignment::results::figures::AlignmentFigures;
use ghand_fit::exposure::ExposureFit;
use ghand_fit::light_fit::LightReport;
use ghand_measure::evaluation::ImageMetrics;
use ghand_train::trainer::simplification::Simplification;
use ghand_train::{Components, Model};
use serde::Serialize;

/// Contents of `metrics.json`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Metrics {
    /// The figures on images; absent if there were no images to evaluate.
    #[serde(flatten)]
    pub images: Option<ImageMetrics>,
    /// The same in the capture's own poses, where `images` has others; `null` otherwise.
    pub given: Option<ImageMetrics>,
    /// The preset that the settings started from.
    pub preset: String,
    /// The property model.
    pub model: Model,
    /// The parts of the method that the avatar has.
    pub components: Components,
    /// The training poses that the run started from: `given`, `truth`, or a file.
    pub poses: String,
    /// Mean joint-angle error of the training poses, degrees, if the true poses are known.
    pub pose_error_deg: Option<JointAngleErrors>,
    /// How the alignment went, with `align=contours`.
    pub alignment: Option<AlignmentFigures>,
    /// Training images that are so blurred that they were taken less than half as often as others.
    pub blurred: usize,
    /// What was found of the cameras' exposures; `null` with `exposure=off`.
    pub exposure: Option<ExposureFit>,
    /// How light was taken apart from skin; `null` with `light=off`.
    pub light: Option<LightReport>,
    /// Wall-clock time of training, seconds.
    pub seconds: f64,
    /// Training iterations done.
    pub iterations: u64,
    /// Whether the run was stopped before all its iterations were done.
    pub stopped_early: bool,
    /// Training steps that changed nothing, since a gradient was not finite.
    pub skipped_steps: u64,
    /// Number of Gaussians.
    pub gaussians: usize,
    /// What `simplify=auto` tried and took; `null` without it.
    pub simplification: Option<Simplification>,
}

/// Joint-angle errors, degrees.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct JointAngleErrors {
    /// Of the poses that the run started from.
    pub before: f64,
    /// Of the refined poses.
    pub after: f64,
}

//! The figures of an alignment in `metrics.json`.

use std::collections::BTreeMap;

use ghand_core::Pose;
use serde::Serialize;

use crate::alignment::pose_offsets::offsets_between;
use crate::alignment::{Alignment, Calibration, MaskFit, OddCamera, TextureRefinement, TimeOffset};
use ghand_core::pose_error::{moving_joints, pose_error_degrees};

/// How well an alignment went.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AlignmentFigures {
    /// Why the given poses were used instead; `null` if they were not.
    pub rejection: Option<String>,
    /// Frames that keep their given poses because these fit the masks better.
    pub kept_frames: usize,
    /// Seconds that it took.
    pub seconds: f64,
    /// How texture refined the poses; `null` if they are the given ones.
    pub texture: Option<TextureFigures>,
    /// What was refined of the cameras' calibration; `null` if it is as given.
    pub calibration: Option<CalibrationFigures>,
    /// Cameras that take their images earlier or later than the others.
    pub time_offsets: Vec<TimeOffset>,
    /// Cameras that do not show the hand that the others show.
    pub odd_cameras: Vec<OddCamera>,
    /// How given poses fit the masks.
    pub given: FitFigures,
    /// How the poses that the alignment found fit the masks.
    pub found: FitFigures,
    /// Mean angle between the poses and the true ones, degrees, over all frames and the joints that move; `null` if the
    /// true poses are unknown.
    pub pose_error_deg: Option<PoseErrors>,
    /// By joint that moves, how far the rotations about each axis are expected to be off, degrees.
    pub uncertainty_deg: BTreeMap<String, f64>,
}

/// How the cameras were refined.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CalibrationFigures {
    /// Names of the parts that were refined.
    pub refined: Vec<String>,
    /// Overlap of the hand with the masks of images that were left out, with the given calibration.
    pub left_out_given: f64,
    /// The same with the refined one.
    pub left_out_refined: f64,
}

/// How a template fits the masks.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct FitFigures {
    /// Median distance of the template's contours from the masks' outlines, pixels; `null` without contours.
    pub contours_median_px: f64,
    /// 95 % of the distances are below this, pixels.
    pub contours_95_px: f64,
    /// Mean intersection over union of silhouettes and masks.
    pub overlap: f64,
}

/// How a refinement by texture went.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct TextureFigures {
    /// Frames that were refined.
    pub refined_frames: usize,
    /// Frames that keep the poses that contours alone gave them.
    pub kept_frames: usize,
    /// Root mean square difference of images held out from what the other images lead to expect, in contrast, with bounded
    /// influence of outliers: in the poses by contours alone.
    pub held_out_before: f64,
    /// The same after the refinement.
    pub held_out_after: f64,
}

/// Errors of poses at several stages.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PoseErrors {
    /// Of the given poses.
    pub given: f64,
    /// Of the likeliest poses by the given ones and how the joints vary, without the frame's own images.
    pub priors_alone: f64,
    /// Of the poses by contours alone, before texture refined them.
    pub contours_alone: f64,
    /// Of the aligned poses, with texture.
    pub aligned: f64,
    /// The same without each joint's constant offset over the frames, which other proportions of the template explain.
    pub gauge_aligned: f64,
    /// Mean distance of the given translations from the true ones, millimetres.
    pub given_translation_mm: f64,
    /// Mean distance of the translations by contours alone from the true ones, millimetres.
    pub contours_alone_translation_mm: f64,
    /// Mean distance of the aligned translations from the true ones, millimetres.
    pub aligned_translation_mm: f64,
}

impl AlignmentFigures {
    /// The figures of an alignment that started from the poses `given`.
    pub fn new(alignment: &Alignment, given: &[Pose], truth: Option<&[Pose]>) -> AlignmentFigures {
        let moves = moving_joints(given);
        let names = alignment.template.joint_names.iter();
        let uncertain = names.zip(&alignment.uncertainty).zip(&moves).filter(|(_, moves)| **moves);
        AlignmentFigures {
            rejection: alignment.rejection.as_ref().map(ToString::to_string),
            kept_frames: alignment.kept.len(),
            seconds: alignment.seconds,
            texture: alignment.texture.as_ref().map(TextureFigures::of),
            calibration: alignment.calibration.as_ref().map(CalibrationFigures::of),
            time_offsets: alignment.time_offsets.clone(),
            odd_cameras: alignment.odd_cameras.clone(),
            given: FitFigures::of(alignment.fit[0]),
            found: FitFigures::of(alignment.fit[1]),
            pose_error_deg: truth.map(|truth| PoseErrors::new(alignment, given, truth)),
            uncertainty_deg: uncertain.map(|((name, angle), _)| (name.clone(), angle.to_degrees())).collect(),
        }
    }
}

impl CalibrationFigures {
    fn of(calibration: &Calibration) -> CalibrationFigures {
        let [left_out_given, left_out_refined] = calibration.left_out.map(|lack| 1.0 - lack);
        let refined = calibration.parts.iter().map(|part| part.name().into()).collect();
        CalibrationFigures { refined, left_out_given, left_out_refined }
    }
}

impl FitFigures {
    fn of(fit: MaskFit) -> FitFigures {
        let [contours_median_px, contours_95_px] = fit.contours;
        FitFigures { contours_median_px, contours_95_px, overlap: fit.overlap }
    }
}

impl TextureFigures {
    fn of(texture: &TextureRefinement) -> TextureFigures {
        let [held_out_before, held_out_after] = texture.held_out;
        let [refined_frames, kept_frames] = [&texture.refined, &texture.kept].map(|frames| frames.len());
        TextureFigures { refined_frames, kept_frames, held_out_before, held_out_after }
    }
}

impl PoseErrors {
    fn new(alignment: &Alignment, given: &[Pose], truth: &[Pose]) -> PoseErrors {
        let moves = moving_joints(given);
        let parents = &alignment.template.parents;
        let offsets = offsets_between(truth, &alignment.poses, parents);
        let shifted: Vec<Pose> = truth.iter().map(|pose| offsets.apply(pose, parents)).collect();
        let by_contours = alignment.texture.as_ref().map_or(&alignment.poses, |texture| &texture.contour_poses);
        let distance = |poses: &[Pose]| {
            let sum: f64 = poses.iter().zip(truth).map(|(p, t)| p.translation.distance(t.translation)).sum();
            1e3 * sum / truth.len().max(1) as f64
        };
        PoseErrors {
            given: pose_error_degrees(given, truth, &moves),
            priors_alone: pose_error_degrees(&alignment.prior_poses, truth, &moves),
            contours_alone: pose_error_degrees(by_contours, truth, &moves),
            aligned: pose_error_degrees(&alignment.poses, truth, &moves),
            gauge_aligned: pose_error_degrees(&alignment.poses, &shifted, &moves),
            given_translation_mm: distance(given),
            contours_alone_translation_mm: distance(by_contours),
            aligned_translation_mm: distance(&alignment.poses),
        }
    }
}

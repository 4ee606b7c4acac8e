//! Refinement of the training poses by the avatar that is being trained.

use ghand_core::Pose;
use ghand_fit::alignment::synthesis::{SynthesisError, SynthesisProblem, SynthesisRefinement, refine_by_synthesis};
use ghand_render::Gpu;
use glam::DVec3;

use super::stage::Stage;
use super::{Problem, Run};
use crate::settings::{Align, Model, Refine};
use crate::step::Step;
use crate::train_error::TrainError;

/// Iterations after which poses are refined: once the avatar is as sharp as the poses let it be. A second time after 500 brought
/// nothing.
const REFINED_AFTER: [u64; 1] = [200];
/// The avatar must have this many times as many iterations in all, to learn from the refined poses.
const LEAST_PART: u64 = 3;

impl From<SynthesisError> for TrainError {
    fn from(error: SynthesisError) -> TrainError {
        match error {
            SynthesisError::Capture(error) => error.into(),
            SynthesisError::Pose(error) => error.into(),
            SynthesisError::Render(error) => error.into(),
        }
    }
}

impl Problem {
    /// Whether poses are refined in this run: where contours have aligned them. The networks take too long to draw.
    fn refines(&self) -> bool {
        let settings = &self.settings;
        let is_aligned = self.prepared.alignment.as_ref().is_some_and(|alignment| alignment.rejection.is_none());
        let is_wanted = settings.refine == Refine::Synthesis && settings.align == Align::Contours;
        is_wanted && is_aligned && settings.model == Model::Direct
    }

    /// Why `refine=synthesis` refines nothing in a stage of so many iterations; `None` if it does, or is not set.
    pub(super) fn why_not_refined(&self, iterations: u64) -> Option<&'static str> {
        let settings = &self.settings;
        match () {
            () if settings.refine != Refine::Synthesis => None,
            () if settings.align != Align::Contours => Some("only poses aligned with align=contours are refined"),
            () if settings.model != Model::Direct => Some("networks take too long to draw; set model=direct"),
            () if !self.refines() => Some("the alignment was not used"),
            () if !REFINED_AFTER.iter().any(|after| is_due(*after, iterations)) => {
                Some("there are fewer than 600 iterations")
            }
            () => None,
        }
    }

    /// Whether poses are refined before an iteration of a stage.
    pub(super) fn refines_before(&self, stage: &Stage, iteration: u64) -> bool {
        stage.refines && self.refines() && is_due(iteration, stage.iterations)
    }

    /// Refines the poses on the device; `None` if a stop was requested: they are then as before.
    ///
    /// # Errors
    /// [`TrainError`] if an image has become unreadable or the device failed.
    pub(super) fn refine_poses(
        &self,
        gpu: &Gpu,
        run: &Run,
        step: &mut Step,
        stage: &Stage,
        iteration: u64,
    ) -> Result<Option<SynthesisRefinement>, TrainError> {
        let background = self.capture.background.map(|b| b as f32);
        let (_, joints, poses) = self.read_hand(gpu, step)?;
        let mut template = self.capture.template.clone();
        template.joint_regressor.clear();
        template.joints = joints.iter().map(|j| DVec3::new(j[0].into(), j[1].into(), j[2].into())).collect();
        let given: Vec<&Pose> = self.split.frames.iter().map(|frame| &self.capture.frames[*frame].pose).collect();
        let frames = (0..self.views.len()).map(|index| self.views.position(index).unwrap_or(0)).collect();
        let view = |index| self.views.get(index, stage.reduction);
        let problem = SynthesisProblem { template: &template, given, frames, view: &view, reduction: stage.reduction };
        let refined = refine_by_synthesis(&problem, &poses, iteration, &mut |view, pose| {
            if run.stop_requested() {
                return Ok(None);
            }
            step.set_pose(gpu, view.frame, pose)?;
            step.picture(gpu, view.frame, &view.camera, background).map(Some)
        })?;
        let (poses, refinement) = refined.map_or((poses, None), |(poses, refinement)| (poses, Some(refinement)));
        for (frame, pose) in poses.iter().enumerate() {
            step.set_pose(gpu, frame, pose)?;
        }
        if let Some(refinement) = &refinement {
            log::info!("{}", refinement.summary());
        }
        Ok(refinement)
    }
}

fn is_due(iteration: u64, iterations: u64) -> bool {
    REFINED_AFTER.contains(&iteration) && LEAST_PART * iteration <= iterations
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn poses_are_refined_only_if_enough_iterations_follow() {
        let due = |iterations: u64| (0..iterations).filter(|i| is_due(*i, iterations)).collect::<Vec<u64>>();
        assert_eq!(due(2000), [200]);
        assert_eq!(due(600), [200]);
        assert!(due(599).is_empty());
    }
}

//! What changes during a run, beside what is learned.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use super::Problem;
use super::preview_sink::PreviewSink;
use crate::checkpoint::{Checkpoint, CurvePoint, StageState};
use crate::checkpoints::Checkpoints;

/// A run: what it has measured and saved, its preview, and whether a stop was requested.
pub(super) struct Run<'a> {
    pub curve: Vec<CurvePoint>,
    pub stop: Option<&'a AtomicBool>,
    pub checkpoints: Option<Checkpoints>,
    pub preview: Option<PreviewSink<'a>>,
    /// The stage's state that was saved last.
    pub state: Option<StageState>,
    pub started: Instant,
    /// Seconds of the run before this program.
    pub earlier: f64,
}

impl Default for Run<'_> {
    fn default() -> Self {
        Run {
            curve: vec![],
            stop: None,
            checkpoints: None,
            preview: None,
            state: None,
            started: Instant::now(),
            earlier: 0.0,
        }
    }
}

impl Run<'_> {
    /// Wall-clock time of the run, seconds.
    pub fn seconds(&self) -> f64 {
        self.earlier + self.started.elapsed().as_secs_f64()
    }

    /// Whether a stop was requested.
    pub fn stop_requested(&self) -> bool {
        self.stop.is_some_and(|stop| stop.load(Ordering::Relaxed))
    }

    pub fn checkpoint_due(&self) -> bool {
        self.checkpoints.as_ref().is_some_and(Checkpoints::due)
    }

    /// Saves a state, and keeps it in case the device is lost.
    pub fn save(&mut self, problem: &Problem, stage: StageState) {
        let seconds = self.seconds();
        let Some(checkpoints) = &mut self.checkpoints else { return };
        let checkpoint = Checkpoint {
            program: env!("CARGO_PKG_VERSION").into(),
            settings: problem.settings.clone(),
            training_set: problem.training_set,
            prepared: problem.prepared.without_blend_shapes(),
            stage,
            seconds,
            curve: self.curve.clone(),
        };
        checkpoints.save(&checkpoint);
        self.state = Some(checkpoint.stage);
    }
}

//! Live poses in the viewer: start, stop, and what they do to the hand.

use egui::{Context, Ui};
use ghand_motion::live::PacketKind;

use crate::viewer::app::Viewer;
use crate::viewer::document::subject::Subject;
use crate::viewer::live::{Live, LiveEvent, LiveSettings};

/// Shown when the user or a motion changes the pose while live poses drive the hand.
const PAUSED: &str = "Live poses are paused, because the pose was changed here. \"Resume\" in the panel follows them.";

impl Viewer {
    /// Opens the port for live poses, now and whenever the user starts them again. If that is impossible, a message
    /// says why.
    pub fn start_live(&mut self, settings: LiveSettings) {
        match Live::open(&settings) {
            Ok(live) => self.live = Some(live),
            Err(error) => self.toasts.error(&error.context("live poses")),
        }
        self.live_settings = settings;
    }

    /// Opens the port for live poses, or closes it; the last pose stays.
    pub(super) fn start_or_stop_live(&mut self) {
        if self.live.take().is_none() {
            self.start_live(self.live_settings.clone());
        }
    }

    /// Takes the newest live pose. With the first one of a tracker, the view becomes that of the tracker: its hand may
    /// have any orientation.
    pub(super) fn advance_live(&mut self, context: &Context) {
        let (Some(live), Subject::Hand(hand)) = (&mut self.live, &mut self.subject) else { return };
        match live.advance(hand, context) {
            None | Some(LiveEvent::Begun(PacketKind::Pose)) => {}
            Some(LiveEvent::Begun(_)) => {
                self.camera.look_along_world();
                self.frame_subject();
            }
            Some(LiveEvent::Paused) => self.toasts.note(PAUSED),
        }
    }

    /// Another subject is shown; a scene has no pose.
    pub(super) fn live_subject_changed(&mut self) {
        match &self.subject {
            Subject::Hand(_) => self.live.iter_mut().for_each(Live::model_changed),
            Subject::Scene { .. } => self.live = None,
        }
    }

    /// Shows the controls of live poses while their port is open.
    pub(super) fn live_controls(&mut self, ui: &mut Ui) {
        let Some(live) = &mut self.live else { return };
        if live.controls(ui) {
            self.live = None;
        }
        ui.separator();
    }
}

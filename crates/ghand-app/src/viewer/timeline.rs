//! The controls of a motion: selection, playback and position.

use std::time::Duration;

use egui::{Button, Context, Ui, Vec2};
use ghand_core::{HandModel, Pose};
use ghand_motion::PoseSequence;
use ghand_motion::motions::{MOTION_NAMES, motion};
use ghand_motion::pose_sequence::DEFAULT_FPS;

use crate::viewer::number_slider::number_slider;

/// After a longer pause between frames than this, seconds, such as while the window is minimised, the motion continues
/// where it was. A software rasteriser takes about a second for a large picture.
const LONGEST_STEP: f64 = 3.0;
/// Seconds between two pictures of a motion.
const FRAME: f64 = 1.0 / 60.0;
/// Width of the button that starts and stops a motion, points.
const BUTTON_WIDTH: f32 = 52.0;

/// A motion and the current position in it.
#[derive(Debug, Clone)]
pub struct Timeline {
    title: String,
    sequence: PoseSequence,
    seconds: f64,
    playing: bool,
    /// When the motion was last advanced, in the user interface's seconds, if it has played since.
    last_step: Option<f64>,
}

impl Timeline {
    /// A motion that plays from its beginning.
    pub fn new(title: String, sequence: PoseSequence) -> Timeline {
        Timeline { title, sequence, seconds: 0.0, playing: true, last_step: None }
    }

    /// The pose at the motion's current position.
    pub fn pose(&self) -> Option<Pose> {
        self.sequence.pose_at(self.seconds)
    }

    /// A motion by name that plays from its beginning; `None` if there is none for this hand.
    pub fn named(name: &str, model: &HandModel) -> Option<Timeline> {
        let sequence = motion(name, model, DEFAULT_FPS)?.ok()?;
        Some(Timeline::new(name.into(), sequence))
    }

    /// Plays on, or stops at the current position.
    pub fn play_or_pause(&mut self) {
        self.playing = !self.playing;
    }

    /// Stops at the current position.
    pub fn pause(&mut self) {
        self.playing = false;
    }

    /// Stops at the beginning.
    pub fn rewind(&mut self) {
        self.pause();
        self.seconds = 0.0;
    }

    /// Whether it plays.
    pub fn is_playing(&self) -> bool {
        self.playing
    }

    /// Advances to the present time if it plays, and returns its pose then.
    pub fn advance(&mut self, context: &Context) -> Option<Pose> {
        if !self.playing {
            self.last_step = None;
            return None;
        }
        self.step_to(context.input(|input| input.time));
        context.request_repaint_after(Duration::from_secs_f64(FRAME));
        self.pose()
    }

    /// Shows the list of motions and the controls of the current one.
    pub fn show(timeline: &mut Option<Timeline>, ui: &mut Ui, model: &HandModel, pose: &mut Pose) {
        ui.horizontal_wrapped(|ui| {
            for name in MOTION_NAMES {
                let chosen = timeline.as_ref().is_some_and(|timeline| timeline.title == name);
                if ui.add(Button::new(name).selected(chosen)).clicked()
                    && let Some(motion) = Timeline::named(name, model)
                {
                    *timeline = Some(motion);
                }
            }
        });
        let Some(timeline) = timeline else { return };
        let mut moved = false;
        ui.horizontal(|ui| {
            // The same width for both words: otherwise the slider would move away under the pointer.
            let word = if timeline.playing { "Pause" } else { "Play" };
            if ui.add(Button::new(word).min_size(Vec2::new(BUTTON_WIDTH, 0.0))).clicked() {
                timeline.play_or_pause();
            }
            let end = timeline.sequence.duration();
            ui.spacing_mut().slider_width = 110.0;
            let response = ui.add(number_slider(&mut timeline.seconds, 0.0..=end, 2, " s"));
            // Holding the slider or typing a time stops the motion.
            if response.changed() || response.dragged() || response.gained_focus() {
                timeline.pause();
            }
            moved |= response.on_hover_text("Position in the motion").changed();
        });
        if let (true, Some(now)) = (moved, timeline.pose()) {
            *pose = now;
        }
    }

    /// Advances to a time of the user interface, seconds; the motion repeats.
    fn step_to(&mut self, now: f64) {
        let passed = self.last_step.replace(now).map_or(0.0, |last| now - last);
        if passed > LONGEST_STEP {
            return;
        }
        let end = self.sequence.duration();
        self.seconds += passed.max(0.0);
        if self.seconds > end {
            self.seconds = if end > 0.0 { self.seconds % end } else { 0.0 };
        }
    }

    #[cfg(test)]
    pub(crate) fn state(&self) -> (f64, bool) {
        (self.seconds, self.playing)
    }
}

#[cfg(test)]
mod tests {
    use ghand_hand_model::procedural::ProceduralHand;

    use super::*;

    #[test]
    fn a_motion_repeats_and_waits_while_nobody_looks() {
        let model = ProceduralHand { detail: 1, ..Default::default() }.build().unwrap();
        let sequence = motion("grasp", &model, 30.0).unwrap().unwrap();
        let end = sequence.duration();
        let mut timeline = Timeline::new("grasp".into(), sequence.clone());
        assert_eq!(timeline.pose().unwrap(), sequence.frames[0].pose);
        // It begins when it is first shown.
        timeline.step_to(50.0);
        assert_eq!(timeline.pose().unwrap(), sequence.frames[0].pose);
        timeline.step_to(50.1);
        assert!((timeline.seconds - 0.1).abs() < 1e-9);
        timeline.step_to(150.0);
        assert!((timeline.seconds - 0.1).abs() < 1e-9);
        timeline.seconds = end - 0.05;
        timeline.step_to(150.1);
        assert!((timeline.seconds - 0.05).abs() < 1e-9);
    }
}

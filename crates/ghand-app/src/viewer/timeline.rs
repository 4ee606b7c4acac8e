//! The controls of a motion: which, whether it plays, and where it is.

use std::time::Duration;

use egui::{Button, Slider, Ui};
use ghand_core::{HandModel, Pose};
use ghand_data::PoseSequence;
use ghand_data::motions::{MOTION_NAMES, motion};
use ghand_data::pose_sequence::DEFAULT_FPS;

/// A longer pause than this, seconds, is one in which nobody looked: the motion goes on where it was.
const LONGEST_STEP: f64 = 0.25;

/// A motion and its place.
pub struct Timeline {
    title: String,
    sequence: PoseSequence,
    seconds: f64,
    playing: bool,
}

impl Timeline {
    /// A motion from its beginning.
    pub fn new(title: String, sequence: PoseSequence, playing: bool) -> Timeline {
        Timeline { title, sequence, seconds: 0.0, playing }
    }

    /// The pose at the motion's place.
    pub fn pose(&self) -> Option<Pose> {
        self.sequence.at(self.seconds)
    }

    /// Shows the motions that there are and the controls of the one that runs, and moves it on.
    pub fn show(timeline: &mut Option<Timeline>, ui: &mut Ui, model: &HandModel, pose: &mut Pose) {
        ui.horizontal_wrapped(|ui| {
            for name in MOTION_NAMES {
                let chosen = timeline.as_ref().is_some_and(|timeline| timeline.title == name);
                if ui.add(Button::new(name).selected(chosen)).clicked()
                    && let Some(Ok(sequence)) = motion(name, model, DEFAULT_FPS)
                {
                    *timeline = Some(Timeline::new(name.into(), sequence, true));
                }
            }
        });
        let Some(timeline) = timeline else { return };
        let mut moved = timeline.playing;
        ui.horizontal(|ui| {
            if ui.button(if timeline.playing { "Pause" } else { "Play" }).clicked() {
                timeline.playing = !timeline.playing;
            }
            let end = timeline.sequence.duration();
            ui.spacing_mut().slider_width = 110.0;
            let slider = Slider::new(&mut timeline.seconds, 0.0..=end).suffix(" s").fixed_decimals(2);
            let response = ui.add(slider);
            if response.changed() {
                timeline.playing = false;
                moved = true;
            }
        });
        if timeline.playing {
            timeline.step(f64::from(ui.input(|input| input.unstable_dt)));
            // No sooner than the next frame of the motion: drawing the same pose again would be for nothing.
            let wait = (1.0 / timeline.sequence.fps).min(1.0 / 60.0);
            ui.ctx().request_repaint_after(Duration::from_secs_f64(wait));
        }
        if let (true, Some(now)) = (moved, timeline.pose()) {
            *pose = now;
        }
    }

    /// Goes on by so many seconds, and from the end to the beginning.
    fn step(&mut self, seconds: f64) {
        let end = self.sequence.duration();
        self.seconds += seconds.clamp(0.0, LONGEST_STEP);
        if self.seconds > end {
            self.seconds = if end > 0.0 { self.seconds % end } else { 0.0 };
        }
    }
}

#[cfg(test)]
mod tests {
    use ghand_core::hand_model::procedural::ProceduralHand;

    use super::*;

    #[test]
    fn a_motion_plays_round_and_waits_while_nobody_looks() {
        let model = ProceduralHand { detail: 1, ..Default::default() }.build().unwrap();
        let sequence = motion("grasp", &model, 30.0).unwrap().unwrap();
        let end = sequence.duration();
        let mut timeline = Timeline::new("grasp".into(), sequence.clone(), true);
        assert_eq!(timeline.pose().unwrap(), sequence.frames[0].pose);
        timeline.step(0.1);
        assert_eq!(timeline.pose().unwrap(), sequence.frames[3].pose);
        timeline.step(100.0);
        assert!((timeline.seconds - 0.35).abs() < 1e-12);
        timeline.seconds = end - 0.05;
        timeline.step(0.1);
        assert!((timeline.seconds - 0.05).abs() < 1e-9);
    }
}

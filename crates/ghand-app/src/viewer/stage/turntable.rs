//! Turns the view by itself.

use std::f64::consts::TAU;

use egui::Context;

use ghand_avatar::orbit_camera::OrbitCamera;

/// Seconds of a whole turn.
const TURN_SECS: f64 = 12.0;
/// It goes on where it was after a longer pause between frames than this, seconds.
const LONGEST_STEP_SECS: f64 = 1.0;

/// Whether the view turns by itself, and when it last did.
#[derive(Debug, Default)]
pub struct Turntable {
    /// Whether it turns.
    pub is_on: bool,
    /// In the user interface's seconds.
    last: Option<f64>,
}

impl Turntable {
    /// Turns the camera as far as the time since the last frame says.
    pub fn advance(&mut self, camera: &mut OrbitCamera, context: &Context) {
        let now = context.input(|input| input.time);
        let passed = now - self.last.replace(now).unwrap_or(now);
        if self.is_on {
            if passed <= LONGEST_STEP_SECS {
                camera.turn(passed / TURN_SECS * TAU);
            }
            context.request_repaint();
        } else {
            self.last = None;
        }
    }
}

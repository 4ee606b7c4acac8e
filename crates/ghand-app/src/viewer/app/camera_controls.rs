//! Moves the view: sides, framing, the turntable and the cameras of a capture.

use std::f64::consts::TAU;

use egui::{Context, Ui};

use crate::viewer::app::Viewer;
use crate::viewer::document::capture_panel::CapturePanel;
use crate::viewer::document::subject::Subject;
use crate::viewer::rendering::camera::Projection;
use crate::viewer::rendering::view_side::ViewSide;
use crate::viewer::widgets::number_slider::number_slider;

/// Seconds of a whole turn of the turntable.
const TURN_SECS: f64 = 12.0;
/// The turntable goes on where it was after a longer pause between frames than this, seconds.
const LONGEST_STEP_SECS: f64 = 1.0;
/// Range of the field of view, degrees: beyond, the near plane cuts the hand, or it needs more distance than there is.
const FIELDS_OF_VIEW: [f64; 2] = [8.0, 90.0];

impl Viewer {
    /// Shows the cameras of a capture, and the view of the first of them.
    pub fn show_capture(&mut self, mut capture: CapturePanel) {
        self.read_trained_poses(&mut capture);
        for remark in &capture.remarks {
            self.toasts.note(remark);
        }
        self.capture = Some(capture);
        self.truth.forget_images();
        self.look_through_camera();
    }

    /// Reads the poses that training found, if the avatar is from a file and they are beside it.
    fn read_trained_poses(&mut self, capture: &mut CapturePanel) {
        let (Some(watched), Subject::Hand(hand)) = (&self.watched, &self.subject) else { return };
        if hand.avatar().is_none() {
            return;
        }
        if let Err(error) = capture.read_trained_poses(watched.path(), hand.model()) {
            self.toasts.note(format!("{error:#}"));
        }
    }

    /// Reads the poses of training again, because the avatar's file has changed. A hand in the pose of the frame follows it.
    pub(super) fn renew_trained_poses(&mut self) {
        let Some(mut capture) = self.capture.take() else { return };
        let follows = capture.chosen().map(|(_, pose)| pose) == self.subject.pose();
        self.read_trained_poses(&mut capture);
        if let (true, Subject::Hand(hand), Some((_, pose))) = (follows, &mut self.subject, capture.chosen()) {
            hand.pose.clone_from(pose);
        }
        self.capture = Some(capture);
    }

    /// Shows the capture's poses as given instead of those of training, or the other way round.
    pub(super) fn switch_capture_poses(&mut self) {
        if let Some(capture) = &mut self.capture {
            capture.choose_poses(!capture.poses().are_of_training());
            self.look_through_camera();
        }
    }

    /// Gives all depths the same size.
    pub fn show_orthographic(&mut self) {
        if self.camera.projection() == Projection::Perspective {
            self.camera.switch_projection();
        }
    }

    /// The controls of the view.
    pub(super) fn camera_controls(&mut self, ui: &mut Ui) {
        if self.subject.pose().is_some() {
            ui.horizontal_wrapped(|ui| {
                for side in ViewSide::ALL {
                    if ui.button(side.label()).clicked() {
                        self.look_from(side);
                    }
                }
            });
        }
        self.saved_views(ui);
        ui.horizontal(|ui| {
            let label = ui.label("field of view").id;
            let mut degrees = self.camera.field_of_view().to_degrees();
            ui.spacing_mut().slider_width = 84.0;
            let range = FIELDS_OF_VIEW[0]..=FIELDS_OF_VIEW[1];
            // An orthographic view has none.
            let slider = number_slider(&mut degrees, range, 0, "°");
            let is_perspective = self.camera.projection() == Projection::Perspective;
            if ui.add_enabled(is_perspective, slider).labelled_by(label).changed() {
                self.camera.set_field_of_view(degrees.to_radians());
            }
        });
        ui.horizontal(|ui| {
            if ui.button("Frame").on_hover_text("Fill the view with the subject in its present pose (F)").clicked() {
                self.frame_subject();
            }
            ui.checkbox(&mut self.turntable, "turntable");
            let mut orthographic = self.camera.projection() == Projection::Orthographic;
            let hover = "All depths have the same size (O)";
            if ui.checkbox(&mut orthographic, "ortho").on_hover_text(hover).changed() {
                self.camera.switch_projection();
            }
        });
    }

    /// The controls of a capture, if there is one.
    pub(super) fn capture_controls(&mut self, ui: &mut Ui) {
        if let Some(capture) = &mut self.capture {
            if capture.show(ui) {
                self.look_through_camera();
            }
            self.truth_controls(ui);
            ui.separator();
        }
    }

    /// Moves the view so that the subject fills it in its present pose.
    pub(super) fn frame_subject(&mut self) {
        match &self.subject {
            Subject::Hand(hand) => self.camera.frame(&hand.posed_vertices()),
            Subject::Scene { .. } => self.reset_view(),
        }
    }

    pub(super) fn look_from(&mut self, side: ViewSide) {
        if let Subject::Hand(hand) = &self.subject {
            self.camera.look_from(side, hand.model(), &hand.pose);
            self.camera.frame(&hand.posed_vertices());
        }
    }

    pub(super) fn step_camera(&mut self, by: isize) {
        if let Some(capture) = &mut self.capture {
            capture.step_camera(by);
            self.look_through_camera();
        }
    }

    /// Shows the view of the capture's chosen camera, with a hand in the pose of the chosen frame.
    pub(super) fn look_through_camera(&mut self) {
        let Some((camera, pose)) = self.capture.as_ref().and_then(CapturePanel::chosen) else { return };
        self.turntable = false;
        let mut middle = glam::DVec3::ZERO;
        if let Subject::Hand(hand) = &mut self.subject {
            hand.pause();
            hand.pose.clone_from(pose);
            middle = ghand_avatar::framing::middle(&hand.posed_vertices());
        }
        self.camera.show_calibrated(camera, camera.camera_from_world(middle).z);
    }

    /// Turns the turntable.
    pub(super) fn advance_turntable(&mut self, context: &Context) {
        let now = context.input(|input| input.time);
        let passed = now - self.turntable_time.replace(now).unwrap_or(now);
        if self.turntable {
            if passed <= LONGEST_STEP_SECS {
                self.camera.turn(passed / TURN_SECS * TAU);
            }
            context.request_repaint();
        } else {
            self.turntable_time = None;
        }
    }
}

//! Views of the subject by name, by the cameras of a capture, and of its layers.

use anyhow::bail;
use egui::Ui;

use crate::viewer::app::Viewer;
use crate::viewer::document::capture_panel::CapturePanel;
use crate::viewer::session::ViewRequest;
use crate::viewer::stage::comparison::Comparison;
use crate::viewer::stage::layer::Layer;
use crate::viewer::stage::layer_view::missing_layer;
use crate::viewer::stage::overlay::Overlay;
use ghand_avatar::view_side::ViewSide;

impl Viewer {
    /// Shows the view of that name: a side of the hand, or one that was saved.
    ///
    /// # Errors
    /// One sentence with the names that there are.
    pub fn go_to_view(&mut self, name: &str) -> anyhow::Result<()> {
        let has_sides = self.document.hand().is_some();
        if let (Some(side), true) = (ViewSide::of(name), has_sides) {
            self.stage.set_turning(false);
            self.stage.look_from(side, &self.document.subject);
            return Ok(());
        }
        if let Some(view) = self.session.view(name) {
            self.stage.take_view(&view.point);
            return Ok(());
        }
        let sides = ViewSide::ALL.into_iter().filter(|_| has_sides).map(ViewSide::name);
        let mut names: Vec<&str> = sides.collect();
        names.extend(self.session.settings.views.iter().map(|view| view.name.as_str()));
        match names.is_empty() {
            true => bail!("there is no view {name:?}; none has been saved"),
            false => bail!("there is no view {name:?}, only {}", names.join(", ")),
        }
    }

    /// Shows a view; if there is none of that name, a message says so.
    pub(super) fn show_view(&mut self, name: &str) {
        if let Err(error) = self.go_to_view(name) {
            self.session.error(&error);
        }
    }

    /// Saves the present view under a name; if it cannot be kept, asks for another one.
    pub(super) fn save_view(&mut self, name: &str) {
        match self.session.save_view(name, self.stage.camera.view_point()) {
            Ok(()) => self.session.note(format!("The view is saved as {}.", name.trim())),
            Err(problem) => {
                self.session.note(problem);
                self.dialogs.ask_for_name();
            }
        }
    }

    /// The saved views as buttons.
    pub(super) fn saved_views(&mut self, ui: &mut Ui) {
        match self.session.view_buttons(ui) {
            None => {}
            Some(ViewRequest::Show(name)) => self.show_view(&name),
            Some(ViewRequest::Delete(name)) => self.session.delete_view(&name),
            Some(ViewRequest::Save) => self.dialogs.ask_for_name(),
        }
    }

    /// Gives all depths the same size.
    pub fn show_orthographic(&mut self) {
        if !self.stage.is_orthographic() {
            self.stage.switch_projection();
        }
    }

    /// Everything as at the start.
    pub(super) fn reset_all(&mut self) {
        self.document.subject.reset();
        self.stage.reset(&self.document.subject);
    }

    /// Shows the cameras of a capture, and the view of the first of them.
    pub fn show_capture(&mut self, capture: CapturePanel) {
        for remark in self.document.take_capture(capture) {
            self.session.note(remark);
        }
        self.stage.truth.forget_images();
        self.look_through_camera();
    }

    /// Goes some cameras of the capture forward, or back.
    pub(super) fn step_camera(&mut self, by: isize) {
        self.document.step_camera(by);
        self.look_through_camera();
    }

    /// Shows the capture's poses as given instead of those of training, or the other way round.
    pub(super) fn switch_capture_poses(&mut self) {
        self.document.switch_capture_poses();
        self.look_through_camera();
    }

    /// Shows the view of the capture's chosen camera, with a hand in the pose of the chosen frame.
    pub(super) fn look_through_camera(&mut self) {
        if let Some((camera, depth)) = self.document.take_captured_pose() {
            self.stage.look_through(&camera, depth);
        }
    }

    /// Chooses what is shown of picture and truth.
    pub fn compare(&mut self, comparison: Comparison) {
        self.stage.truth.choose(comparison);
    }

    /// Chooses what the colours show. If the avatar lacks it, a message says why.
    pub fn show_layer(&mut self, layer: Layer) {
        if let Err(reason) = self.stage.layers.choose(layer, self.document.avatar()) {
            self.session.note(reason);
        }
    }

    /// Why the subject cannot show a layer; `None` if it can.
    pub fn missing_layer(&self, layer: Layer) -> Option<&'static str> {
        missing_layer(layer, self.document.avatar())
    }

    /// Chooses the shape basis that is shown, counted from 1, and whether there is such a basis.
    pub fn choose_basis(&mut self, number: usize) -> bool {
        self.stage.layers.choose_basis(number, self.document.avatar())
    }

    /// Chooses the joint whose weights are shown, and whether there is such a joint.
    pub fn choose_joint(&mut self, name: &str) -> bool {
        let found = self.document.hand().and_then(|hand| hand.model().joint_index(name));
        found.into_iter().for_each(|joint| self.stage.layers.choose_joint(joint));
        found.is_some()
    }

    /// Draws lines over the view, or stops.
    pub fn toggle_overlay(&mut self, overlay: Overlay) {
        self.stage.layers.toggle_overlay(overlay);
    }
}

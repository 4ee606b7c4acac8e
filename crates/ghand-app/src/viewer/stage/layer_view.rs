//! Shows layers of the subject and lines over it.

use egui::{ComboBox, Rect, RichText, Ui};
use ghand_avatar::Avatar;
use ghand_core::Pose;
use ghand_render::RenderError;
use glam::DVec3;

use crate::viewer::app::Viewer;
use crate::viewer::document::subject::Subject;
use crate::viewer::rendering::drawing::GaussianColors;
use crate::viewer::rendering::frame::PictureInputs;
use crate::viewer::stage::layer::{Layer, LayerInputs};
use crate::viewer::stage::legend::Legend;
use crate::viewer::stage::overlay::Overlay;
use crate::viewer::widgets::number_slider::number_slider;
use ghand_avatar::pose_properties::PoseProperties;

/// What is shown of the subject.
#[derive(Default)]
pub(super) struct LayerView {
    chosen: Layer,
    /// The joint whose weights are shown.
    joint: usize,
    /// The shape basis that is shown, from 0.
    basis: usize,
    overlays: Vec<Overlay>,
    /// The layer, the joint and the basis of the picture.
    shown: (Layer, usize, usize),
    /// The posed Gaussians of the last pose, metres, world.
    posed: Option<(Pose, Vec<DVec3>)>,
    /// What was learned, in the last pose.
    properties: Option<(Pose, PoseProperties)>,
    legend: Option<Legend>,
}

impl LayerView {
    /// Forgets what belongs to another subject or device.
    pub(super) fn forget_subject(&mut self) {
        (self.posed, self.properties, self.legend) = (None, None, None);
    }

    /// What the colours of the picture mean, if they mean something.
    #[cfg(test)]
    pub(super) fn legend(&self) -> Option<&Legend> {
        self.legend.as_ref()
    }

    /// As at the start.
    pub(super) fn reset(&mut self) {
        (self.chosen, self.overlays) = (Layer::Skin, Vec::new());
    }
}

impl Viewer {
    /// Chooses what the colours show. If the avatar lacks it, a message says why.
    pub fn show_layer(&mut self, layer: Layer) {
        match self.avatar().and_then(|avatar| layer.missing(avatar)) {
            Some(reason) => self.toasts.note(format!("This avatar cannot show {}: {reason}.", layer.name())),
            None => self.layers.chosen = layer,
        }
    }

    /// Chooses the shape basis that is shown, counted from 1, and whether there is such a basis.
    pub fn choose_basis(&mut self, number: usize) -> bool {
        let count = self.avatar().map_or(0, |avatar| avatar.config.shape_bases);
        let found = (1..=count).contains(&number);
        if found {
            self.layers.basis = number - 1;
        }
        found
    }

    /// Why the subject cannot show a layer; `None` if it can.
    pub fn missing_layer(&self, layer: Layer) -> Option<&'static str> {
        match self.avatar() {
            Some(avatar) => layer.missing(avatar),
            None => Some("only avatars have layers"),
        }
    }

    /// Chooses the joint whose weights are shown, and whether there is such a joint.
    pub fn choose_joint(&mut self, name: &str) -> bool {
        let Subject::Hand(hand) = &self.subject else { return false };
        let found = hand.model().joint_index(name);
        self.layers.joint = found.unwrap_or(self.layers.joint);
        found.is_some()
    }

    /// Draws lines over the view, or stops.
    pub fn toggle_overlay(&mut self, overlay: Overlay) {
        if self.has_overlay(overlay) {
            self.layers.overlays.retain(|other| *other != overlay);
        } else {
            self.layers.overlays.push(overlay);
        }
    }

    pub(super) fn has_overlay(&self, overlay: Overlay) -> bool {
        self.layers.overlays.contains(&overlay)
    }

    pub(super) fn avatar(&self) -> Option<&Avatar> {
        match &self.subject {
            Subject::Hand(hand) => hand.avatar(),
            Subject::Scene { .. } => None,
        }
    }

    /// Whether the subject has what a layer shows.
    pub fn has_layer(&self, layer: Layer) -> bool {
        self.missing_layer(layer).is_none()
    }

    /// The layer that is shown: skin if the subject lacks the chosen one.
    pub(super) fn layer(&self) -> Layer {
        if self.has_layer(self.layers.chosen) { self.layers.chosen } else { Layer::Skin }
    }

    /// The controls.
    pub(super) fn layer_controls(&mut self, ui: &mut Ui) {
        let Subject::Hand(hand) = &self.subject else { return };
        let names = hand.model().joint_names.clone();
        ui.label(RichText::new("Show").strong());
        let layer = self.layer();
        let layers: Vec<Layer> = Layer::ALL.into_iter().filter(|other| self.has_layer(*other)).collect();
        if !layers.is_empty() {
            ui.horizontal_wrapped(|ui| {
                for other in layers {
                    if ui.selectable_label(layer == other, other.name()).on_hover_text(other.summary()).clicked() {
                        self.show_layer(other);
                    }
                }
            });
        }
        if layer.has_joint() {
            ui.horizontal(|ui| {
                let label = ui.label("joint").id;
                let text = names.get(self.layers.joint).cloned().unwrap_or_default();
                let list = ComboBox::from_id_salt("joint of the weights").selected_text(text).show_ui(ui, |ui| {
                    for (joint, name) in names.iter().enumerate() {
                        ui.selectable_value(&mut self.layers.joint, joint, name);
                    }
                });
                list.response.labelled_by(label);
            });
        }
        let bases = self.avatar().map_or(0, |avatar| avatar.config.shape_bases);
        if layer.has_basis() && bases > 1 {
            let mut number = self.layers.basis as f64 + 1.0;
            ui.spacing_mut().slider_width = 110.0;
            let slider = number_slider(&mut number, 1.0..=bases as f64, 0, "").step_by(1.0).text("basis");
            if ui.add(slider).changed() {
                self.choose_basis(number.round() as usize);
            }
        }
        ui.horizontal(|ui| {
            for overlay in Overlay::ALL {
                let mut on = self.has_overlay(overlay);
                if ui.checkbox(&mut on, overlay.name()).on_hover_text(overlay.summary()).changed() {
                    self.toggle_overlay(overlay);
                }
            }
        });
        ui.separator();
    }

    /// Has the picture rendered again if another layer was chosen.
    pub(super) fn follow_layer(&mut self) {
        let bases = self.avatar().map_or(0, |avatar| avatar.config.shape_bases);
        // Another avatar may have fewer.
        self.layers.basis = self.layers.basis.min(bases.saturating_sub(1));
        let now = (self.layer(), self.layers.joint, self.layers.basis);
        if self.layers.shown != now {
            self.layers.shown = now;
            self.layers.legend = None;
            self.shown = None;
        }
    }

    /// Gives the picture the colours of the layer for these inputs.
    pub(super) fn color_picture(&mut self, inputs: &PictureInputs) -> Result<(), RenderError> {
        let layer = self.layer();
        let colors = match (layer, &inputs.pose) {
            (Layer::Albedo, _) => GaussianColors::Unlit,
            (Layer::Centers, _) => {
                self.layers.legend = Some(Legend::text("centres of the Gaussians"));
                GaussianColors::Dots
            }
            (layer, Some(pose)) if layer.has_numbers() => {
                self.read_for_layer(layer, pose)?;
                let inputs = LayerInputs {
                    pose,
                    camera: &inputs.camera,
                    depth_from: self.camera.apparent_depth(),
                    posed: self.layers.posed.as_ref().map(|(_, posed)| posed.as_slice()).unwrap_or_default(),
                    joint: self.layers.joint,
                    basis: self.layers.basis,
                    properties: self.layers.properties.as_ref().map(|(_, properties)| properties),
                };
                let colored = self.avatar().and_then(|avatar| layer.colors(avatar, &inputs));
                colored.map_or(GaussianColors::Own, |colored| {
                    self.layers.legend = Some(colored.legend);
                    GaussianColors::Given(colored.colors)
                })
            }
            _ => GaussianColors::Own,
        };
        self.picture.set_colors(colors);
        Ok(())
    }

    /// Reads from the device what a layer needs in a pose.
    fn read_for_layer(&mut self, layer: Layer, pose: &Pose) -> Result<(), RenderError> {
        if layer.needs_posed() && self.layers.posed.as_ref().is_none_or(|(of, _)| of != pose) {
            let posed = self.picture.posed_gaussians(&self.gpu, pose)?;
            self.layers.posed = Some((pose.clone(), posed));
        }
        if layer.needs_properties() && self.layers.properties.as_ref().is_none_or(|(of, _)| of != pose) {
            let properties = self.picture.properties(&self.gpu, pose)?;
            self.layers.properties = properties.map(|properties| (pose.clone(), properties));
        }
        Ok(())
    }

    /// Draws lines and the legend over the picture.
    pub(super) fn draw_layers(&mut self, ui: &Ui, rect: Rect) {
        let screen = self.screen(rect, ui.ctx().pixels_per_point());
        if let Subject::Hand(hand) = &self.subject {
            let painter = ui.painter().with_clip_rect(rect);
            let pointer = ui.input(|input| input.pointer.hover_pos());
            for overlay in Overlay::ALL.into_iter().rev().filter(|overlay| self.has_overlay(*overlay)) {
                overlay.draw(&painter, hand.model(), (&hand.shape, &hand.pose), &screen, pointer);
            }
        }
        if let Some(legend) =
            self.layers.legend.as_ref().filter(|_| self.layer() != Layer::Albedo && !self.shows_difference())
        {
            legend.show(ui, rect);
        }
    }
}

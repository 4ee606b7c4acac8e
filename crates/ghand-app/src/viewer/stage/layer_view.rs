//! Which layer of the subject the colours show, and the lines over it.
//!
//! [`LayerView`] owns the choice and what it has read of the subject for it. It changes neither the subject nor the
//! picture: it says which colours the picture should have.

use clap::ValueEnum;
use egui::{ComboBox, Rect, RichText, Ui};
use ghand_avatar::Avatar;
use ghand_avatar::pose_properties::PoseProperties;
use ghand_core::Pose;
use ghand_render::RenderError;
use glam::DVec3;

use crate::cli::choice_name;
use crate::viewer::hand::Hand;
use crate::viewer::rendering::drawing::GaussianColors;
use crate::viewer::rendering::frame::PictureInputs;
use crate::viewer::rendering::screen::Screen;
use crate::viewer::stage::canvas::Canvas;
use crate::viewer::stage::layer::{Layer, LayerInputs};
use crate::viewer::stage::legend::Legend;
use crate::viewer::stage::overlay::Overlay;
use crate::viewer::widgets::number_slider::number_slider;

/// What is shown of the subject.
#[derive(Default)]
pub struct LayerView {
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

/// Why an avatar cannot show a layer, or a subject without one; `None` if it can.
pub fn missing_layer(layer: Layer, avatar: Option<&Avatar>) -> Option<&'static str> {
    match avatar {
        Some(avatar) => layer.missing(avatar),
        None => Some("only avatars have layers"),
    }
}

impl LayerView {
    /// Forgets what belongs to another subject or device.
    pub fn forget_subject(&mut self) {
        (self.posed, self.properties, self.legend) = (None, None, None);
    }

    /// What the colours of the picture mean, if they mean something.
    #[cfg(test)]
    pub(crate) fn legend(&self) -> Option<&Legend> {
        self.legend.as_ref()
    }

    /// As at the start.
    pub fn reset(&mut self) {
        (self.chosen, self.overlays) = (Layer::Skin, Vec::new());
    }

    /// Chooses what the colours show.
    ///
    /// # Errors
    /// One sentence if the avatar lacks it.
    pub fn choose(&mut self, layer: Layer, avatar: Option<&Avatar>) -> Result<(), String> {
        match avatar.and_then(|avatar| layer.missing(avatar)) {
            Some(reason) => Err(format!("This avatar cannot show {}: {reason}.", choice_name(layer))),
            None => {
                self.chosen = layer;
                Ok(())
            }
        }
    }

    /// Chooses the shape basis that is shown, counted from 1, and whether there is such a basis.
    pub fn choose_basis(&mut self, number: usize, avatar: Option<&Avatar>) -> bool {
        let found = (1..=basis_count(avatar)).contains(&number);
        if found {
            self.basis = number - 1;
        }
        found
    }

    /// Chooses the joint whose weights are shown.
    pub fn choose_joint(&mut self, joint: usize) {
        self.joint = joint;
    }

    /// Draws lines over the view, or stops.
    pub fn toggle_overlay(&mut self, overlay: Overlay) {
        if self.has_overlay(overlay) {
            self.overlays.retain(|other| *other != overlay);
        } else {
            self.overlays.push(overlay);
        }
    }

    /// Whether these lines are drawn.
    pub fn has_overlay(&self, overlay: Overlay) -> bool {
        self.overlays.contains(&overlay)
    }

    /// The layer that is shown: skin if the avatar lacks the chosen one.
    pub fn layer(&self, avatar: Option<&Avatar>) -> Layer {
        if missing_layer(self.chosen, avatar).is_none() { self.chosen } else { Layer::Skin }
    }

    /// The controls.
    pub fn controls(&mut self, ui: &mut Ui, hand: &Hand) {
        let names = &hand.model().joint_names;
        let avatar = hand.avatar();
        ui.label(RichText::new("Show").strong());
        let layer = self.layer(avatar);
        let layers: Vec<Layer> =
            Layer::value_variants().iter().copied().filter(|other| missing_layer(*other, avatar).is_none()).collect();
        if !layers.is_empty() {
            ui.horizontal_wrapped(|ui| {
                for other in layers {
                    if ui.selectable_label(layer == other, choice_name(other)).on_hover_text(other.summary()).clicked()
                    {
                        self.chosen = other;
                    }
                }
            });
        }
        if layer.has_joint() {
            ui.horizontal(|ui| {
                let label = ui.label("joint").id;
                let text = names.get(self.joint).cloned().unwrap_or_default();
                let list = ComboBox::from_id_salt("joint of the weights").selected_text(text).show_ui(ui, |ui| {
                    for (joint, name) in names.iter().enumerate() {
                        ui.selectable_value(&mut self.joint, joint, name);
                    }
                });
                list.response.labelled_by(label);
            });
        }
        let bases = basis_count(avatar);
        if layer.has_basis() && bases > 1 {
            let mut number = self.basis as f64 + 1.0;
            ui.spacing_mut().slider_width = 110.0;
            let slider = number_slider(&mut number, 1.0..=bases as f64, 0, "").step_by(1.0).text("basis");
            if ui.add(slider).changed() {
                self.choose_basis(number.round() as usize, avatar);
            }
        }
        ui.horizontal(|ui| {
            for &overlay in Overlay::value_variants() {
                let mut on = self.has_overlay(overlay);
                if ui.checkbox(&mut on, choice_name(overlay)).on_hover_text(overlay.summary()).changed() {
                    self.toggle_overlay(overlay);
                }
            }
        });
        ui.separator();
    }

    /// Follows the choice. Returns whether the picture must be rendered again for it.
    pub fn follow(&mut self, avatar: Option<&Avatar>) -> bool {
        // Another avatar may have fewer.
        self.basis = self.basis.min(basis_count(avatar).saturating_sub(1));
        let now = (self.layer(avatar), self.joint, self.basis);
        let is_other = self.shown != now;
        if is_other {
            self.shown = now;
            self.legend = None;
        }
        is_other
    }

    /// The colours of the layer for a picture with these inputs, whose depths are counted from `depth_from`, metres.
    ///
    /// # Errors
    /// [`RenderError`] if the device failed or was lost.
    pub fn colors(
        &mut self,
        canvas: &mut Canvas,
        inputs: &PictureInputs,
        avatar: Option<&Avatar>,
        depth_from: f64,
    ) -> Result<GaussianColors, RenderError> {
        let layer = self.layer(avatar);
        Ok(match (layer, &inputs.pose) {
            (Layer::Albedo, _) => GaussianColors::Unlit,
            (Layer::Centers, _) => {
                self.legend = Some(Legend::text("centres of the Gaussians"));
                GaussianColors::Dots
            }
            (layer, Some(pose)) if layer.has_numbers() => {
                self.read(canvas, layer, pose)?;
                let inputs = LayerInputs {
                    pose,
                    camera: &inputs.camera,
                    depth_from,
                    posed: self.posed.as_ref().map(|(_, posed)| posed.as_slice()).unwrap_or_default(),
                    joint: self.joint,
                    basis: self.basis,
                    properties: self.properties.as_ref().map(|(_, properties)| properties),
                };
                let colored = avatar.and_then(|avatar| layer.colors(avatar, &inputs));
                colored.map_or(GaussianColors::Own, |colored| {
                    self.legend = Some(colored.legend);
                    GaussianColors::Given(colored.colors)
                })
            }
            _ => GaussianColors::Own,
        })
    }

    /// Reads from the device what a layer needs in a pose.
    fn read(&mut self, canvas: &mut Canvas, layer: Layer, pose: &Pose) -> Result<(), RenderError> {
        let (gpu, drawing) = canvas.drawing();
        if layer.needs_posed() && self.posed.as_ref().is_none_or(|(of, _)| of != pose) {
            self.posed = Some((pose.clone(), drawing.posed_gaussians(gpu, pose)?));
        }
        if layer.needs_properties() && self.properties.as_ref().is_none_or(|(of, _)| of != pose) {
            self.properties = drawing.properties(gpu, pose)?.map(|properties| (pose.clone(), properties));
        }
        Ok(())
    }

    /// Draws lines over the hand.
    pub fn paint_lines(&self, ui: &Ui, hand: &Hand, screen: &Screen) {
        let painter = ui.painter().with_clip_rect(screen.rect);
        let pointer = ui.input(|input| input.pointer.hover_pos());
        for overlay in Overlay::value_variants().iter().rev().filter(|overlay| self.has_overlay(**overlay)) {
            overlay.draw(&painter, hand.model(), (&hand.shape, &hand.pose), screen, pointer);
        }
    }

    /// Says what the colours mean.
    pub fn paint_legend(&self, ui: &Ui, rect: Rect, avatar: Option<&Avatar>) {
        if let Some(legend) = self.legend.as_ref().filter(|_| self.layer(avatar) != Layer::Albedo) {
            legend.show(ui, rect);
        }
    }
}

fn basis_count(avatar: Option<&Avatar>) -> usize {
    avatar.map_or(0, |avatar| avatar.config.shape_bases)
}

//! A hand that the viewer poses and shapes: by named poses, joint by joint, or by a motion.

use std::path::Path;
use std::sync::Arc;

use egui::{CollapsingHeader, RichText, Ui};
use ghand_avatar::{Avatar, Light};
use ghand_core::{HandModel, Pose};
use ghand_motion::PoseSequence;

use crate::bare_hand::BareHand;
use crate::pose_choice::pose_by_name;
use crate::shown::Shown;
use crate::viewer::light_panel::LightPanel;
use crate::viewer::pose_panel::PosePanel;
use crate::viewer::shape_panel::ShapePanel;
use crate::viewer::timeline::Timeline;

/// How a hand looks.
pub enum Look {
    /// As it was trained.
    Avatar(Box<Avatar>),
    /// As a mesh with skin and nails.
    Bare(Arc<BareHand>),
}

/// A hand, its pose and shape, and their controls.
pub struct Hand {
    look: Look,
    pub(crate) pose: Pose,
    /// Shape parameters; empty if the hand has none.
    pub(crate) shape: Vec<f64>,
    pub(crate) timeline: Option<Timeline>,
    pose_panel: PosePanel,
    shape_panel: ShapePanel,
    /// `None` if light is part of the colours.
    light_panel: Option<LightPanel>,
    /// The avatar in colours of what training saw; `None` if it does not know.
    views: Option<Look>,
    shown: Shown,
}

impl Hand {
    /// An avatar at rest.
    pub fn new(avatar: Avatar) -> Hand {
        Hand::with_look(Look::Avatar(Box::new(avatar)))
    }

    /// A hand model without an avatar, at rest in its mean shape.
    pub fn bare(model: HandModel) -> Hand {
        Hand::with_look(Look::Bare(Arc::new(BareHand::new(model))))
    }

    fn with_look(look: Look) -> Hand {
        let model = model(&look);
        let shape = vec![0.0; model.shape_count()];
        let (pose_panel, shape_panel) = (PosePanel::new(model), ShapePanel::new(model));
        let light_panel = match &look {
            Look::Avatar(avatar) => avatar.light.as_ref().map(|lit| LightPanel::new(&lit.light)),
            Look::Bare(_) => None,
        };
        let views = match &look {
            Look::Avatar(avatar) => avatar.colored_by_seen().map(|avatar| Look::Avatar(Box::new(avatar))),
            Look::Bare(_) => None,
        };
        let pose = Pose::rest(model.joint_count());
        let shown = Shown::default();
        Hand { pose, shape, timeline: None, pose_panel, shape_panel, light_panel, views, shown, look }
    }

    /// How it looks in the colours that are shown.
    pub fn look(&self) -> &Look {
        match (self.shown, &self.views) {
            (Shown::Views, Some(views)) => views,
            _ => &self.look,
        }
    }

    /// What its colours show.
    pub fn shown(&self) -> Shown {
        self.shown
    }

    /// The light on it, if light is apart from its skin.
    pub fn light(&self) -> Option<&Light> {
        self.light_panel.as_ref().map(LightPanel::light)
    }

    /// Its hand model.
    pub fn model(&self) -> &HandModel {
        model(&self.look)
    }

    /// Shows the first pose of a sequence, in its shape if that is of this hand, and plays the sequence if it has more.
    pub fn show(&mut self, title: String, sequence: PoseSequence) {
        if let Some(first) = sequence.frames.first() {
            self.pose = first.pose.clone();
            if first.shape.len() == self.shape.len() {
                self.shape.clone_from(&first.shape);
            }
        }
        self.timeline = (sequence.frames.len() > 1).then(|| Timeline::new(title, sequence));
    }

    /// The hand's name.
    pub fn name(&self) -> String {
        // The name of a model from a file is the file's path.
        let name = match &self.look {
            Look::Avatar(avatar) => &avatar.template.name,
            Look::Bare(hand) => &hand.model.name,
        };
        Path::new(name).file_name().map_or_else(|| name.clone(), |n| n.to_string_lossy().into_owned())
    }

    /// Takes a named pose, if the hand's joints are known, and stops a motion.
    pub fn take_pose(&mut self, name: &str) {
        if let Ok(pose) = pose_by_name(name, self.model()) {
            self.pose = pose;
            self.pause();
        }
    }

    /// Plays a named motion, if the hand's joints are known.
    pub fn play(&mut self, name: &str) {
        if let Some(timeline) = Timeline::named(name, self.model()) {
            self.timeline = Some(timeline);
        }
    }

    /// Plays the motion, or stops it.
    pub fn play_or_pause(&mut self) {
        if let Some(timeline) = &mut self.timeline {
            timeline.play_or_pause();
        }
    }

    /// Stops a motion where it is.
    pub fn pause(&mut self) {
        if let Some(timeline) = &mut self.timeline {
            timeline.pause();
        }
    }

    /// Resets the pose to the rest pose, the shape to the mean one, the light to the first one, the colours to skin, and a
    /// motion to its beginning.
    pub fn reset(&mut self) {
        self.pose = Pose::rest(self.model().joint_count());
        self.shape.fill(0.0);
        self.shown = Shown::default();
        if let Some(panel) = &mut self.light_panel {
            panel.reset();
        }
        if let Some(timeline) = &mut self.timeline {
            timeline.rewind();
        }
    }

    /// Shows the controls, and advances the motion that plays.
    pub fn controls(&mut self, ui: &mut Ui) {
        ui.label(RichText::new("Pose").strong());
        let mut posed = self.pose_panel.named_poses(ui, &mut self.pose);
        ui.add_space(4.0);
        CollapsingHeader::new("Joints").show(ui, |ui| posed |= self.pose_panel.joints(ui, &mut self.pose));
        if posed {
            // Manual posing stops playback.
            self.pause();
        }
        if !self.shape.is_empty() {
            CollapsingHeader::new("Shape").show(ui, |ui| self.shape_panel.sliders(ui, &mut self.shape));
        }
        if self.views.is_some() {
            ui.separator();
            ui.label(RichText::new("Show").strong());
            ui.horizontal(|ui| {
                ui.selectable_value(&mut self.shown, Shown::Skin, "skin");
                let hover = "How much the training views saw of each place, on a logarithmic scale: dark violet for \
                             nothing, green for as much as of most, yellow for ten times as much.";
                ui.selectable_value(&mut self.shown, Shown::Views, "views").on_hover_text(hover);
            });
        }
        if let (Some(panel), Shown::Skin) = (&mut self.light_panel, self.shown) {
            ui.separator();
            ui.label(RichText::new("Light").strong());
            panel.show(ui);
        }
        ui.separator();
        ui.label(RichText::new("Motion").strong());
        Timeline::show(&mut self.timeline, ui, model(&self.look), &mut self.pose);
    }
}

fn model(look: &Look) -> &HandModel {
    match look {
        Look::Avatar(avatar) => &avatar.model,
        Look::Bare(hand) => &hand.model,
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use ghand_avatar::AvatarConfig;
    use ghand_core::Side;
    use ghand_hand_model::builtin::builtin_hand;

    use super::*;

    /// The built-in hand as an untrained avatar.
    pub(crate) fn untrained_avatar() -> Avatar {
        let model = builtin_hand(Side::Right).unwrap();
        Avatar::untrained(&model, &AvatarConfig::default(), [0.86, 0.65, 0.54], 0).unwrap()
    }

    #[test]
    fn what_training_saw_is_shown_if_it_is_known() {
        use egui_kittest::Harness;
        use egui_kittest::kittest::Queryable;

        let mut avatar = untrained_avatar();
        let controls = |ui: &mut Ui, hand: &mut Hand| hand.controls(ui);
        assert!(Harness::new_ui_state(controls, Hand::new(avatar.clone())).query_by_label("views").is_none());
        avatar.seen = Some((0..avatar.template.len()).map(|p| p as f32).collect());
        let mut ui = Harness::new_ui_state(controls, Hand::new(avatar.clone()));
        let shown = |hand: &Hand| match hand.look() {
            Look::Avatar(shown) => shown.as_ref().clone(),
            Look::Bare(_) => panic!("no avatar"),
        };
        assert!(shown(ui.state()) == avatar);
        ui.get_by_label("views").click();
        ui.run();
        assert!(shown(ui.state()) == avatar.colored_by_seen().unwrap());
        ui.state_mut().reset();
        assert!(shown(ui.state()) == avatar);
    }

    #[test]
    fn a_pose_file_sets_the_shape_only_if_it_fits_and_reset_clears_it() {
        let mut hand = Hand::bare(builtin_hand(Side::Right).unwrap());
        let frame = |shape: Vec<f64>| ghand_motion::PoseFrame { id: "0".into(), pose: hand.pose.clone(), shape };
        let frames = [vec![0.5; 10], vec![1.0; 3], vec![]].map(frame);
        for (frame, expected) in frames.into_iter().zip([0.5, 0.5, 0.5]) {
            let joint_names = hand.model().joint_names.clone();
            hand.show("test".into(), PoseSequence { fps: 30.0, joint_names, frames: vec![frame], warnings: vec![] });
            assert_eq!(hand.shape, vec![expected; 10]);
        }
        hand.reset();
        assert_eq!(hand.shape, vec![0.0; 10]);
        assert!(Hand::new(untrained_avatar()).shape.is_empty(), "an avatar has the shape that it was trained in");
    }
}

//! A hand that the viewer poses and shapes: by named poses, joint by joint, or by a motion.
//! Beside it are its panels, its handles, its motion and what undo needs.

pub mod blend_control;
pub mod handles;
pub mod history;
pub mod key_strip;
pub mod light_panel;
pub mod pose_panel;
pub mod shape_panel;
pub mod thumbnails;
pub mod timeline;
pub mod timeline_panel;

use std::path::Path;
use std::sync::Arc;

use egui::{CollapsingHeader, Context, RichText, Ui};
use ghand_avatar::{Avatar, Light};
use ghand_core::posing::pose_hand;
use ghand_core::{HandModel, Pose};
use ghand_motion::pose_sequence::formats::ghand::{keyed_poses_json, poses_json};
use ghand_motion::pose_sequence::{DEFAULT_FPS, read_poses_bytes};
use ghand_motion::{KeyFrames, PoseFrame, PoseOptions, PoseSequence};
use ghand_render::Gpu;
use glam::DVec3;

use crate::bare_hand::BareHand;
use crate::pose_choice::pose_by_name;
use crate::viewer::hand::blend_control::BlendControl;
use crate::viewer::hand::handles::{HandleDrag, Handles};
use crate::viewer::hand::history::History;
use crate::viewer::hand::light_panel::LightPanel;
use crate::viewer::hand::pose_panel::PosePanel;
use crate::viewer::hand::shape_panel::ShapePanel;
use crate::viewer::hand::thumbnails::Thumbnails;
use crate::viewer::hand::timeline::Timeline;
use crate::viewer::hand::timeline_panel::{KeyRequest, timeline_panel};
use crate::viewer::rendering::drawn_subject::DrawnSubject;
use crate::viewer::rendering::screen::Screen;

/// The named pose to blend with at first.
const BLEND_TARGET: &str = "fist";

/// How a hand looks.
enum Look {
    /// As it was trained.
    Avatar(Arc<Avatar>),
    /// As a mesh with skin and nails.
    Bare(Arc<BareHand>),
}

/// What undo returns to.
#[derive(Debug, Clone)]
struct Edit {
    pose: Pose,
    shape: Vec<f64>,
    /// The motion at the position where it was then.
    timeline: Option<Timeline>,
}

impl Edit {
    fn keys(&self) -> Option<&KeyFrames> {
        self.timeline.as_ref().and_then(Timeline::keys)
    }
}

impl PartialEq for Edit {
    /// Choosing a motion is not an edit, and neither is moving in it: only keys are.
    fn eq(&self, other: &Edit) -> bool {
        self.pose == other.pose && self.shape == other.shape && self.keys() == other.keys()
    }
}

/// A hand, its pose and shape, and their controls.
pub struct Hand {
    look: Look,
    pub(crate) pose: Pose,
    /// Shape parameters; empty if the hand has none.
    pub(crate) shape: Vec<f64>,
    pub(crate) timeline: Option<Timeline>,
    pose_panel: PosePanel,
    blend: BlendControl,
    history: History<Edit>,
    handles: Option<Handles>,
    /// The joint whose slider the user points at.
    pointed_at: Option<usize>,
    /// What the user asks of the motion's keys.
    key_request: Option<KeyRequest>,
    shape_panel: ShapePanel,
    /// `None` if light is part of the colours.
    light_panel: Option<LightPanel>,
}

impl Hand {
    /// An avatar at rest.
    pub fn new(avatar: Avatar) -> Hand {
        Hand::with_look(Look::Avatar(Arc::new(avatar)))
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
        let pose = Pose::rest(model.joint_count());
        let blend = BlendControl::new(BLEND_TARGET, &pose);
        Hand {
            handles: Handles::new(model, &shape),
            history: History::new(Edit { pose: pose.clone(), shape: shape.clone(), timeline: None }),
            key_request: None,
            pose,
            shape,
            timeline: None,
            pose_panel,
            blend,
            pointed_at: None,
            shape_panel,
            light_panel,
            look,
        }
    }

    /// What is drawn of it.
    pub fn drawn(&self) -> DrawnSubject {
        match &self.look {
            Look::Avatar(avatar) => DrawnSubject::Avatar(avatar.clone()),
            Look::Bare(bare) => DrawnSubject::Bare(bare.clone()),
        }
    }

    /// The avatar, if it is one.
    pub fn avatar(&self) -> Option<&Avatar> {
        match &self.look {
            Look::Avatar(avatar) => Some(avatar),
            Look::Bare(_) => None,
        }
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

    /// Shows a motion of keys at its beginning, as [`Hand::motion_json`] has saved it.
    pub fn show_keys(&mut self, title: String, sequence: PoseSequence, keys: KeyFrames) {
        self.show(title.clone(), sequence);
        self.timeline = Some(Timeline::of_titled_keys(title, keys));
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

    fn present(&self) -> Edit {
        Edit { pose: self.pose.clone(), shape: self.shape.clone(), timeline: self.timeline.clone() }
    }

    /// Goes back to pose, shape and motion before the last edit.
    pub fn undo(&mut self) {
        if let Some(before) = self.history.undo(&self.present()).cloned() {
            self.take(before);
        }
    }

    /// Goes forward to pose, shape and motion that were undone.
    pub fn redo(&mut self) {
        if let Some(after) = self.history.redo(&self.present()).cloned() {
            self.take(after);
        }
    }

    fn take(&mut self, edit: Edit) {
        self.pose = edit.pose;
        if edit.shape.len() == self.shape.len() {
            self.shape = edit.shape;
        }
        match (edit.timeline, &mut self.timeline) {
            // Where the user is in a motion stays while its keys change.
            (Some(before), Some(present)) if before.keys().is_some() && present.keys().is_some() => {
                present.keys_mut().zip(before.keys()).into_iter().for_each(|(keys, before)| keys.clone_from(before));
            }
            (before, Some(present))
                if present.keys().is_none() && before.as_ref().is_none_or(|t| t.keys().is_none()) => {}
            // Keys come back, or what they had replaced.
            (before, present) => *present = before,
        }
        self.pause();
    }

    /// Whether there is something to undo and to redo.
    pub fn can_undo_and_redo(&self) -> [bool; 2] {
        let present = self.present();
        [self.history.can_undo(&present), self.history.can_redo(&present)]
    }

    /// Remembers pose, shape and motion for undo, unless a motion plays. It should not be called while the user is changing them, so
    /// that a whole drag is one step.
    pub fn remember_pose(&mut self) {
        if !self.is_playing() {
            self.history.remember(&self.present());
        }
    }

    /// Keeps the present pose as a key at the present position. Without keys they begin here, in place of another motion.
    pub fn set_key(&mut self) {
        self.pause();
        let timeline = match self.timeline.take() {
            Some(timeline) if timeline.keys().is_some() => timeline,
            _ => Timeline::of_keys(KeyFrames::default()),
        };
        let timeline = self.timeline.insert(timeline);
        let seconds = timeline.on_frame(timeline.seconds());
        timeline.go_to(seconds);
        if let Some(keys) = timeline.keys_mut() {
            keys.set(seconds, self.pose.clone());
        }
    }

    /// Deletes the key at the present position; without any key there is no motion.
    pub fn delete_key(&mut self) {
        let Some(timeline) = &mut self.timeline else { return };
        timeline.pause();
        let seconds = timeline.seconds();
        let Some(keys) = timeline.keys_mut() else { return };
        if let Some(index) = keys.at(seconds) {
            keys.remove(index);
        }
        if keys.keys().is_empty() {
            self.timeline = None;
        }
    }

    /// Goes to the previous key (`by` -1) or the next one (1).
    pub fn step_key(&mut self, by: i32) {
        let Some(timeline) = &mut self.timeline else { return };
        let Some(keys) = timeline.keys() else { return };
        let now = timeline.seconds();
        let times = keys.keys().iter().map(|key| key.seconds);
        let found = match by < 0 {
            true => times.rev().find(|time| *time < now - 1e-6),
            false => times.into_iter().find(|time| *time > now + 1e-6),
        };
        if let Some(seconds) = found {
            timeline.go_to(seconds);
            if let Some(pose) = timeline.pose() {
                self.pose = pose;
            }
        }
    }

    /// Whether there are keys, and one at the present position.
    pub fn has_keys_and_one_here(&self) -> [bool; 2] {
        let timeline = self.timeline.as_ref();
        let keys = timeline.and_then(Timeline::keys);
        let seconds = timeline.map_or(0.0, Timeline::seconds);
        [keys.is_some(), keys.is_some_and(|keys| keys.at(seconds).is_some())]
    }

    /// The motion as a file of poses, in ghand's own JSON, with the ids of the frames that are keys; `None` without one.
    pub fn motion_json(&self) -> Option<String> {
        let (sequence, _) = self.motion()?;
        let keys = self.timeline.as_ref().and_then(Timeline::keys);
        Some(match keys {
            Some(keys) => keyed_poses_json(&sequence, &keys.ids_in(&sequence), self.model()),
            None => poses_json(&sequence, self.model()),
        })
    }

    /// The motion at a constant rate, and the part of it that repeats, seconds; `None` without one.
    pub fn motion(&self) -> Option<(PoseSequence, [f64; 2])> {
        let timeline = self.timeline.as_ref()?;
        Some((timeline.sequence(&self.model().joint_names, &self.shape)?, timeline.range()))
    }

    /// What the user has asked for since with the buttons of the keys.
    pub fn take_key_request(&mut self) -> Option<KeyRequest> {
        self.key_request.take()
    }

    /// Takes over pose, shape and motion of another hand with the same joints.
    pub fn continue_from(&mut self, before: &Hand) {
        if self.model().joint_names != before.model().joint_names {
            return;
        }
        self.pose.clone_from(&before.pose);
        self.history.clone_from(&before.history);
        self.timeline.clone_from(&before.timeline);
        if self.shape.len() == before.shape.len() {
            self.shape.clone_from(&before.shape);
        }
    }

    /// Its vertices in the present pose and shape, metres, world.
    pub fn posed_vertices(&self) -> Vec<DVec3> {
        pose_hand(self.model(), &self.shape, &self.pose)
            .map_or_else(|_| self.model().vertices.clone(), |posed| posed.vertices)
    }

    /// The pose and the shape in ghand's own JSON.
    pub fn pose_json(&self) -> String {
        let frame = PoseFrame { id: "0000".into(), pose: self.pose.clone(), shape: self.shape.clone() };
        let joint_names = self.model().joint_names.clone();
        let sequence = PoseSequence { fps: DEFAULT_FPS, joint_names, frames: vec![frame], warnings: vec![] };
        poses_json(&sequence, self.model())
    }

    /// Shows poses from text in any format that has one: the inverse of [`Hand::pose_json`]. Returns remarks for the
    /// user.
    ///
    /// # Errors
    /// One sentence that says what is wrong with the text; the pose stays.
    pub fn paste(&mut self, text: &str) -> anyhow::Result<Vec<String>> {
        let sequence = read_poses_bytes("clipboard", text.as_bytes(), self.model(), &PoseOptions::default())?;
        let warnings = sequence.warnings.clone();
        self.show("pasted".into(), sequence);
        Ok(warnings)
    }

    /// The handles on its joints, if these are known.
    pub fn handles(&mut self) -> Option<&Handles> {
        if self.handles.as_ref().is_some_and(|handles| !handles.fit(&self.shape)) {
            self.handles = Handles::new(model(&self.look), &self.shape);
        }
        self.handles.as_ref()
    }

    /// Drags a handle by an offset in points. This stops a motion.
    pub fn drag_handle(&mut self, drag: &mut HandleDrag, screen: &Screen, by: egui::Vec2) {
        self.pause();
        if let Some(handles) = &self.handles {
            handles.drag(drag, &mut self.pose, screen, by);
        }
    }

    /// The joint whose slider the user points at.
    pub fn pointed_at(&self) -> Option<usize> {
        self.pointed_at
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

    /// Resets the pose to the rest pose, the shape to the mean one, the light to the first one, and a motion to its
    /// beginning.
    pub fn reset(&mut self) {
        self.pose = Pose::rest(self.model().joint_count());
        self.shape.fill(0.0);
        if let Some(panel) = &mut self.light_panel {
            panel.reset();
        }
        if let Some(timeline) = &mut self.timeline {
            timeline.rewind();
        }
    }

    /// Whether a motion plays.
    pub fn is_playing(&self) -> bool {
        self.timeline.as_ref().is_some_and(Timeline::is_playing)
    }

    /// Advances the motion that plays.
    pub fn advance(&mut self, context: &Context) {
        if let Some(now) = self.timeline.as_mut().and_then(|timeline| timeline.advance(context)) {
            self.pose = now;
        }
    }

    /// Has the pictures of the named poses made, while the view does not need the device.
    pub fn follow_thumbnails(&mut self, gpu: &Gpu, shown: bool, is_busy: bool, context: &Context) {
        self.pose_panel.show_thumbnails(shown);
        let is_begun = self.pose_panel.thumbnails_mut().is_begun();
        if shown && !is_begun && !is_busy {
            let poses = self.pose_panel.named().iter().map(|(_, pose)| pose.clone()).collect();
            let subject = self.drawn();
            let model = model(&self.look);
            self.pose_panel.thumbnails_mut().begin(gpu, subject, model, poses, context);
        }
        self.pose_panel.thumbnails_mut().advance(is_busy || !shown, context);
    }

    /// The picture of a named pose, once it is made.
    #[cfg(test)]
    pub(crate) fn thumbnail(&mut self, pose: usize) -> Option<&egui::TextureHandle> {
        self.pose_panel.thumbnails_mut().get(pose)
    }

    /// Waits until the pictures of the named poses are made, if they are begun. Returns whether all were there already or none
    /// are shown.
    pub fn wait_for_thumbnails(&mut self, context: &Context) -> bool {
        !self.pose_panel.shows_thumbnails() || self.pose_panel.thumbnails_mut().wait(context)
    }

    /// Forgets the pictures of the named poses: they belong to a user interface that has ended.
    pub fn forget_thumbnails(&mut self) {
        *self.pose_panel.thumbnails_mut() = Thumbnails::default();
    }

    /// Shows the controls.
    pub fn controls(&mut self, ui: &mut Ui) {
        ui.label(RichText::new("Pose").strong());
        let mut posed = self.pose_panel.named_poses(ui, &mut self.pose);
        ui.add_space(4.0);
        posed |= self.blend.show(ui, self.pose_panel.named(), &mut self.pose);
        let joints = CollapsingHeader::new("Joints").show(ui, |ui| self.pose_panel.joints(ui, &mut self.pose));
        let joints = joints.body_returned.unwrap_or_default();
        self.pointed_at = joints.pointed_at;
        if posed || joints.moved {
            // Manual posing stops playback.
            self.pause();
        }
        if !self.shape.is_empty() {
            CollapsingHeader::new("Shape").show(ui, |ui| self.shape_panel.sliders(ui, &mut self.shape));
        } else if self.avatar().is_some() {
            let hover = "An avatar keeps the shape of the hand that it was trained on.";
            ui.label(RichText::new("Shape: as trained").weak()).on_hover_text(hover);
        }
        if let Some(panel) = &mut self.light_panel {
            ui.separator();
            ui.label(RichText::new("Light").strong());
            panel.show(ui);
        }
        ui.separator();
        ui.label(RichText::new("Motion").strong());
        self.key_request = timeline_panel(&mut self.timeline, ui, model(&self.look), &mut self.pose);
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
    fn a_pose_file_sets_the_shape_only_if_it_fits_and_reset_clears_it() {
        let mut hand = Hand::bare(builtin_hand(Side::Right).unwrap());
        let frame = |shape: Vec<f64>| PoseFrame { id: "0".into(), pose: hand.pose.clone(), shape };
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

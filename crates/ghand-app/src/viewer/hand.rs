//! A hand that the viewer poses: by named poses, joint by joint, or by a motion.

use std::path::Path;

use egui::{CollapsingHeader, RichText, Ui};
use ghand_avatar::Avatar;
use ghand_core::Pose;
use ghand_motion::PoseSequence;

use crate::viewer::pose_panel::PosePanel;
use crate::viewer::timeline::Timeline;

/// An avatar, its pose, and the controls of that pose.
pub struct Hand {
    pub(crate) avatar: Avatar,
    pub(crate) pose: Pose,
    pub(crate) timeline: Option<Timeline>,
    panel: PosePanel,
}

impl Hand {
    /// An avatar at rest.
    pub fn new(avatar: Avatar) -> Hand {
        let (panel, pose) = (PosePanel::new(&avatar.model), Pose::rest(avatar.model.joint_count()));
        Hand { avatar, pose, timeline: None, panel }
    }

    /// The avatar.
    pub fn avatar(&self) -> &Avatar {
        &self.avatar
    }

    /// Shows the first pose of a sequence, and plays the sequence if it has more.
    pub fn show(&mut self, title: String, sequence: PoseSequence) {
        if let Some(first) = sequence.frames.first() {
            self.pose = first.pose.clone();
        }
        self.timeline = (sequence.frames.len() > 1).then(|| Timeline::new(title, sequence));
    }

    /// The hand's name.
    pub fn name(&self) -> String {
        // The name of a model from a file is the file's path.
        let name = &self.avatar.template.name;
        Path::new(name).file_name().map_or_else(|| name.clone(), |n| n.to_string_lossy().into_owned())
    }

    /// Stops a motion where it is.
    pub fn pause(&mut self) {
        if let Some(timeline) = &mut self.timeline {
            timeline.pause();
        }
    }

    /// Resets the pose to the rest pose and a motion to its beginning.
    pub fn reset(&mut self) {
        self.pose = Pose::rest(self.avatar.model.joint_count());
        if let Some(timeline) = &mut self.timeline {
            timeline.rewind();
        }
    }

    /// Shows the controls, and advances the motion that plays.
    pub fn controls(&mut self, ui: &mut Ui) {
        ui.label(RichText::new("Pose").strong());
        let mut posed = self.panel.named_poses(ui, &mut self.pose);
        ui.add_space(4.0);
        CollapsingHeader::new("Joints").show(ui, |ui| posed |= self.panel.joints(ui, &mut self.pose));
        if posed {
            // Manual posing stops playback.
            self.pause();
        }
        ui.separator();
        ui.label(RichText::new("Motion").strong());
        Timeline::show(&mut self.timeline, ui, &self.avatar.model, &mut self.pose);
    }
}

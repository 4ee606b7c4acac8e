//! Poses of a skeleton in glTF: of its nodes, and as animations.

use ghand_core::{HandModel, Pose};
use glam::{DQuat, DVec3};
use serde_json::{Value, json};

use crate::HandModelError;
use crate::files::glb_document::GlbDocument;

/// A motion, whose frames are interpolated.
#[derive(Debug, Clone, Copy)]
pub struct Motion<'a> {
    /// Its name.
    pub name: &'a str,
    /// Frames per second.
    pub fps: f64,
    /// The poses, at least one.
    pub poses: &'a [Pose],
    /// Weights of the pose correctives at some frames, ascending; none if the file has no correctives.
    pub correctives: &'a [CorrectiveKey],
}

/// How much of each pose corrective is in a frame.
#[derive(Debug, Clone, PartialEq)]
pub struct CorrectiveKey {
    /// Number of the frame.
    pub frame: usize,
    /// Weights, K.
    pub weights: Vec<f64>,
}

/// The rotation of a joint's node: nodes have no rotation at rest, so that it is the pose's own.
fn node_rotation(rotation: DVec3) -> DQuat {
    DQuat::from_scaled_axis(rotation)
}

/// The place of the root's node. The others are fixed to their parents.
fn root_translation(model: &HandModel, pose: &Pose) -> DVec3 {
    model.joints.first().copied().unwrap_or_default() + pose.translation
}

/// Fails unless a pose is one of the model's, in finite numbers.
fn check(model: &HandModel, pose: &Pose) -> Result<(), HandModelError> {
    let problem = if pose.rotations.len() != model.joint_count() {
        format!("has {} rotations, the model has {} joints", pose.rotations.len(), model.joint_count())
    } else if !pose.rotations.iter().chain([&pose.translation]).all(|v| v.as_vec3().is_finite()) {
        "has a number that is not finite, or too large for the file; check the pose".into()
    } else {
        return Ok(());
    };
    Err(HandModelError::invalid(model.name.clone(), "pose", problem))
}

/// Poses the nodes of the joints.
pub(super) fn pose_nodes(nodes: &mut [Value], model: &HandModel, pose: &Pose) -> Result<(), HandModelError> {
    check(model, pose)?;
    for (node, rotation) in nodes.iter_mut().zip(&pose.rotations) {
        node["rotation"] = json!(node_rotation(*rotation).as_quat().normalize().to_array());
    }
    if let Some(root) = nodes.first_mut() {
        root["translation"] = json!(root_translation(model, pose).as_vec3().to_array());
    }
    Ok(())
}

impl Motion<'_> {
    /// Adds the motion as an animation: a channel for each joint that turns, and one for the root's place. Joints that
    /// do not move have none, but that of the root: an animation without channels would be invalid.
    pub(super) fn add(
        &self,
        document: &mut GlbDocument<'_>,
        model: &HandModel,
        correctives: usize,
    ) -> Result<(), HandModelError> {
        self.poses.iter().try_for_each(|pose| check(model, pose))?;
        let fits = |key: &CorrectiveKey| key.weights.len() == correctives && key.frame < self.poses.len();
        if !self.correctives.iter().all(fits) {
            let problem = format!("of the motion {} do not fit its frames and {correctives} correctives", self.name);
            return Err(HandModelError::invalid(model.name.clone(), "weights", problem));
        }
        let seconds: Vec<f32> = (0..self.poses.len()).map(|k| (k as f64 / self.fps) as f32).collect();
        let times = document.times(&seconds);
        let mut channels = vec![];
        let mut samplers = vec![];
        let mut add = |node: usize, path: &str, times: usize, output: usize| {
            channels.push(json!({"sampler": samplers.len(), "target": {"node": node, "path": path}}));
            samplers.push(json!({"input": times, "output": output, "interpolation": "LINEAR"}));
        };
        for joint in 0..model.joint_count() {
            let rotations = continuous(self.poses.iter().map(|pose| node_rotation(pose.rotations[joint])));
            if joint == 0 || rotations.iter().any(|q| *q != DQuat::IDENTITY) {
                let values = rotations.iter().flat_map(|q| q.as_quat().normalize().to_array());
                add(joint, "rotation", times, document.channel(values, "VEC4"));
            }
        }
        let places = self.poses.iter().flat_map(|pose| root_translation(model, pose).as_vec3().to_array());
        add(0, "translation", times, document.channel(places, "VEC3"));
        if correctives > 0 && !self.correctives.is_empty() {
            let at: Vec<f32> = self.correctives.iter().map(|key| (key.frame as f64 / self.fps) as f32).collect();
            let times = document.times(&at);
            // Shapes have weights, too, and keep them.
            let shapes = vec![0.0; model.shape_count()];
            let weights = self.correctives.iter().flat_map(|key| shapes.iter().chain(&key.weights));
            // The node of the mesh follows the joints.
            add(model.joint_count(), "weights", times, document.channel(weights.map(|w| *w as f32), "SCALAR"));
        }
        document.push("animations", json!({"name": self.name, "channels": channels, "samplers": samplers}));
        Ok(())
    }
}

/// The rotations with signs such that each is on the side of the one before. Programs interpolate the shorter way, but
/// some only the numbers.
fn continuous(rotations: impl Iterator<Item = DQuat>) -> Vec<DQuat> {
    let mut continuous: Vec<DQuat> = vec![];
    for rotation in rotations {
        let is_opposite = continuous.last().is_some_and(|before| before.dot(rotation) < 0.0);
        continuous.push(if is_opposite { -rotation } else { rotation });
    }
    continuous
}

//! A hand on the stage: its avatar, its pose, and what drives it.

use std::rc::Rc;

use ghand_avatar::Avatar;
use ghand_core::{HandModel, Pose};
use ghand_hand_model::joints::axes::JointAxes;
use ghand_hand_model::named_poses::{POSE_NAMES, named_pose};
use ghand_motion::live::{LiveOptions, LivePoses};
use ghand_motion::motions::{MOTION_NAMES, motion};
use ghand_motion::pose_sequence::{DEFAULT_FPS, between, read_poses_bytes};
use ghand_motion::{PoseOptions, PoseSequence};
use glam::DVec3;

use crate::layer::Layer;

/// A motion that is played.
#[derive(Debug, Clone)]
pub struct Playback {
    /// Its poses.
    pub sequence: PoseSequence,
    /// The place in it, seconds.
    pub time: f64,
    /// Whether time passes.
    pub playing: bool,
    /// Whether it begins again at its end.
    pub repeat: bool,
    /// Seconds of the motion for each second.
    pub speed: f64,
}

/// What changes the pose with time.
#[derive(Debug, Clone)]
enum Drive {
    /// Nothing.
    Still,
    /// A transition between two poses; `passed` of `duration` seconds are over.
    Transition { from: Pose, to: Pose, passed: f64, duration: f64 },
    /// A motion.
    Motion(Playback),
}

/// A hand on the stage.
pub struct Hand {
    avatar: Rc<Avatar>,
    /// The avatar in the colours of the layer that is shown.
    shown: Rc<Avatar>,
    axes: Option<Vec<JointAxes>>,
    pose: Pose,
    drive: Drive,
    live: LivePoses,
    /// Where the hand is moved to beside its pose, metres, world.
    pub place: DVec3,
}

impl Hand {
    /// The avatar at rest.
    pub fn new(avatar: Avatar) -> Hand {
        let pose = Pose::rest(avatar.model.joint_count());
        let axes = JointAxes::of_joints(&avatar.model);
        let avatar = Rc::new(avatar);
        let shown = avatar.clone();
        Hand { avatar, shown, axes, pose, drive: Drive::Still, live: LivePoses::default(), place: DVec3::ZERO }
    }

    /// Its avatar.
    pub fn avatar(&self) -> &Rc<Avatar> {
        &self.avatar
    }

    /// The avatar in the colours of the layer that is shown.
    pub fn shown(&self) -> &Rc<Avatar> {
        &self.shown
    }

    /// Shows a layer.
    ///
    /// # Errors
    /// One sentence if the avatar lacks it.
    pub fn show(&mut self, layer: Layer) -> Result<(), String> {
        self.shown = match layer {
            Layer::Skin => self.avatar.clone(),
            other => Rc::new(other.shown(&self.avatar).ok_or_else(|| {
                let layers = Layer::ALL.into_iter().filter(|layer| layer.is_of(&self.avatar)).map(Layer::name);
                format!("the avatar has no layer {:?}; it has {}", other.name(), layers.collect::<Vec<_>>().join(", "))
            })?),
        };
        Ok(())
    }

    /// Its hand model.
    pub fn model(&self) -> &HandModel {
        &self.avatar.model
    }

    /// Its pose now.
    pub fn pose(&self) -> &Pose {
        &self.pose
    }

    /// The motion that is played or paused, if any.
    pub fn playback(&self) -> Option<&Playback> {
        match &self.drive {
            Drive::Motion(playback) => Some(playback),
            Drive::Still | Drive::Transition { .. } => None,
        }
    }

    /// The motion that is played or paused, mutable.
    pub fn playback_mut(&mut self) -> Option<&mut Playback> {
        match &mut self.drive {
            Drive::Motion(playback) => Some(playback),
            Drive::Still | Drive::Transition { .. } => None,
        }
    }

    /// Goes to a pose in some seconds, at once for 0.
    ///
    /// # Errors
    /// One sentence if the pose is not one of this hand.
    pub fn go_to(&mut self, pose: Pose, seconds: f64) -> Result<(), String> {
        let joints = self.model().joint_count();
        if pose.rotations.len() != joints {
            return Err(format!("the pose has {} joints, and the hand {joints}", pose.rotations.len()));
        }
        pose.check_range(&self.model().joint_names).map_err(|error| error.to_string())?;
        if seconds > 0.0 && seconds.is_finite() {
            self.drive = Drive::Transition { from: self.pose.clone(), to: pose, passed: 0.0, duration: seconds };
        } else {
            self.pose = pose;
            self.drive = Drive::Still;
        }
        Ok(())
    }

    /// The pose of that name.
    ///
    /// # Errors
    /// One sentence that lists the names, or says that the hand's joints have unknown names.
    pub fn named(&self, name: &str) -> Result<Pose, String> {
        if !POSE_NAMES.contains(&name) {
            return Err(format!("there is no pose {name:?}; there are {}", POSE_NAMES.join(", ")));
        }
        if name == "rest" {
            return Ok(Pose::rest(self.model().joint_count()));
        }
        named_pose(name, self.model())
            .ok_or_else(|| "the names of the hand's joints do not identify its fingers".into())
    }

    /// Poses of a file of any kind that ghand reads; `name` is for messages.
    ///
    /// # Errors
    /// One sentence with name, field and remedy.
    pub fn read_poses(&self, name: &str, bytes: &[u8]) -> Result<PoseSequence, String> {
        read_poses_bytes(name, bytes, self.model(), &PoseOptions::default()).map_err(|error| error.to_string())
    }

    /// The motion of that name.
    ///
    /// # Errors
    /// One sentence that lists the names, or says that the hand's joints have unknown names.
    pub fn motion(&self, name: &str) -> Result<PoseSequence, String> {
        match motion(name, self.model(), DEFAULT_FPS) {
            Some(found) => found.map_err(|error| error.to_string()),
            None => Err(format!("there is no motion {name:?}; there are {}", MOTION_NAMES.join(", "))),
        }
    }

    /// Plays a motion from its beginning.
    pub fn play(&mut self, sequence: PoseSequence, repeat: bool) {
        self.drive = Drive::Motion(Playback { sequence, time: 0.0, playing: true, repeat, speed: 1.0 });
        self.take_motion();
    }

    /// Goes to a time of the motion, seconds.
    pub fn seek(&mut self, seconds: f64) {
        if let Drive::Motion(playback) = &mut self.drive {
            playback.time = if seconds.is_finite() { seconds.clamp(0.0, playback.sequence.duration()) } else { 0.0 };
        }
        self.take_motion();
    }

    fn take_motion(&mut self) {
        if let Drive::Motion(playback) = &self.drive
            && let Some(pose) = playback.sequence.pose_at(playback.time)
        {
            self.pose = pose;
        }
    }

    /// Takes the pose of a packet, as `viewer --live` does; `seconds` is when it came.
    ///
    /// # Errors
    /// One sentence that says what is wrong with the packet, or that it does not show this hand.
    pub fn take_packet(&mut self, packet: &[u8], seconds: f64, options: &LiveOptions) -> Result<(), String> {
        let live = self.live.read(packet, &self.avatar.model, seconds, options).map_err(|error| error.to_string())?;
        self.pose = live.pose;
        self.drive = Drive::Still;
        Ok(())
    }

    /// Flexion, abduction and twist of a joint, radians; `None` if the joints have unknown names, or there is no such joint.
    pub fn angles(&self, joint: usize) -> Option<DVec3> {
        Some(self.axes.as_ref()?.get(joint)?.angles(*self.pose.rotations.get(joint)?))
    }

    /// Sets flexion, abduction and twist of a joint, radians, and stops what drives the hand.
    ///
    /// # Errors
    /// One sentence if there is no such joint, or its angles are out of range.
    pub fn set_angles(&mut self, joint: usize, angles: DVec3) -> Result<(), String> {
        let axes = self.axes.as_ref().and_then(|axes| axes.get(joint));
        let axes = axes.ok_or_else(|| format!("joint {joint} does not exist, or has no known axes"))?;
        let mut pose = self.pose.clone();
        if let Some(rotation) = pose.rotations.get_mut(joint) {
            *rotation = axes.rotation(angles);
        }
        self.go_to(pose, 0.0)
    }

    /// Lets `seconds` pass; says whether the pose has changed.
    pub fn advance(&mut self, seconds: f64) -> bool {
        match &mut self.drive {
            Drive::Still => false,
            Drive::Transition { from, to, passed, duration } => {
                *passed += seconds;
                let part = (*passed / *duration).clamp(0.0, 1.0);
                // No speed at both ends.
                self.pose = between(from, to, part * part * (3.0 - 2.0 * part));
                if part >= 1.0 {
                    self.pose = to.clone();
                    self.drive = Drive::Still;
                }
                true
            }
            Drive::Motion(playback) => {
                if !playback.playing {
                    return false;
                }
                let end = playback.sequence.duration();
                playback.time += seconds * playback.speed;
                if playback.time >= end || playback.time < 0.0 {
                    if playback.repeat && end > 0.0 {
                        playback.time = playback.time.rem_euclid(end);
                    } else {
                        playback.time = playback.time.clamp(0.0, end);
                        playback.playing = false;
                    }
                }
                self.take_motion();
                true
            }
        }
    }

    /// Whether its pose changes with time now.
    pub fn is_moving(&self) -> bool {
        match &self.drive {
            Drive::Still => false,
            Drive::Transition { .. } => true,
            Drive::Motion(playback) => playback.playing,
        }
    }
}

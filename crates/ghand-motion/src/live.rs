//! Poses that arrive one packet at a time, from a tracker or another program.
//!
//! A packet is JSON with one frame, in any of the forms that [`crate::pose_sequence`] reads from files: joints of WebXR
//! or OpenXR, MediaPipe's world landmarks, MANO parameters, or ghand's own pose. If it shows both hands, the model's is
//! taken. `sent_ms` beside them is when it was sent, milliseconds of Unix time.
//!
//! [`LivePoses`] remembers what makes a stream quick and steady: the size of the tracked hand, the last pose, from
//! which the fit to landmarks starts, and the filter ([`crate::one_euro`]). With the feature `live-port`, `port` receives
//! packets.

#[cfg(feature = "live-port")]
pub mod port;

use std::collections::VecDeque;

use ghand_core::{HandModel, Pose, Side};
use ghand_files::value::Value;
use glam::DVec3;

use crate::PoseError;
use crate::ik::{HandIk, LANDMARK_COUNT};
use crate::one_euro::PoseFilter;
use crate::pose_sequence::{Motion, PoseOptions, Recording, Source, mano_rows, recording, rows};
use crate::rest_skeleton::RestSkeleton;
use crate::retarget::{Retarget, mirrored_point};

/// Largest packet, bytes: both hands as matrices take about 16 KiB, and a datagram cannot be larger.
pub const LARGEST_PACKET: usize = 64 << 10;

/// The name of a packet in messages. No file is opened by this name.
const ORIGIN: &str = "packet";
/// A packet that shows only the other hand is mirrored, unless one of the last seconds, this many, showed the model's:
/// a tracker of both hands may lose one for a moment.
const OTHER_HAND_AFTER: f64 = 1.0;
/// Number of the last frames of landmarks that the lengths of the bones are taken from.
const SIZE_FRAMES: usize = 60;

/// What a packet contains.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PacketKind {
    /// Joints of WebXR or OpenXR.
    XrJoints,
    /// MediaPipe's landmarks.
    Landmarks,
    /// Rotations of MANO's joints.
    Mano,
    /// ghand's own pose.
    Pose,
}

impl PacketKind {
    /// Its name for users.
    pub fn title(self) -> &'static str {
        match self {
            PacketKind::XrJoints => "XR joints",
            PacketKind::Landmarks => "landmarks",
            PacketKind::Mano => "MANO",
            PacketKind::Pose => "pose",
        }
    }
}

/// What to do with the poses of a stream.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LiveOptions {
    /// Whether poses are smoothed; `None` to smooth only landmarks, because they are noisy.
    pub smooth: Option<bool>,
    /// Whether the wrist stays where the model has it: the hand turns and bends, but does not leave the view.
    pub in_place: bool,
    /// Whether packets that show only the other hand are refused instead of mirrored: for scenes with both.
    pub own_side_only: bool,
}

impl Default for LiveOptions {
    fn default() -> Self {
        LiveOptions { smooth: None, in_place: true, own_side_only: false }
    }
}

/// The pose of a packet.
#[derive(Debug, Clone, PartialEq)]
pub struct LivePose {
    /// What the packet contained.
    pub kind: PacketKind,
    /// One rotation for each joint of the model.
    pub pose: Pose,
    /// When it was sent, milliseconds of Unix time, if the packet says.
    pub sent_ms: Option<f64>,
}

/// Makes poses of one hand model from the packets of a stream.
#[derive(Debug, Clone, Default)]
pub struct LivePoses {
    /// Made with the first packet that needs it.
    skeleton: Option<Skeleton>,
    /// The last landmarks, for the size of the hand.
    seen: VecDeque<[DVec3; LANDMARK_COUNT]>,
    /// The pose of the last landmarks, before it was smoothed.
    before: Option<Pose>,
    filter: PoseFilter,
    /// When a packet last showed the model's hand, seconds.
    own_hand_at: Option<f64>,
}

/// The model's skeleton, prepared for the forms that need it.
#[derive(Debug, Clone)]
struct Skeleton {
    own: RestSkeleton,
    ik: HandIk,
}

impl Skeleton {
    /// The skeleton in `kept`, which is made for the model if there is none.
    fn kept<'a>(kept: &'a mut Option<Skeleton>, model: &HandModel) -> Result<&'a Skeleton, PoseError> {
        let skeleton = match kept.take() {
            Some(skeleton) => skeleton,
            None => {
                let own = RestSkeleton::of(model)?;
                Skeleton { ik: HandIk::new(&own), own }
            }
        };
        Ok(kept.insert(skeleton))
    }
}

impl LivePoses {
    /// The pose of a packet for a model, which must be the same for all packets. `seconds` is when it arrived, from any
    /// beginning.
    ///
    /// # Errors
    /// [`PoseError`] says what is wrong with the packet. It changes nothing for the packets after it.
    pub fn read(
        &mut self,
        packet: &[u8],
        model: &HandModel,
        seconds: f64,
        options: &LiveOptions,
    ) -> Result<LivePose, PoseError> {
        let source = Source {
            origin: ORIGIN,
            wanted: model.side,
            take: None,
            joint_count: model.joint_count(),
            model,
            pose_model: None,
        };
        let value = json(&source, packet)?;
        let Recording { side, motion, .. } = recording(&source, &value)?;
        let side = match &motion {
            Motion::Rows(rows) if rows.capture_kind.is_some() => {
                return Err(source.invalid("format", "is a capture; send the pose of one frame".into()));
            }
            Motion::Rows(rows) => rows.rig.as_ref().and_then(|rig| rig.side).or(rows.side).or(side),
            _ => side,
        };
        let side = side.unwrap_or(model.side);
        self.check_side(&source, side, seconds, options.own_side_only)?;
        let ignored = &mut Vec::new();
        let no_options = PoseOptions::default();
        let (kind, mut pose) = match motion {
            Motion::WebXr { frames } => {
                let frame = only(&source, frames)?;
                let own = &Skeleton::kept(&mut self.skeleton, model)?.own;
                (PacketKind::XrJoints, Retarget::new(RestSkeleton::webxr(side), own).pose(&frame.pose))
            }
            Motion::Landmarks { frames, .. } => {
                let points = only(&source, frames)?.points;
                let points = if side == model.side { points } else { points.map(mirrored_point) };
                (PacketKind::Landmarks, self.fit(&source, &points)?)
            }
            Motion::ImageLandmarks { .. } => {
                let problem = "are those of images; send MediaPipe's world landmarks (worldLandmarks)";
                return Err(source.invalid("landmarks", problem.into()));
            }
            Motion::Mano(found) => {
                let frames = mano_rows(found, side, model, &no_options, ignored)?;
                (PacketKind::Mano, only(&source, frames)?.pose)
            }
            Motion::Rows(found) => {
                let (frames, _) = rows(&source, *found, model, &no_options, ignored)?;
                (PacketKind::Pose, only(&source, frames)?.pose)
            }
        };
        if options.in_place {
            pose.translation = DVec3::ZERO;
        }
        pose.check_range(&model.joint_names).map_err(|error| source.invalid("pose", error.to_string()))?;
        if side == model.side {
            self.own_hand_at = Some(seconds);
        }
        if options.smooth.unwrap_or(kind == PacketKind::Landmarks) {
            pose = self.filter.smooth(&pose, seconds);
        } else {
            self.filter.reset();
        }
        Ok(LivePose { kind, pose, sent_ms: value.get("sent_ms").and_then(Value::number) })
    }

    fn check_side(&self, source: &Source, side: Side, seconds: f64, own_only: bool) -> Result<(), PoseError> {
        let own = source.model.side;
        let is_recent = self.own_hand_at.is_some_and(|at| seconds - at < OTHER_HAND_AFTER);
        if side == own || !(own_only || is_recent) {
            return Ok(());
        }
        if own_only {
            return Err(source.invalid("side", format!("shows only a {side} hand, and this is a {own} one")));
        }
        Err(source.invalid("side", format!("shows only a {side} hand, just after packets with a {own} one")))
    }

    /// The pose that places the model's joints at the landmarks, as far as its skeleton allows.
    fn fit(&mut self, source: &Source, points: &[DVec3; LANDMARK_COUNT]) -> Result<Pose, PoseError> {
        let ik = &Skeleton::kept(&mut self.skeleton, source.model)?.ik;
        self.seen.push_back(*points);
        let solution = ik.fitted(self.seen.make_contiguous()).solve(points, self.before.as_ref());
        let Some(solution) = solution else {
            self.seen.pop_back();
            let problem = "are not a hand: they are at one point or on a line";
            return Err(source.invalid("landmarks", problem.into()));
        };
        if self.seen.len() > SIZE_FRAMES {
            self.seen.pop_front();
        }
        self.before = Some(solution.pose.clone());
        Ok(solution.pose)
    }
}

/// The content of a packet.
fn json(source: &Source, packet: &[u8]) -> Result<Value, PoseError> {
    let invalid = |problem: String| source.invalid("content", problem);
    if packet.len() > LARGEST_PACKET {
        return Err(invalid(format!("is larger than {} KiB; send one frame per packet", LARGEST_PACKET >> 10)));
    }
    if !matches!(packet.trim_ascii_start().first(), Some(b'{' | b'[')) {
        return Err(invalid("is not JSON; send an object or a list as text".into()));
    }
    Value::from_bytes(packet).map_err(|error| invalid(error.to_string()))
}

/// The one frame of a packet.
fn only<T>(source: &Source, frames: Vec<T>) -> Result<T, PoseError> {
    let count = frames.len();
    let problem = || source.invalid("frames", format!("are {count}; send one frame per packet"));
    frames.into_iter().next().filter(|_| count == 1).ok_or_else(problem)
}

#[cfg(test)]
mod tests;

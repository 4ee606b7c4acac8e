//! The poses over which an avatar is baked, and those on which the result is judged.

use anyhow::bail;
use ghand_avatar::Avatar;
use ghand_avatar::bake::FEWEST_POSES;
use ghand_capture::Capture;
use ghand_core::{HandModel, Pose};
use ghand_hand_model::joints::limits::random_pose;
use ghand_hand_model::named_poses::POSE_NAMES;
use ghand_motion::motions::{MOTION_NAMES, motion};
use ghand_motion::pose_sequence::{DEFAULT_FPS, between};
use glam::DVec3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::pose_choice::pose_by_name;

/// Which poses an avatar is baked over.
#[derive(Debug, Clone)]
pub struct PoseSetOptions {
    /// Poses to fit beside the others.
    pub given: Vec<NamedPose>,
    /// Frames per second of motions, of which some are taken.
    pub fps: f64,
    /// Number of poses to fit.
    pub fit: usize,
    /// Seed of the random poses.
    pub seed: u64,
}

impl Default for PoseSetOptions {
    fn default() -> Self {
        PoseSetOptions { given: vec![], fps: DEFAULT_FPS, fit: DEFAULT_FIT, seed: 1 }
    }
}

/// A pose and where it comes from.
#[derive(Debug, Clone)]
pub struct NamedPose {
    /// A name for people.
    pub name: String,
    /// The pose. The hand stays where it is at rest: where it is and how it is turned changes nothing that is baked.
    pub pose: Pose,
}

/// Poses by their use.
pub struct PoseSet {
    /// To be fitted.
    pub fitted: Vec<NamedPose>,
    /// Natural ones to judge by.
    pub held_out: Vec<NamedPose>,
    /// Random ones within the joints' limits to judge by.
    pub extreme: Vec<NamedPose>,
}

/// Poses to fit.
pub const DEFAULT_FIT: usize = 400;
/// Frames per second at which motions are sampled.
const MOTION_FPS: f64 = 5.0;
/// Every so many of the natural poses are held out.
const HELD_OUT_EVERY: usize = 8;
/// Most natural poses that are judged by.
const MOST_HELD_OUT: usize = 16;
/// Random poses that are judged by.
const EXTREME: usize = 24;
/// The part of the fitted poses that are random ones, and the part that lie between natural poses.
const RANDOM_PART: f64 = 0.3;
const BETWEEN_PART: f64 = 0.2;

impl PoseSet {
    /// Natural poses are those by name, the motions, those of the capture's frames that are not in a split, and those that the
    /// user names; between two of them, and at random within the joints' limits, there are more.
    ///
    /// # Errors
    /// An error if there are too few poses.
    pub fn gather(
        options: &PoseSetOptions,
        avatar: &Avatar,
        capture: Option<(&Capture, &str)>,
    ) -> anyhow::Result<PoseSet> {
        let model = &avatar.model;
        let mut rng = ChaCha8Rng::seed_from_u64(options.seed);
        let mut natural = options.given.clone();
        natural.extend(capture.map_or(vec![], |(capture, split)| training_poses(capture, avatar, split)));
        natural.extend(library(options.fps, model));
        let (held_out, natural): (Vec<_>, Vec<_>) =
            natural.into_iter().enumerate().partition(|(k, _)| k % HELD_OUT_EVERY == HELD_OUT_EVERY / 2);
        let [held_out, natural]: [Vec<NamedPose>; 2] =
            [held_out, natural].map(|poses| poses.into_iter().map(|(_, pose)| pose).collect());

        let random = |rng: &mut ChaCha8Rng, k: usize| {
            let pose = random_pose(model, rng)?;
            Some(named(format!("random {k}"), pose))
        };
        let extreme: Vec<NamedPose> = (0..EXTREME).map_while(|k| random(&mut rng, k)).collect();
        let randoms = (RANDOM_PART * options.fit as f64) as usize;
        let blends = (BETWEEN_PART * options.fit as f64) as usize;
        let mut fitted = evenly(&natural, options.fit.saturating_sub(randoms + blends));
        fitted.extend((0..randoms).map_while(|k| random(&mut rng, EXTREME + k)));
        if natural.len() > 1 {
            fitted.extend((0..blends).map(|k| {
                let [a, b] = [0, 1].map(|_| &natural[rng.random_range(0..natural.len())].pose);
                named(format!("between {k}"), between(a, b, rng.random_range(0.2..0.8)))
            }));
        }
        if fitted.len() < FEWEST_POSES {
            let given = fitted.len();
            bail!(
                "{given} poses are too few to see how the avatar depends on its pose: give at least {FEWEST_POSES}, with \
                 --poses and --fit"
            );
        }
        let extreme = if extreme.is_empty() { held_out.clone() } else { extreme };
        Ok(PoseSet { fitted, held_out: evenly(&held_out, MOST_HELD_OUT), extreme })
    }
}

/// A pose without the motion of the whole hand.
pub fn named(name: String, pose: Pose) -> NamedPose {
    let mut pose = Pose { translation: DVec3::ZERO, ..pose };
    pose.rotations.iter_mut().take(1).for_each(|root| *root = DVec3::ZERO);
    NamedPose { name, pose }
}

/// Poses and motions by name, if the model's joints are known.
fn library(fps: f64, model: &HandModel) -> Vec<NamedPose> {
    let poses = POSE_NAMES.iter().filter_map(|name| Some(named((*name).into(), pose_by_name(name, model).ok()?)));
    let mut all: Vec<NamedPose> = poses.collect();
    for name in MOTION_NAMES {
        let frames = motion(name, model, fps).and_then(|motion| motion.ok()?.resampled(MOTION_FPS).ok());
        let frames = frames.into_iter().flat_map(|motion| motion.frames);
        all.extend(frames.map(|frame| named(format!("{name} {}", frame.id), frame.pose)));
    }
    all
}

/// The poses of all frames that are not in the split that the result is judged on.
fn training_poses(capture: &Capture, avatar: &Avatar, split: &str) -> Vec<NamedPose> {
    if capture.template.joint_names != avatar.template.joint_names {
        return vec![];
    }
    let judged = capture.splits.get(split).map_or(&[][..], |split| &split.frames[..]);
    let frames = capture.frames.iter().enumerate().filter(|(k, _)| !judged.contains(k));
    frames.map(|(_, frame)| named(format!("frame {}", frame.id), frame.pose.clone())).collect()
}

/// At most `count` of them, evenly chosen.
fn evenly(poses: &[NamedPose], count: usize) -> Vec<NamedPose> {
    let chosen = count.min(poses.len());
    (0..chosen).map(|k| poses[k * poses.len() / chosen].clone()).collect()
}

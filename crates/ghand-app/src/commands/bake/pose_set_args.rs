//! Options that say over which poses an avatar is baked.

use std::path::PathBuf;

use clap::Args;
use ghand_core::HandModel;
use ghand_motion::pose_sequence::DEFAULT_FPS;

use super::pose_set::{DEFAULT_FIT, PoseSetOptions, named};
use crate::pose_choice::{PoseReadingArgs, is_name};

/// Which poses an avatar is baked over.
#[derive(Debug, Clone, Args)]
pub struct PoseSetArgs {
    /// Poses to fit beside the others: a pose or a motion by name, or any file or folder of poses, as for `render`; may be
    /// given several times. Best are those that the avatar will play, and those of its training
    #[arg(long, value_name = "FILE|NAME")]
    poses: Vec<String>,
    #[command(flatten)]
    reading: PoseReadingArgs,
    /// Number of poses to fit
    #[arg(long, value_name = "N", default_value_t = DEFAULT_FIT)]
    fit: usize,
    /// Seed of the random poses
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

impl PoseSetArgs {
    /// The files and folders that poses are read from.
    pub fn inputs(&self) -> Vec<PathBuf> {
        let named = self.poses.iter().flat_map(|poses| self.reading.inputs(Some(poses)));
        named.chain(self.reading.inputs(None)).collect()
    }

    /// Reads the poses for a hand model.
    ///
    /// # Errors
    /// An error that names the option or the file.
    pub fn read(&self, model: &HandModel) -> anyhow::Result<PoseSetOptions> {
        if self.poses.is_empty() {
            self.reading.refuse_without("--poses")?;
        }
        let has_files = self.poses.iter().any(|name| !is_name(name));
        let mut given = vec![];
        for name in &self.poses {
            let for_names = is_name(name) && has_files;
            let reading = if for_names { self.reading.for_names() } else { self.reading.clone() };
            let frames = reading.load_with_fit(name, model)?.0.frames;
            given.extend(frames.into_iter().map(|frame| named(format!("{name} {}", frame.id), frame.pose)));
        }
        Ok(PoseSetOptions { given, fps: self.reading.fps.unwrap_or(DEFAULT_FPS), fit: self.fit, seed: self.seed })
    }
}

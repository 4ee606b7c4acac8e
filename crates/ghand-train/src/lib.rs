//! Training of hand avatars: settings, the problem that a capture poses, a run with its checkpoints, and the training
//! step.

pub mod checkpoint;
pub mod checkpoints;
mod divergence;
mod lpips_term;
mod memory_check;
mod offset_curvature;
pub mod pose_prior;
pub mod presets;
mod setting_rules;
pub mod settings;
mod smooth_gradients;
pub mod step;
pub mod train_error;
pub mod trainer;
mod visible_gaussians;

pub use checkpoint::{Checkpoint, CheckpointError, CurvePoint};
pub use checkpoints::Checkpoints;
pub use presets::DescribedSetting;
pub use settings::{
    Align, Components, ExposureChoice, GlossChoice, LightChoice, Model, Network, SettingsError, Simplify,
    TrainSettings, Unseen,
};
pub use train_error::TrainError;
pub use trainer::{Preview, Trained, Trainer, TrainingProgress};

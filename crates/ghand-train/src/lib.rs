//! Training of hand avatars: settings, the training step, evaluation on held-out views, the floor (the baseline to
//! beat), and the report.

pub mod ablation;
pub mod alignment;
pub mod alignment_figures;
pub mod alignment_picture;
pub mod checkpoint;
pub mod checkpoints;
pub mod cleanliness;
pub mod cleanliness_sheet;
mod divergence;
pub mod draw_text;
pub mod error_bands;
pub mod evaluate;
pub mod exposure;
pub mod flip;
pub mod floor;
pub mod hand_box;
pub mod light_fit;
pub mod light_training;
pub mod lpips;
mod memory_check;
pub mod metrics;
mod needed_texels;
pub mod outline;
mod outline_band;
pub mod planted;
pub mod plot;
pub mod pose_offsets;
pub mod pose_prior;
pub mod presets;
pub mod protocol;
pub mod report;
mod setting_rules;
pub mod settings;
mod sharpness;
mod shown_gaussians;
pub mod ssim;
pub mod step;
pub mod synthetic_scene;
mod texel_frames;
mod texel_views;
pub mod train_error;
pub mod trainer;
pub mod views;

pub use checkpoint::{Checkpoint, CheckpointError, CurvePoint};
pub use checkpoints::Checkpoints;
pub use evaluate::{Evaluation, evaluate, evaluate_views};
pub use protocol::Protocol;
pub use settings::{
    Align, Components, ExposureChoice, FrameGain, GlossChoice, LightChoice, Model, Network, SettingsError, Simplify,
    TrainSettings, Unseen,
};
pub use train_error::TrainError;
pub use trainer::{Preview, Progress, Trained, Trainer};

//! The commands, one per module.

pub mod ablate;
pub mod bake;
pub mod bench;
pub mod capture;
pub mod evaluate;
pub mod explain;
pub mod export;
pub mod inspect;
pub mod pose;
pub mod render;
pub mod splat;
pub mod stress;
pub mod tradeoff;
pub mod train;

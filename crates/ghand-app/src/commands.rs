//! The commands, one per module.

pub mod bake;
pub mod board;
pub mod capture;
pub mod evaluate;
pub mod export;
pub mod import;
pub mod inspect;
pub mod pose;
pub mod render;
pub mod serve;
pub mod splat;
pub mod track;
pub mod train;

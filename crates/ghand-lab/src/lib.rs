//! The laboratory: what each part of the method brings, what speed costs in accuracy, how exact the device is, what each
//! stage of a frame takes, and what an avatar has learned.

pub mod ablate;
pub mod bench;
pub mod explain;
pub mod stress;
pub mod tradeoff;

//! The laboratory: what each part of the method brings, what speed costs in accuracy, how exact the device is, and what each
//! stage of a frame takes.

pub mod ablate;
pub mod bench;
pub mod stress;
pub mod tradeoff;

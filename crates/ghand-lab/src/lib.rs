//! The laboratory: what each part of the method brings, what speed costs in accuracy, how exact the device is, what each
//! stage of a frame takes, what an avatar has
//! learned, and how clean it is in poses that no image shows.

pub mod ablate;
pub mod bench;
pub mod cleanliness;
pub mod explain;
pub mod stress;
pub mod tradeoff;

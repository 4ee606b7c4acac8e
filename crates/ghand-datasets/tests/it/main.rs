//! Data sets written in their exact layout from hands whose poses are known, and read again.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::indexing_slicing, reason = "tests")]

mod arctic;
mod contactpose;
mod damaged;
mod dexycb;
mod freihand;
mod hanco;
mod ho3d;
mod hot3d;
mod mano;
mod scene;
mod taco;
mod torch;

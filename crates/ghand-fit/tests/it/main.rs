//! What is fitted to captures with known truth.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod common;

mod alignment;
mod alignment_robustness;
mod arms_and_masks;
mod calibration;

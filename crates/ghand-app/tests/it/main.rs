//! The programs, from the outside.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking; clippy knows that only inside #[test]")]

mod common;
#[allow(dead_code, reason = "those of the workspace's tests; not all are used here")]
#[path = "../../../../tests/tests/it/fixtures.rs"]
mod fixtures;
#[allow(dead_code, reason = "as above")]
#[path = "../../../../tests/tests/it/hand_appearance_files.rs"]
mod hand_appearance_files;
#[allow(dead_code, reason = "as above")]
#[path = "../../../../tests/tests/it/interhand_files.rs"]
mod interhand_files;

mod adapter;
mod attack;
mod bake;
mod capture;
mod command_inputs;
mod data_sets;
#[cfg(target_os = "linux")]
mod device_loss;
#[cfg(unix)]
mod ends;
#[cfg(target_os = "linux")]
mod environment;
mod evaluate;
mod export;
mod golden;
mod hand_models;
mod import;
mod inspect;
mod live;
mod lpips;
mod options;
mod pictures;
mod render;
#[cfg(unix)]
mod resume;
mod serve;
mod splat;
mod track;
mod train;
#[cfg(unix)]
mod train_run;
mod viewer;
#[cfg(target_os = "linux")]
mod viewer_soak;
#[cfg(target_os = "linux")]
mod viewer_window;

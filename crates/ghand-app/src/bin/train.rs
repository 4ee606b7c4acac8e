//! `train`: trains an avatar from a capture.

use std::process::ExitCode;

use clap::Parser;
use ghand_app::cli::{self, AdapterArgs};
use ghand_app::commands::train::{self, TrainArgs};

/// Train a hand avatar from a capture. Without a capture, a small synthetic one is made first.
#[derive(Parser)]
#[command(version)]
struct Arguments {
    #[command(flatten)]
    train: TrainArgs,
    #[command(flatten)]
    adapter: AdapterArgs,
}

fn main() -> ExitCode {
    cli::run(|arguments: Arguments| train::run(&arguments.train, &arguments.adapter))
}

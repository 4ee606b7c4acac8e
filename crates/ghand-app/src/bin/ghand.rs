//! `ghand`: work with avatars from the command line.

use std::process::ExitCode;

use clap::{Parser, Subcommand};
use ghand_app::cli::{self, AdapterArgs};
use ghand_app::commands::{bench, render};

/// Work with animatable hand avatars
#[derive(Debug, Parser)]
#[command(version)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
    #[command(flatten)]
    adapter: AdapterArgs,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Render an avatar to PNG files
    Render(render::RenderArgs),
    /// Time the stages of a frame
    Bench(bench::BenchArgs),
}

fn main() -> ExitCode {
    cli::run(|arguments: Arguments| match &arguments.command {
        Command::Render(args) => render::run(args, &arguments.adapter),
        Command::Bench(args) => bench::run(args, &arguments.adapter),
    })
}

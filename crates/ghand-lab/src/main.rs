//! `ghand-lab`: measures the method and the program.

use std::process::ExitCode;

use clap::{Parser, Subcommand};
use ghand_app::cli::{self, AdapterArgs};
use ghand_lab::{ablate, bench, cleanliness, explain, stress, tradeoff};

/// Measure the method and the program
#[derive(Debug, Parser)]
#[command(name = "ghand-lab", version)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
    #[command(flatten)]
    adapter: AdapterArgs,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Train avatars with and without parts of the method, and say what each brings
    Ablate(ablate::AblateArgs),
    /// Time the stages of a frame
    Bench(bench::BenchArgs),
    /// Measure how clean an avatar looks in the named poses from all around, which no image shows: the part of its
    /// pixels with colours that the training images lack, and its fine detail relative to theirs
    Cleanliness(cleanliness::CleanlinessArgs),
    /// Show what an avatar has learned: shape bases, coefficients, residual weights and skeleton
    Explain(explain::ExplainArgs),
    /// Compare the device with the f64 reference on random extreme hands, poses and views
    Stress(stress::StressArgs),
    /// Measure what speed costs in accuracy: an avatar as it is, baked, simplified, drawn smaller
    Tradeoff(tradeoff::TradeoffArgs),
}

fn main() -> ExitCode {
    cli::run(|arguments: Arguments| match &arguments.command {
        Command::Ablate(args) => ablate::run(args, &arguments.adapter),
        Command::Bench(args) => bench::run(args, &arguments.adapter),
        Command::Cleanliness(args) => cleanliness::run(args, &arguments.adapter),
        Command::Explain(args) => explain::run(args, &arguments.adapter),
        Command::Stress(args) => stress::run(args, &arguments.adapter),
        Command::Tradeoff(args) => tradeoff::run(args, &arguments.adapter),
    })
}

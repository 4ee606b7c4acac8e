//! `ghand`: work with avatars from the command line.

use std::process::ExitCode;

use clap::{Parser, Subcommand};
use ghand_app::cli::{self, AdapterArgs};
use ghand_app::commands::{bake, board, capture, evaluate, export, import, inspect, pose, render, serve, splat, track};

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
    /// Render pictures or a film of an avatar
    Render(render::RenderArgs),
    /// Write an avatar for other programs: a rigged mesh (.glb), Gaussians (.ply, .spz), a web page (.html)
    Export(export::ExportArgs),
    /// Compare an avatar with images of a capture that training did not see
    Evaluate(evaluate::EvaluateArgs),
    /// Make a small, fast avatar for playing from any avatar
    Bake(bake::BakeArgs),
    /// Make a synthetic capture, with known poses
    Capture(capture::MakeCaptureArgs),
    /// Draw a calibration board for printing, in its true size (.svg)
    Board(board::BoardArgs),
    /// Make a capture of videos of a hand
    Import(import::ImportArgs),
    /// Write or draw the mesh of a hand model in any pose and shape
    Pose(pose::PoseArgs),
    /// Check a capture, or describe a hand model, an avatar (.ghand) or a scene (.ply)
    Inspect(inspect::InspectArgs),
    /// Show avatars in a browser, from a server on this computer
    Serve(serve::ServeArgs),
    /// Render pictures or a film of a scene of Gaussians (.ply), and the gradient of its pixels
    Splat(splat::SplatArgs),
    /// Find hands in a video or in pictures, and write their landmarks
    Track(track::TrackArgs),
}

fn main() -> ExitCode {
    cli::run(|arguments: Arguments| match &arguments.command {
        Command::Render(args) => render::run(args, &arguments.adapter),
        Command::Export(args) => export::run(args, &arguments.adapter),
        Command::Evaluate(args) => evaluate::run(args, &arguments.adapter),
        Command::Bake(args) => bake::run(args, &arguments.adapter),
        Command::Capture(args) => capture::run(args, &arguments.adapter),
        Command::Board(args) => board::run(args),
        Command::Import(args) => import::run(args, &arguments.adapter),
        Command::Pose(args) => pose::run(args, &arguments.adapter),
        Command::Inspect(args) => inspect::run(args, &arguments.adapter),
        Command::Serve(args) => serve::run(args),
        Command::Splat(args) => splat::run(args, &arguments.adapter),
        Command::Track(args) => track::run(args),
    })
}

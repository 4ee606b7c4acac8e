//! `ghand board`: a calibration board for printing.

use std::path::PathBuf;

use anyhow::{Context, bail};
use clap::Args;
use ghand_board::BoardKind;
use ghand_board::print::board_svg;
use ghand_files::atomic_file::write_atomically;

use crate::say;

/// Command line of `ghand board`.
#[derive(Debug, Args)]
pub struct BoardArgs {
    /// The board: charuco:8x6:30mm (squares across and down, their side), chessboard:9x6:25mm (inner corners), or
    /// aprilgrid:6x6:24mm (Kalibr's tags)
    kind: BoardKind,
    /// The drawing to write (.svg)
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
}

/// Draws the board.
///
/// # Errors
/// If the file is no .svg, or cannot be written.
pub fn run(args: &BoardArgs) -> anyhow::Result<()> {
    if args.out.extension().is_none_or(|ending| !ending.eq_ignore_ascii_case("svg")) {
        bail!("--out {}: must end in .svg", args.out.display());
    }
    write_atomically(&args.out, board_svg(&args.kind).as_bytes())
        .with_context(|| format!("{}: cannot write", args.out.display()))?;
    say!("{}: print it at 100 %, glue it to something flat, and measure its squares or tags", args.out.display());
    Ok(())
}

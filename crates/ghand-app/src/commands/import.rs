//! `ghand import`: from videos of a hand to a capture.

mod data_set;
mod decisions;
mod page;
mod pictures;
mod plan;
mod round_step;
mod summary;
mod timeline;
mod turntable;

use std::path::PathBuf;
use std::time::{Duration, Instant};

use anyhow::bail;
use clap::Args;
use ghand_board::BoardKind;
use ghand_capture::Capture;
use ghand_core::Side;
use ghand_files::claim::Claim;
use ghand_fit::alignment::results::review::review;
use ghand_import::import::USUAL_FRAMES;
use ghand_import::progress::{Progress, Step};
use ghand_import::{ImportOptions, Imported, import};
use indicatif::{ProgressBar, ProgressStyle};

use self::decisions::decisions;
use self::page::{Found, write_page};
use self::pictures::Pictures;
use self::summary::{CameraSummary, cameras, clock_rows, frame_sentences};
use self::timeline::Timeline;
use crate::cli::AdapterArgs;
use crate::say;
use crate::train_run::interruption::Interruption;

/// What is kept from one import to the next, in the folder of `--out`.
const WORK: &str = "import";
/// Without a terminal, a line is printed this often.
const LINE_EVERY: Duration = Duration::from_secs(10);

/// Command line of `ghand import`.
#[derive(Debug, Args)]
pub struct ImportArgs {
    /// Videos, or folders of pictures, one for each camera; or a folder that has one of these for each camera; or a sequence of
    /// DexYCB, HO-3D, HOT3D, FreiHAND, HanCo, TACO, ContactPose or ARCTIC
    #[arg(value_name = "FOOTAGE", required = true)]
    footage: Vec<PathBuf>,
    /// The folder of the capture; an earlier import in it is done again with these options
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// The cameras' calibration; without it the hand itself tells where the cameras are
    #[arg(long, value_name = "FILE")]
    cameras: Option<PathBuf>,
    /// A calibration board that all cameras see before or after the hand, such as charuco:8x6:30mm (squares across and down,
    /// their side), chessboard:9x6:25mm (inner corners), or aprilgrid:6x6:24mm (tags); `ghand board` draws one
    #[arg(long, value_name = "KIND", conflicts_with = "cameras")]
    board: Option<BoardKind>,
    /// Landmarks from another tracker, in a file for all cameras or one for each; without them the hand is tracked
    #[arg(long, value_name = "FILE", num_args = 1..)]
    landmarks: Vec<PathBuf>,
    /// How long the hand is, from the wrist to the tip of the middle finger, as 186mm, 18.6cm or 0.186m: it gives the unit
    /// of length where the cameras do not [default: the mean of adults]
    #[arg(long, value_name = "LENGTH", value_parser = parse_length)]
    hand_length: Option<f64>,
    /// Which hand; both are two captures, OUT/right and OUT/left [default: the one that is seen most, right with --landmarks]
    #[arg(long, value_name = "SIDE", value_parser = ["right", "left", "both"])]
    side: Option<String>,
    /// A data set's hand model: MANO_RIGHT.pkl or MANO_LEFT.pkl, for the poses that it gives [default: the built-in hand, fitted
    /// to the joints that it gives]
    #[arg(long, value_name = "FILE")]
    hand_model: Option<PathBuf>,
    /// How many frames to choose, of which one in five is held out
    #[arg(long, value_name = "N", default_value_t = USUAL_FRAMES as u16, value_parser = clap::value_parser!(u16).range(5..))]
    frames: u16,
}

/// A length with its unit, in metres.
fn parse_length(text: &str) -> Result<f64, String> {
    let units = [("mm", 1e-3), ("cm", 1e-2), ("m", 1.0)];
    let found = units.iter().find_map(|(unit, metres)| Some((text.strip_suffix(unit)?, metres)));
    let (number, metres) = found.ok_or("give a number with its unit, as 186mm, 18.6cm or 0.186m")?;
    let length = number.trim().parse::<f64>().map_err(|_| format!("{number:?} is not a number"))? * metres;
    if (0.05..0.4).contains(&length) {
        Ok(length)
    } else {
        Err(format!("no hand is {length} m long, from the wrist to the tip of the middle finger"))
    }
}

/// Imports the footage.
///
/// # Errors
/// One sentence with the cause and the remedy.
pub fn run(args: &ImportArgs, adapter: &AdapterArgs) -> anyhow::Result<()> {
    if args.out.exists() && !args.out.join(WORK).is_dir() && args.out.read_dir()?.next().is_some() {
        bail!("--out {}: is not empty, and not the folder of an import; give another one", args.out.display());
    }
    let _claim = Claim::beside(&args.out)?;
    if let Some(folder) = data_set::folder(args)? {
        return data_set::import(args, folder, adapter);
    }
    Interruption::listen("stopped: what was tracked of whole videos is kept, and the same command goes on")?;
    let captures = match args.side.as_deref() {
        Some("both") => vec![(Some(Side::Right), args.out.join("right")), (Some(Side::Left), args.out.join("left"))],
        Some("left") => vec![(Some(Side::Left), args.out.clone())],
        Some(_) => vec![(Some(Side::Right), args.out.clone())],
        None => vec![(None, args.out.clone())],
    };
    for (side, out) in captures {
        let start = Instant::now();
        let options = ImportOptions {
            footage: args.footage.clone(),
            cameras: args.cameras.clone(),
            board: args.board,
            landmarks: args.landmarks.clone(),
            hand_length: args.hand_length,
            side,
            frames: usize::from(args.frames),
            out,
            work: args.out.join(WORK),
        };
        describe(&with_progress(&options)?, args, start, adapter)?;
    }
    Ok(())
}

fn with_progress(options: &ImportOptions) -> anyhow::Result<Imported> {
    let bar = ProgressBar::new(1);
    bar.set_style(ProgressStyle::with_template("{bar:30} {pos}/{len} {msg} {elapsed} (left {eta})")?);
    let mut last = (Instant::now(), None);
    let imported = import(options, &mut |progress: &Progress| {
        let message = match progress.step {
            Step::Tracking => format!("finding the hand in {}", progress.subject),
            Step::Board => format!("looking for the board in {}", progress.subject),
            Step::Cameras => "cameras and clocks".into(),
            Step::Poses => "the hand and its poses".into(),
            Step::Contours => "the hand's outlines".into(),
            Step::Images => format!("writing images of {}", progress.subject),
        };
        let is_new = last.1.as_ref() != Some(&message);
        if is_new {
            bar.reset();
        }
        bar.set_length(progress.total.max(1) as u64);
        bar.set_position(progress.done as u64);
        bar.set_message(message.clone());
        if bar.is_hidden() && (is_new || last.0.elapsed() > LINE_EVERY) {
            match progress.total {
                0 => say!("{message}"),
                total => say!("{message}: {} of {total}", progress.done),
            }
            last.0 = Instant::now();
        }
        last.1 = Some(message);
        true
    });
    bar.finish_and_clear();
    Ok(imported?)
}

/// Prints what was found, and writes the page.
fn describe(imported: &Imported, args: &ImportArgs, start: Instant, adapter: &AdapterArgs) -> anyhow::Result<()> {
    let mut capture = Capture::open(&imported.capture.root)?;
    let splits: Vec<String> = capture.splits.keys().cloned().collect();
    let unseen = capture.skip_unusable_images(&splits.iter().map(String::as_str).collect::<Vec<_>>())?;
    let cameras = cameras(imported);
    for (k, CameraSummary { id, images, found, focal, to_hand, to_first, error, .. }) in cameras.iter().enumerate() {
        let landmarks = error.as_ref().map(|e| format!("; landmarks are {e} off the hand")).unwrap_or_default();
        let from_first = if k > 0 { format!(" and {to_first} from the first camera") } else { String::new() };
        say!(
            "{id}: {images}; the hand is in {found} frames; focal length {focal}; {to_hand} from \
             the hand{from_first}{landmarks}"
        );
    }
    for [id, seconds, frames, agreement] in clock_rows(imported) {
        say!("clock of {id}: {seconds} ({frames} frames) later; movements agree by {agreement}");
    }
    say!("the hand: {:.0} mm long", 1e3 * imported.fit.lengths[1]);
    let sentences = frame_sentences(imported);
    sentences.iter().for_each(|sentence| say!("{sentence}"));
    let mut notes = imported.remarks.clone();
    let (missing, all) = (unseen.reasons.values().sum::<usize>(), unseen.checked);
    if missing > 0 {
        notes.push(format!("{missing} of {all} images of the chosen frames do not show the hand, and are not written"));
    }
    notes.extend(imported.fit.remarks.iter().cloned());
    if let Some(review) = review(&capture, capture.split("train")?)? {
        notes.extend(review.sentences());
    }
    notes.iter().for_each(|note| say!("note: {note}"));
    let pictures = Pictures::of(&capture, adapter)?;
    let timelines = Timeline::of(imported);
    let decisions = decisions(imported, args, &timelines);
    let found = Found { decisions, cameras, sentences, timelines, notes };
    write_page(&capture, &found, &pictures)?;
    say!("imported in {:.0} s; train on it: train --capture {}", start.elapsed().as_secs_f64(), capture.root.display());
    Ok(())
}

//! `ghand track`: finds hands in a video or in pictures, and writes their landmarks.

mod landmark_file;
mod seen_hands;

use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use clap::Args;
use ghand_core::Side;
use ghand_files::atomic_file::{check_writable, write_atomically};
use ghand_footage::Footage;
use ghand_tracker::HandTracker;
use indicatif::{ProgressBar, ProgressStyle};

use crate::command_inputs::CommandInputs;
use crate::pose_choice::parse_side;
use crate::say;
use crate::train_run::interruption::Interruption;

use landmark_file::{image_landmarks, world_landmarks};
use seen_hands::SeenHands;

/// Extensions of pictures.
const PICTURES: [&str; 4] = ["jpg", "jpeg", "png", "webp"];

/// Command line of `ghand track`.
#[derive(Debug, Args)]
pub struct TrackArgs {
    /// A video (read by ffmpeg), a folder of pictures, or pictures in order; not mirrored
    #[arg(required = true, value_name = "VIDEO|PICTURE")]
    footage: Vec<PathBuf>,
    /// The file to write: landmarks in space, a guess in metres, which --pose of `ghand render` and `viewer` plays
    #[arg(long, value_name = "FILE.json")]
    out: PathBuf,
    /// Write landmarks in the images of this camera instead, for `ghand pose --pose FILE --cameras ...`
    #[arg(long, value_name = "ID")]
    camera: Option<String>,
    /// Keep this hand only [default: both; with --camera the one that is seen more]
    #[arg(long, value_name = "left|right", value_parser = parse_side)]
    side: Option<Side>,
    /// Most hands in a picture
    #[arg(long, value_name = "N", default_value = "2", value_parser = clap::value_parser!(u8).range(1..=2))]
    hands: u8,
}

/// Tracks hands and writes the file once, at the end.
///
/// # Errors
/// One sentence that names the file and its problem, or says that no hand was found.
pub fn run(args: &TrackArgs) -> anyhow::Result<()> {
    let inputs = CommandInputs::default().and(&args.footage);
    inputs.refuse("--out", &args.out)?;
    check_output(&args.out)?;
    let footage = open(&args.footage)?;
    let name = footage.path().display().to_string();
    footage.remarks().iter().for_each(|remark| log::warn!("{name}: {remark}"));
    Interruption::listen("stopped: nothing was written")?;
    let hands = track(&footage, args.hands)?;
    let count = footage.times().len();
    let noun = if count == 1 { "picture" } else { "pictures" };
    let side = match (args.side, &args.camera) {
        (Some(side), _) => Some(side),
        (None, Some(_)) => Some(hands.more_often()),
        (None, None) => None,
    };
    let seen = |side: Side| hands.frames_with(side);
    let is_seen = match side {
        Some(side) => seen(side) > 0,
        None => seen(Side::Left) + seen(Side::Right) > 0,
    };
    if !is_seen {
        let which = match side.filter(|_| args.side.is_some()) {
            Some(Side::Left) => "left hand",
            Some(Side::Right) => "right hand",
            None => "hand",
        };
        bail!("{name}: no {which} was found in {count} {noun}; show the whole hand, well lit and not mirrored");
    }
    let file = match (&args.camera, side) {
        (Some(camera), Some(side)) => image_landmarks(&footage, &hands, camera, side),
        _ => world_landmarks(&footage, &hands, side),
    };
    let text = serde_json::to_vec(&file).context("cannot write landmarks as JSON")?;
    write_atomically(&args.out, &text).with_context(|| format!("--out {}: cannot be written", args.out.display()))?;
    let of = |side: Side, name: &str| format!("the {name} hand in {} of {count} {noun}", seen(side));
    let counts: Vec<String> = [(Side::Right, "right"), (Side::Left, "left")]
        .into_iter()
        .filter(|(own, _)| side.is_none_or(|side| side == *own) && seen(*own) > 0)
        .map(|(own, name)| of(own, name))
        .collect();
    say!("{}: {}", args.out.display(), counts.join(", "));
    Ok(())
}

fn check_output(path: &Path) -> anyhow::Result<()> {
    if path.extension().is_none_or(|ending| !ending.eq_ignore_ascii_case("json")) {
        bail!("--out {}: must end in .json", path.display());
    }
    check_writable(path).with_context(|| format!("--out {}: cannot be written", path.display()))
}

fn open(paths: &[PathBuf]) -> anyhow::Result<Footage> {
    let [path] = paths else {
        let is_picture = |path: &&PathBuf| {
            path.extension().is_some_and(|ending| PICTURES.iter().any(|known| ending.eq_ignore_ascii_case(known)))
        };
        if let Some(other) = paths.iter().find(|path| !is_picture(path)) {
            bail!(
                "{}: is not a picture (JPEG, PNG or WebP); give one video at a time, or pictures only",
                other.display()
            );
        }
        return Ok(Footage::of_pictures(paths)?);
    };
    Ok(Footage::open(path)?)
}

/// The hands of all pictures.
fn track(footage: &Footage, most_hands: u8) -> anyhow::Result<SeenHands> {
    let mut tracker = HandTracker::new(usize::from(most_hands));
    let count = footage.times().len();
    let bar = if count > 1 { ProgressBar::new(count as u64) } else { ProgressBar::hidden() };
    bar.set_style(ProgressStyle::with_template("{bar:30} {pos}/{len} pictures {elapsed} (left {eta})")?);
    let (width, height) = footage.size();
    let mut frames = footage.frames()?;
    let mut rgb = vec![];
    let mut hands = SeenHands::new(count);
    while let Some(number) = frames.next_into(&mut rgb)? {
        hands.add(number, tracker.track(&rgb, width, height)?);
        bar.set_position(number as u64 + 1);
    }
    bar.finish_and_clear();
    let missing = frames.missing();
    if missing > 0 {
        log::warn!("{}: {missing} of {count} pictures cannot be decoded: they are gaps", footage.path().display());
    }
    Ok(hands)
}

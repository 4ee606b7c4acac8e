//! Captures of published data sets.

use std::fs;
use std::path::Path;
use std::time::Instant;

use anyhow::bail;
use ghand_core::statistics::median;
use ghand_core::{Camera, Side};
use ghand_datasets::{Options, Progress, Written, recognise, write_capture};
use indicatif::{ProgressBar, ProgressStyle};

use super::decisions::Decision;
use super::page::{Found, write_page};
use super::pictures::Pictures;
use super::summary::CameraSummary;
use super::{ImportArgs, WORK};
use crate::cli::AdapterArgs;
use crate::say;
use crate::train_run::interruption::Interruption;

/// The folder of a data set, if the footage is one.
///
/// # Errors
/// If an option is given that only data sets have, or only videos.
pub fn folder(args: &ImportArgs) -> anyhow::Result<Option<&Path>> {
    let found = match &args.footage[..] {
        [folder] => recognise(folder).map(|data_set| (folder, data_set.name())),
        _ => None,
    };
    let Some((folder, name)) = found else {
        if args.hand_model.is_some() {
            bail!("--hand-model: is for data sets, and the footage is none that is known; omit it");
        }
        return Ok(None);
    };
    let of_videos = [
        ("--cameras", args.cameras.is_some()),
        ("--board", args.board.is_some()),
        ("--landmarks", !args.landmarks.is_empty()),
        ("--hand-length", args.hand_length.is_some()),
        ("--side both", args.side.as_deref() == Some("both")),
    ];
    if let Some((option, _)) = of_videos.iter().find(|(_, is_given)| *is_given) {
        bail!("{option}: {} is of {name}, which needs none; omit it", folder.display());
    }
    Ok(Some(folder))
}

/// Makes a capture of the data set's sequence.
///
/// # Errors
/// One sentence with the file, the problem and the remedy.
pub fn import(args: &ImportArgs, folder: &Path, adapter: &AdapterArgs) -> anyhow::Result<()> {
    Interruption::listen("stopped: the capture is incomplete; the same command makes it again")?;
    let start = Instant::now();
    // Tells the folder from one of another origin, when the command is given again.
    fs::create_dir_all(args.out.join(WORK))?;
    let options = Options {
        side: args.side.as_ref().map(|side| if side == "left" { Side::Left } else { Side::Right }),
        hand_model: args.hand_model.clone(),
        frames: usize::from(args.frames),
        out: args.out.clone(),
    };
    let bar = ProgressBar::new(0);
    bar.set_style(ProgressStyle::with_template("{bar:30} {pos}/{len} images {elapsed} (left {eta})")?);
    let written = write_capture(folder, &options, &mut |progress: &Progress| {
        bar.set_length(progress.total as u64);
        bar.set_position(progress.done as u64);
        true
    });
    bar.finish_and_clear();
    let written = written?;
    let Written { dataset, capture, annotated, remarks, .. } = &written;
    say!(
        "{}: {} cameras, {} of {annotated} annotated frames of {}",
        args.out.display(),
        capture.cameras.len(),
        capture.frames.len(),
        dataset.name()
    );
    remarks.iter().for_each(|remark| say!("note: {remark}"));
    let pictures = Pictures::of(capture, adapter)?;
    write_page(capture, &found(&written), &pictures)?;
    let out = args.out.display();
    let model = args.hand_model.as_ref().map_or(String::new(), |model| format!(" --hand-model {}", model.display()));
    let took = start.elapsed().as_secs_f64();
    say!("imported in {took:.0} s; look at it: ghand inspect {out}{model}; train on it: train --capture {out}{model}");
    Ok(())
}

/// What the page tells of it.
fn found(written: &Written) -> Found {
    let Written { dataset, capture, annotated, fit, remarks } = written;
    let count = |split: &str| capture.splits.get(split).map_or(0, |split| split.frames.len());
    let [poses, grounds] = match fit.as_ref().filter(|fit| !fit.frames.is_empty()) {
        None => ["MANO's".into(), "as the data set gives them".into()],
        Some(fit) => {
            let off = median(fit.frames.iter().map(|frame| frame.distances.median));
            let length = 1e3 * fit.lengths[1];
            [
                format!("the built-in hand, fitted to joints: {length:.0} mm, wrist to middle fingertip"),
                format!("joints are {off:.1} {} off the hand (median)", fit.unit),
            ]
        }
    };
    let masks = if capture.images.mask.is_some() { "the data set's" } else { "made when the capture is read" };
    let frames = format!("{} to train with, {} held out", count("train"), count("test"));
    let spread = format!("spread over {annotated} annotated ones");
    let decisions = vec![
        Decision::new("data set", dataset.name(), "known by its folders", ""),
        Decision::new("hand", capture.side.to_string(), "as the data set says", "--side"),
        Decision::new("cameras", capture.cameras.len().to_string(), "as the data set calibrates them", ""),
        Decision::new("poses", poses, grounds, "--hand-model"),
        Decision::new("frames", frames, spread, "--frames"),
        Decision::new("masks", masks, "", ""),
    ];
    let camera = |(k, camera): (usize, &Camera)| {
        let views = capture.splits.values().flat_map(|split| &split.views);
        let seen = views.filter(|view| view.camera == k && capture.image_file(k, view.frame).is_ok_and(|f| f.exists()));
        let found = format!("{} of {}", seen.count(), capture.frames.len());
        CameraSummary { found, ..CameraSummary::of(capture, camera) }
    };
    let cameras = capture.cameras.iter().enumerate().map(camera).collect();
    Found { decisions, cameras, sentences: vec![], timelines: vec![], notes: remarks.clone() }
}

//! Captures of published data sets.

use std::fs;
use std::path::Path;
use std::time::Instant;

use anyhow::bail;
use ghand_core::Side;
use ghand_datasets::{Options, Progress, Written, recognise, write_capture};
use indicatif::{ProgressBar, ProgressStyle};

use super::{ImportArgs, WORK};
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
pub fn import(args: &ImportArgs, folder: &Path) -> anyhow::Result<()> {
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
    let Written { dataset, capture, annotated, remarks, .. } = written?;
    say!(
        "{}: {} cameras, {} of {annotated} annotated frames of {}",
        args.out.display(),
        capture.cameras.len(),
        capture.frames.len(),
        dataset.name()
    );
    remarks.iter().for_each(|remark| say!("note: {remark}"));
    let out = args.out.display();
    let model = args.hand_model.as_ref().map_or(String::new(), |model| format!(" --hand-model {}", model.display()));
    let took = start.elapsed().as_secs_f64();
    say!("imported in {took:.0} s; look at it: ghand inspect {out}{model}; train on it: train --capture {out}{model}");
    Ok(())
}

//! What an import of videos decided, how sure it is, and which option decides otherwise.

use ghand_core::Side;
use ghand_core::statistics::median;
use ghand_import::Imported;
use ghand_import::solve::Known;

use super::ImportArgs;
use super::summary::clock_rows;
use super::timeline::Timeline;

/// A decision.
#[derive(Debug, Clone)]
pub struct Decision {
    /// Of what.
    pub subject: String,
    /// What it is.
    pub choice: String,
    /// What speaks for it: its residual, or where it comes from.
    pub grounds: String,
    /// The option that decides otherwise; empty without one.
    pub option: &'static str,
}

impl Decision {
    /// One.
    pub fn new(
        subject: impl Into<String>,
        choice: impl Into<String>,
        grounds: impl Into<String>,
        option: &'static str,
    ) -> Decision {
        Decision { subject: subject.into(), choice: choice.into(), grounds: grounds.into(), option }
    }
}

/// Those of an import.
pub fn decisions(imported: &Imported, args: &ImportArgs, timelines: &[Timeline]) -> Vec<Decision> {
    let mut decisions = vec![side(imported)];
    decisions.extend(clocks(imported));
    decisions.extend([cameras(imported, args), hand_length(imported, args), poses(imported)]);
    decisions.push(frames(imported, timelines));
    decisions
}

fn side(imported: &Imported) -> Decision {
    let count = |k: usize| imported.tracked.iter().map(|tracked| tracked.hands.by_side[k]).sum::<usize>();
    let all: usize = imported.tracks.iter().map(|track| track.sightings.len()).sum();
    let (name, other_name, [own, other]) = match imported.capture.side {
        Side::Right => ("right", "left", [count(0), count(1)]),
        Side::Left => ("left", "right", [count(1), count(0)]),
    };
    let grounds = format!("{own} of {all} images show one, {other} a {other_name} one");
    Decision::new("hand", name, grounds, "--side")
}

fn clocks(imported: &Imported) -> impl Iterator<Item = Decision> {
    clock_rows(imported).into_iter().enumerate().map(|(k, row)| {
        let [id, seconds, frames, agreement] = row;
        let told = imported.solved.clocks.get(k + 1).copied().flatten();
        let grounds = match told {
            Some(clock) => {
                format!("movements agree by {agreement} (1 at best), and alone tell {:+.4} s", clock.seconds)
            }
            None => "the movements agree too little to tell it".into(),
        };
        Decision::new(format!("clock of {id}"), format!("{seconds} later ({frames} frames)"), grounds, "--board")
    })
}

fn cameras(imported: &Imported, args: &ImportArgs) -> Decision {
    let is_one = imported.sources.len() == 1;
    let choice = match imported.known {
        _ if args.board.is_some() => "by the board",
        Known::All => "as given",
        Known::AllButTheUnit => "as given, without their unit of length",
        Known::Lenses if is_one => "lens as given",
        Known::Lenses => "lenses as given, places by the hand",
        Known::Nothing if is_one && imported.sources[0].footage.stated_focal().is_some() => {
            "the focal length that the footage states"
        }
        Known::Nothing if is_one => "the focal length of most cameras",
        Known::Nothing => "by the hand",
    };
    let worst = imported.fit.cameras.iter().max_by(|a, b| a.1.median.total_cmp(&b.1.median));
    let mut grounds =
        worst.map_or(String::new(), |(id, off)| format!("landmarks are {:.1} px off the hand in {id}", off.median));
    if !is_one {
        grounds += ", where they are worst";
    }
    Decision::new(if is_one { "camera" } else { "cameras" }, choice, grounds, "--cameras, --board")
}

fn hand_length(imported: &Imported, args: &ImportArgs) -> Decision {
    let (grounds, option) = match (imported.known, imported.sources.len(), args.hand_length) {
        (_, 1, _) => ("one camera does not tell it: the mean of adults is taken".into(), ""),
        (Known::All, ..) => ("by the cameras' unit of length".into(), "--cameras"),
        (.., Some(given)) => (format!("from the {:.0} mm of --hand-length", 1e3 * given), "--hand-length"),
        (.., None) => ("from the mean of adults, whose hands differ by 6 %".to_owned(), "--hand-length"),
    };
    let choice = format!("{:.0} mm, wrist to middle fingertip", 1e3 * imported.fit.lengths[1]);
    Decision::new("the hand's length", choice, grounds, option)
}

fn poses(imported: &Imported) -> Decision {
    let fit = &imported.fit;
    let [posed, refused] = [fit.frames.len(), fit.rejected.len()];
    let grounds = if fit.frames.is_empty() {
        String::new()
    } else {
        let middle = median(fit.frames.iter().map(|frame| frame.distances.median));
        let part = 1e2 * refused as f64 / (posed + refused) as f64;
        format!(
            "landmarks are {middle:.1} px off the hand fitted to them (median); {part:.1} % of the frames are refused"
        )
    };
    Decision::new("poses", format!("in {posed} of {} frames", posed + refused), grounds, "--landmarks")
}

fn frames(imported: &Imported, timelines: &[Timeline]) -> Decision {
    let count = |split: &str| imported.capture.splits.get(split).map_or(0, |split| split.frames.len());
    let [sharp, found] =
        timelines.iter().map(Timeline::sharp_and_found).fold([0, 0], |a, b| [a[0] + b[0], a[1] + b[1]]);
    let choice = format!("{} to train with, {} held out", count("train"), count("test"));
    let grounds = format!("{sharp} of {found} images of the hand are sharp; those that differ most are taken");
    Decision::new("frames", choice, grounds, "--frames")
}

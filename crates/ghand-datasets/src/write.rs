//! Writes a capture of a sequence: chooses frames, then images, masks, poses and splits.

use std::collections::{BTreeMap, HashSet};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use ghand_capture::capture::{Frame, HandModelSource, ImagePaths};
use ghand_capture::images::color_correction::ColorCorrection;
use ghand_capture::{Capture, OpenOptions, Split};
use ghand_core::Side;
use ghand_motion::LandmarkFit;

use crate::dataset::read;
use crate::pictures::{Paths, write_pictures};
use crate::poses::{Posed, poses};
use crate::sequence::{Annotated, Sequence, View};
use crate::{Dataset, DatasetError};

/// The file that makes a folder a capture.
const CAPTURE_FILE: &str = "capture.json";
/// Of so many frames in order, one is held out: the one of this place.
const HELD_OUT: (usize, usize) = (5, 2);

/// What to write.
#[derive(Debug, Clone)]
pub struct Options {
    /// Which hand; by default the right one if it is annotated.
    pub side: Option<Side>,
    /// The user's MANO file. Without it, the built-in hand is fitted to the data set's joints.
    pub hand_model: Option<PathBuf>,
    /// How many frames to take, evenly over the sequence; of these, one in five is held out.
    pub frames: usize,
    /// The folder of the capture.
    pub out: PathBuf,
}

/// How many images are done.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Progress {
    /// Those that are written.
    pub done: usize,
    /// All of them.
    pub total: usize,
}

/// Hears of progress; `false` stops.
pub type OnProgress<'a> = dyn FnMut(&Progress) -> bool + 'a;

/// What was written.
#[derive(Debug)]
pub struct Written {
    /// The data set.
    pub dataset: Dataset,
    /// The capture, as read again.
    pub capture: Capture,
    /// How many frames of the sequence have the hand.
    pub annotated: usize,
    /// How well the hand fits the data set's joints; `None` if poses are MANO's.
    pub fit: Option<LandmarkFit>,
    /// What the user should know, one sentence each.
    pub remarks: Vec<String>,
}

/// Writes a capture of the sequence in `folder`. An earlier import in the same place is written over.
///
/// ```no_run
/// use ghand_datasets::{Options, write_capture};
///
/// let options = Options { side: None, hand_model: None, frames: 64, out: "me".into() };
/// let folder = "DexYCB/20200709-subject-01/20200709_141754".as_ref();
/// let written = write_capture(folder, &options, &mut |_| true)?;
/// println!("{} of {} frames", written.capture.frames.len(), written.annotated);
/// # Ok::<(), ghand_datasets::DatasetError>(())
/// ```
///
/// # Errors
/// [`DatasetError`]: one sentence with the file, the problem and the remedy.
pub fn write_capture(folder: &Path, options: &Options, on_progress: &mut OnProgress) -> Result<Written, DatasetError> {
    check_place(folder, &options.out)?;
    let (dataset, mut sequence) = read(folder, options.side)?;
    let mut remarks = std::mem::take(&mut sequence.remarks);
    remarks.extend(only_with_masks(&mut sequence));
    let chosen = spread(sequence.frames.len(), options.frames.max(1));
    let frames: Vec<&Annotated> = chosen.iter().filter_map(|k| sequence.frames.get(*k)).collect();
    let Posed { model, source, frames: poses, fit, remark } =
        poses(dataset.name(), &sequence, &frames, options.hand_model.as_deref())?;
    remarks.extend(remark);
    let mut numbers = vec![];
    let mut kept = vec![];
    for ((number, frame), found) in chosen.iter().zip(&frames).zip(poses) {
        let Some((pose, shape)) = found else { continue };
        numbers.push(*number);
        kept.push(Frame { id: frame.id.clone(), pose, shape });
    }
    if kept.is_empty() {
        let reason = fit.and_then(|fit| fit.rejected.into_iter().next()).map_or(String::new(), |(_, reason)| reason);
        let problem = format!("has no frame whose joints are a hand's ({reason}); download its annotations again");
        return Err(DatasetError::file(folder, problem));
    }
    let views = numbers.iter().filter_map(|k| sequence.frames.get(*k)).flat_map(|frame| frame.views.iter().flatten());
    let paths = Paths::of(views);
    if !paths.has_masks {
        remarks.push(format!(
            "{} has no masks of this hand: they are made when the capture is read, and may contain what the hand holds",
            dataset.name()
        ));
    }
    let out = &options.out;
    // A folder with a capture.json is complete: an earlier one goes first.
    let file = out.join(CAPTURE_FILE);
    match fs::remove_file(&file) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(DatasetError::write(&file)(error)),
        _ => {}
    }
    write_pictures(out, &sequence, &numbers, &paths, on_progress)?;
    let capture = Capture {
        root: out.clone(),
        side: sequence.side,
        background: [0.0; 3],
        hand_model: model.clone(),
        hand_model_source: source,
        template: model.clone(),
        cameras: sequence.cameras.iter().map(|lens| lens.camera.clone()).collect(),
        distortion: sequence.cameras.iter().map(|lens| lens.distortion).collect(),
        color_correction: ColorCorrection::default(),
        frames: kept,
        images: ImagePaths::plain(&paths.images(), paths.masks().as_deref()),
        splits: splits(sequence.cameras.len(), numbers.len()),
        truth: None,
    };
    capture.save()?;
    // As everyone else will see it, with the template in the person's shape.
    let mano = (capture.hand_model_source == HandModelSource::Mano).then_some(model);
    let opened = Capture::open_with(out, &OpenOptions { mano, ..OpenOptions::default() })?;
    remarks.extend(opened.warnings);
    if let Some(fit) = &fit {
        remarks.extend(fit.remarks.iter().cloned());
        if !fit.rejected.is_empty() {
            remarks.push(format!("in {} frames the joints are not a hand's; they are left out", fit.rejected.len()));
        }
    }
    Ok(Written { dataset, capture: opened.capture, annotated: sequence.frames.len(), fit, remarks })
}

/// An import must not write into the data set.
fn check_place(folder: &Path, out: &Path) -> Result<(), DatasetError> {
    let (Ok(folder), Ok(out)) = (folder.canonicalize(), out.canonicalize()) else { return Ok(()) };
    if folder.starts_with(&out) {
        return Err(DatasetError::file(&out, "holds the data set; give another folder with --out"));
    }
    Ok(())
}

/// If the data set has masks, images without one would show the object and the room as the hand.
fn only_with_masks(sequence: &mut Sequence) -> Option<String> {
    let lacks = |view: &Option<View>| view.as_ref().is_some_and(|view| view.mask.is_none());
    let views = || sequence.frames.iter().flat_map(|frame| &frame.views);
    let without = views().filter(|view| lacks(view)).count();
    if without == 0 || without == views().flatten().count() {
        return None;
    }
    for frame in &mut sequence.frames {
        frame.views.iter_mut().filter(|view| lacks(view)).for_each(|view| *view = None);
    }
    sequence.frames.retain(|frame| frame.views.iter().any(Option::is_some));
    Some(format!("{without} images without a mask are left out, as the others have one"))
}

/// Numbers of at most `wanted` of `count` frames, evenly over all.
fn spread(count: usize, wanted: usize) -> Vec<usize> {
    if wanted >= count {
        return (0..count).collect();
    }
    (0..wanted).map(|k| if wanted == 1 { count / 2 } else { k * (count - 1) / (wanted - 1) }).collect()
}

/// All cameras, and one frame in five held out.
fn splits(cameras: usize, frames: usize) -> BTreeMap<String, Split> {
    let cameras: Vec<usize> = (0..cameras).collect();
    let (of, place) = HELD_OUT;
    let is_held_out = |frame: &usize| frames >= of && frame % of == place;
    let (test, train): (Vec<usize>, Vec<usize>) = (0..frames).partition(is_held_out);
    let mut splits = BTreeMap::from([("train".to_owned(), Split::product(cameras.clone(), train))]);
    if !test.is_empty() {
        splits.insert("test".to_owned(), Split::product(cameras, test));
    }
    splits
}

/// A name of letters, digits, `-` and `_` for each text, each once.
pub(crate) fn plain_ids<'a>(names: impl Iterator<Item = &'a str>) -> Vec<String> {
    let mut seen = HashSet::new();
    names
        .map(|name| {
            let plain: String =
                name.chars().map(|c| if c.is_ascii_alphanumeric() || c == '-' { c } else { '_' }).collect();
            let mut id = plain.clone();
            let mut number = 2;
            while !seen.insert(id.clone()) {
                id = format!("{plain}_{number}");
                number += 1;
            }
            id
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_spread_from_the_first_to_the_last() {
        assert_eq!(spread(3, 5), [0, 1, 2]);
        assert_eq!(spread(10, 4), [0, 3, 6, 9]);
        assert_eq!(spread(9, 1), [4]);
        assert_eq!(spread(9, 0), [0; 0]);
        let numbers = spread(1000, 64);
        assert!(numbers.windows(2).all(|pair| pair[0] < pair[1]) && numbers.len() == 64);
    }

    #[test]
    fn one_frame_in_five_is_held_out_and_none_of_few() {
        let all = splits(2, 10);
        assert_eq!((all["test"].frames.clone(), all["train"].frames.len()), (vec![2, 7], 8));
        assert_eq!(splits(2, 4).keys().collect::<Vec<_>>(), ["train"]);
    }

    #[test]
    fn names_become_plain_and_stay_different() {
        assert_eq!(plain_ids(["a b", "a/b", "214-1"].into_iter()), ["a_b", "a_b_2", "214-1"]);
    }
}

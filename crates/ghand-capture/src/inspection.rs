//! Facts about a capture before an avatar is trained on it, and its problems and oddities.
//!
//! Checks the header and the end of every file of the splits. Decodes the pixels of a bounded number of images of each
//! split, spread evenly over cameras and frames. A broken file is a finding, not an error.

mod cameras;
mod files;
mod findings;
mod fit;
mod misfits;
mod outlines;
mod overlap;
mod sample;

use std::collections::{BTreeSet, HashMap, HashSet};

use crate::capture::Capture;
use crate::error::CaptureError;
use crate::split::{Split, SplitView};
use sample::spread_evenly;

pub use cameras::CameraFacts;
pub use files::{FileCheck, FileProblem, MOST_PROBLEMS};
pub use findings::{Finding, Severity};
pub use fit::{ViewFit, posed_template, true_pose};
pub use overlap::{Spread, iou};

/// Default number of images of a split whose pixels are decoded.
pub const DEFAULT_SAMPLE: usize = 240;

/// Facts about a split.
#[derive(Debug, Clone, PartialEq)]
pub struct SplitFacts {
    /// Its name.
    pub name: String,
    /// Its cameras.
    pub cameras: usize,
    /// Its frames.
    pub frames: usize,
    /// Its images.
    pub images: usize,
    /// Whether another split contains all of its images.
    pub is_part: bool,
    /// Facts from the pixels of the sampled images, frames outermost; without images that could not be decoded.
    pub views: Vec<ViewFit>,
}

impl SplitFacts {
    /// Fraction of the images that is hand, where there are masks.
    pub fn coverage(&self) -> Option<Spread> {
        Spread::of(self.views.iter().filter_map(|view| view.coverage))
    }

    /// How well the template matches the masks in the frames' own poses.
    pub fn iou_given(&self) -> Option<Spread> {
        Spread::of(self.views.iter().filter_map(|view| view.iou_given))
    }

    /// The same in the true poses, if known.
    pub fn iou_true(&self) -> Option<Spread> {
        Spread::of(self.views.iter().filter_map(|view| view.iou_true))
    }
}

/// Facts about a capture.
#[derive(Debug)]
pub struct CaptureInspection {
    /// Every camera of the capture.
    pub cameras: Vec<CameraFacts>,
    /// Number of frames whose true pose is known.
    pub frames_with_truth: usize,
    /// The files of all splits.
    pub files: FileCheck,
    /// The splits by name.
    pub splits: Vec<SplitFacts>,
    /// Problems and oddities.
    pub findings: Vec<Finding>,
    /// The frames of the splits, each once.
    posed_frames: Vec<usize>,
    /// Limit of images per split whose pixels were decoded.
    sample: usize,
}

impl CaptureInspection {
    /// Inspects a capture. The pixels of at most `sample` images of each split are decoded.
    ///
    /// # Errors
    /// [`CaptureError::HandModel`] if the shape or pose of a frame does not match the hand model.
    pub fn of(capture: &Capture, sample: usize) -> Result<CaptureInspection, CaptureError> {
        let splits = capture.splits.iter().map(|(name, split)| (name.as_str(), split)).collect();
        let (files, unusable) = FileCheck::of(capture, &pairs_of(capture.splits.values().flat_map(|s| &s.views)));
        Self::of_splits(capture, splits, files, &unusable, sample)
    }

    /// Whether nothing that was found makes training pointless.
    pub fn is_trainable(&self) -> bool {
        self.findings.iter().all(|finding| finding.severity != Severity::Pointless)
    }

    /// Inspects one split of a capture like [`CaptureInspection::of`], but only the files of the sample: the checks
    /// before training on it.
    ///
    /// # Errors
    /// [`CaptureError::Invalid`] if there is no such split; otherwise as in [`CaptureInspection::of`].
    pub fn of_split(capture: &Capture, name: &str, sample: usize) -> Result<CaptureInspection, CaptureError> {
        let split = capture.split(name)?;
        let files = FileCheck { images: split.views.len(), ..Default::default() };
        Self::of_splits(capture, vec![(name, split)], files, &HashSet::new(), sample)
    }

    fn of_splits(
        capture: &Capture,
        splits: Vec<(&str, &Split)>,
        mut files: FileCheck,
        unusable: &HashSet<(usize, usize)>,
        sample: usize,
    ) -> Result<CaptureInspection, CaptureError> {
        let pairs = pairs_of(splits.iter().flat_map(|(_, split)| &split.views));
        let samples: Vec<Vec<SplitView>> = (splits.iter())
            .map(|(_, split)| {
                let usable = split.views.iter().filter(|v| !unusable.contains(&(v.camera, v.frame))).copied();
                spread_evenly(&usable.collect::<Vec<_>>(), |v| v.camera, sample, &mut HashMap::new())
                    .into_iter()
                    .copied()
                    .collect()
            })
            .collect();
        // Splits share images: each is decoded once.
        let sampled = pairs_of(samples.iter().flatten());
        let mut fits: HashMap<(usize, usize), ViewFit> = HashMap::new();
        for (pair, fit) in sampled.iter().zip(fit::fits(capture, &sampled)?) {
            match fit {
                Ok(fit) => drop(fits.insert(*pair, fit)),
                Err(error) => files.add(FileProblem::new(&error)),
            }
        }
        let facts: Vec<SplitFacts> = (splits.iter().zip(&samples))
            .map(|((name, split), sample)| SplitFacts {
                name: (*name).to_owned(),
                cameras: split.cameras.len(),
                frames: split.frames.len(),
                images: split.views.len(),
                is_part: is_part_of_another(&splits, name, split),
                views: sample.iter().filter_map(|v| fits.get(&(v.camera, v.frame)).copied()).collect(),
            })
            .collect();
        let mut inspection = CaptureInspection {
            cameras: cameras::camera_facts(capture, &pairs),
            frames_with_truth: (0..capture.frames.len()).filter(|i| true_pose(capture, *i).is_some()).count(),
            files,
            splits: facts,
            findings: vec![],
            posed_frames: pairs.iter().map(|(_, frame)| *frame).collect::<BTreeSet<_>>().into_iter().collect(),
            sample,
        };
        inspection.findings = findings::findings(capture, &inspection);
        Ok(inspection)
    }

    /// Whether any image can be used, as far as checked. False if all files are missing or broken, or if no image of
    /// the sample could be decoded.
    pub fn has_usable_image(&self) -> bool {
        let decoded = self.splits.iter().any(|split| !split.views.is_empty());
        decoded || (self.sample == 0 && !self.files.sizes.is_empty())
    }

    /// About `count` of the images whose pixels were decoded, spread evenly over splits, frames and cameras, each with
    /// its split's facts. Splits that are part of others contribute none.
    pub fn examples(&self, count: usize) -> Vec<(&SplitFacts, ViewFit)> {
        let mut splits: Vec<&SplitFacts> = self.splits.iter().filter(|s| !s.is_part && !s.views.is_empty()).collect();
        // Small splits leave the rest of their share to the others.
        splits.sort_by_key(|split| split.views.len());
        let mut chosen = HashMap::new();
        let mut examples: Vec<(&SplitFacts, ViewFit)> = vec![];
        for (i, split) in splits.iter().enumerate() {
            let share = count.saturating_sub(examples.len()) / (splits.len() - i);
            let views = spread_evenly(&split.views, |view| view.camera, share, &mut chosen);
            examples.extend(views.into_iter().map(|view| (*split, *view)));
        }
        examples.sort_by(|a, b| a.0.name.cmp(&b.0.name));
        examples
    }
}

/// Pairs of camera and frame of views, each once, in the order of frames.
fn pairs_of<'a>(views: impl Iterator<Item = &'a SplitView>) -> Vec<(usize, usize)> {
    let mut pairs: Vec<(usize, usize)> = views.map(|view| (view.camera, view.frame)).collect();
    pairs.sort_unstable_by_key(|&(camera, frame)| (frame, camera));
    pairs.dedup();
    pairs
}

/// Whether another split holds all images of this one; if two have the same images, the second by name is part of the
/// first.
fn is_part_of_another(splits: &[(&str, &Split)], name: &str, split: &Split) -> bool {
    splits.iter().any(|(other, whole)| {
        let may_hold =
            whole.views.len() > split.views.len() || (whole.views.len() == split.views.len() && *other < name);
        may_hold && {
            let held: HashSet<_> = whole.views.iter().map(|v| (v.camera, v.frame)).collect();
            split.views.iter().all(|v| held.contains(&(v.camera, v.frame)))
        }
    })
}

//! What there is to know of a capture before an avatar is trained on it, and what is wrong or odd about it.
//!
//! Every file of the splits is looked at, but only for its header and its end; pixels are decoded of a bounded number of images
//! of each split, spread evenly over cameras and frames. A broken file is a finding, not an error.

mod cameras;
mod files;
mod findings;
mod fit;
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

/// Images of a split whose pixels are looked at unless asked otherwise.
pub const DEFAULT_SAMPLE: usize = 240;

/// What was found of a split.
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
    /// Whether all of its images are another split's, too.
    pub is_part: bool,
    /// What the pixels of the sampled images say, frames outermost; images that could not be decoded are not among them.
    pub views: Vec<ViewFit>,
}

impl SplitFacts {
    /// Part of the images that is hand, where there are masks.
    pub fn coverage(&self) -> Option<Spread> {
        Spread::of(self.views.iter().filter_map(|view| view.coverage))
    }

    /// How well the template meets the masks in the frames' own poses.
    pub fn iou_given(&self) -> Option<Spread> {
        Spread::of(self.views.iter().filter_map(|view| view.iou_given))
    }

    /// The same in the true poses, where these are known.
    pub fn iou_true(&self) -> Option<Spread> {
        Spread::of(self.views.iter().filter_map(|view| view.iou_true))
    }
}

/// Facts about a capture.
#[derive(Debug)]
pub struct CaptureInspection {
    /// Every camera of the capture.
    pub cameras: Vec<CameraFacts>,
    /// Frames whose true pose is known.
    pub frames_with_truth: usize,
    /// The files of all splits.
    pub files: FileCheck,
    /// The splits by name.
    pub splits: Vec<SplitFacts>,
    /// What is wrong or odd.
    pub findings: Vec<Finding>,
    /// The frames of the splits, each once.
    posed_frames: Vec<usize>,
    /// Most images of a split whose pixels were looked at.
    sample: usize,
}

impl CaptureInspection {
    /// Looks a capture over. The pixels of at most `sample` images of each split are decoded.
    ///
    /// # Errors
    /// [`CaptureError::HandModel`] when the shape or pose of a frame does not fit the hand model.
    pub fn of(capture: &Capture, sample: usize) -> Result<CaptureInspection, CaptureError> {
        let splits = capture.splits.iter().map(|(name, split)| (name.as_str(), split)).collect();
        let (files, unusable) = FileCheck::of(capture, &pairs_of(capture.splits.values().flat_map(|s| &s.views)));
        Self::of_splits(capture, splits, files, &unusable, sample)
    }

    /// Looks at one split of a capture as [`CaptureInspection::of`] does, but at no file outside of the sample: what there is to
    /// know before training on it.
    ///
    /// # Errors
    /// [`CaptureError::Invalid`] when there is no such split; else as of [`CaptureInspection::of`].
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

    /// Whether any image can be used, as far as was looked: all of the files are missing or broken, or all of the sample could
    /// not be decoded.
    pub fn has_usable_image(&self) -> bool {
        let decoded = self.splits.iter().any(|split| !split.views.is_empty());
        decoded || (self.sample == 0 && !self.files.sizes.is_empty())
    }

    /// About `count` of the images whose pixels were looked at, spread evenly over splits, frames and cameras, each with its
    /// split's facts. Splits that are part of others have none.
    pub fn examples(&self, count: usize) -> Vec<(&SplitFacts, ViewFit)> {
        let mut splits: Vec<&SplitFacts> = self.splits.iter().filter(|s| !s.is_part && !s.views.is_empty()).collect();
        // What small splits do not use up is left for the others.
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

/// Camera and frame of views, each pair once, in the order of frames.
fn pairs_of<'a>(views: impl Iterator<Item = &'a SplitView>) -> Vec<(usize, usize)> {
    let mut pairs: Vec<(usize, usize)> = views.map(|view| (view.camera, view.frame)).collect();
    pairs.sort_unstable_by_key(|&(camera, frame)| (frame, camera));
    pairs.dedup();
    pairs
}

/// Whether another split holds all images of this one; of two with the same images, the second by name is part of the first.
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

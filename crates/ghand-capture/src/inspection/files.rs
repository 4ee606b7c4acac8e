//! Whether the files of a capture's images exist, are complete and have their cameras' sizes.

use std::collections::{BTreeMap, HashSet};
use std::path::{Path, PathBuf};

use rayon::prelude::*;

use crate::capture::Capture;
use crate::error::CaptureError;
use crate::images::file::{Role, check};

/// Most problems stored with their reasons; all are counted.
pub const MOST_PROBLEMS: usize = 100;

/// A file that cannot be used.
#[derive(Debug)]
pub struct FileProblem {
    /// The file.
    pub file: PathBuf,
    /// Whether it is missing.
    pub missing: bool,
    /// The problem, with the file's name and a remedy.
    pub reason: String,
}

/// The files of all splits, each checked once.
#[derive(Debug, Default)]
pub struct FileCheck {
    /// Images of the splits.
    pub images: usize,
    /// Expected files of images and masks.
    pub files: usize,
    /// Missing files.
    pub missing: usize,
    /// Existing files that are truncated, not images, or not of their cameras' sizes.
    pub broken: usize,
    /// Masks without a file, which are made from the posed hand model.
    pub made_masks: usize,
    /// Sizes (width, height) of cameras, pixels, and how many images have them.
    pub sizes: BTreeMap<[u32; 2], usize>,
    /// The first problems in the order of cameras and frames, at most [`MOST_PROBLEMS`].
    pub problems: Vec<FileProblem>,
}

/// Result for one image.
#[derive(Debug, Default)]
struct Found {
    files: usize,
    made_mask: bool,
    size: Option<[u32; 2]>,
    problems: Vec<FileProblem>,
}

impl FileCheck {
    /// Checks the headers and ends of the files of some pairs of camera and frame, in parallel. Also returns the pairs
    /// with problems.
    pub(super) fn of(capture: &Capture, pairs: &[(usize, usize)]) -> (FileCheck, HashSet<(usize, usize)>) {
        // In parts, so that a capture without any file does not accumulate as many reasons.
        const PART: usize = 4096;
        let mut total = FileCheck { images: pairs.len(), ..Default::default() };
        let mut unusable = HashSet::new();
        for part in pairs.chunks(PART) {
            let found: Vec<Found> = part.par_iter().map(|&(camera, frame)| look(capture, camera, frame)).collect();
            for (pair, Found { files, made_mask, size, problems }) in part.iter().zip(found) {
                if !problems.is_empty() {
                    unusable.insert(*pair);
                }
                total.files += files;
                total.made_masks += usize::from(made_mask);
                if let Some(size) = size {
                    *total.sizes.entry(size).or_default() += 1;
                }
                problems.into_iter().for_each(|problem| total.add(problem));
            }
        }
        (total, unusable)
    }

    /// Counts a problem; stores only the first ones.
    pub(super) fn add(&mut self, problem: FileProblem) {
        *(if problem.missing { &mut self.missing } else { &mut self.broken }) += 1;
        if self.problems.len() < MOST_PROBLEMS {
            self.problems.push(problem);
        }
    }
}

impl FileProblem {
    pub(super) fn new(error: &CaptureError) -> FileProblem {
        let missing = matches!(error, CaptureError::Io { source, .. } if source.kind() == std::io::ErrorKind::NotFound);
        let file = error.path().unwrap_or(Path::new("")).to_path_buf();
        let similar = if missing { similar_name(&file) } else { None };
        let similar = similar.map_or(String::new(), |name| format!("; there is {name:?}, which is another name"));
        FileProblem { file, missing, reason: format!("{error}{similar}") }
    }
}

/// The name of a file beside a missing one that differs only in capitals or in its ending.
fn similar_name(file: &Path) -> Option<String> {
    let stem = |path: &Path| path.file_stem().map(|stem| stem.to_string_lossy().to_lowercase());
    let wanted = stem(file)?;
    let entries = std::fs::read_dir(file.parent()?).ok()?.filter_map(|entry| Some(entry.ok()?.path()));
    let mut names: Vec<_> = entries.filter(|path| stem(path).as_ref() == Some(&wanted)).collect();
    names.sort();
    Some(names.first()?.file_name()?.to_string_lossy().into_owned())
}

fn look(capture: &Capture, camera: usize, frame: usize) -> Found {
    let mut found = Found::default();
    let Ok(size) = capture.camera_and_frame(camera, frame).map(|(c, _)| (c.width, c.height)) else { return found };
    let mut look_at = |file: PathBuf, role: Role| {
        found.files += 1;
        let checked = check(&file, role, size);
        if let Err(error) = &checked {
            found.problems.push(FileProblem::new(error));
        }
        checked.is_ok()
    };
    let sound = capture.image_file(camera, frame).is_ok_and(|file| look_at(file, Role::Image));
    let may_make = capture.images.made_masks.is_some();
    let mask = capture.mask_file(camera, frame).ok().flatten();
    match mask.filter(|file| !may_make || file.exists()) {
        Some(file) => {
            look_at(file, Role::Mask);
        }
        None => found.made_mask = may_make,
    }
    found.size = sound.then_some([size.0, size.1]);
    found
}

//! Checks whether training on a capture can succeed: the checks of `ghand inspect`, before training.

use std::collections::BTreeSet;
use std::path::Path;

use anyhow::bail;
use ghand_capture::Capture;
use ghand_capture::inspection::{CaptureInspection, Severity};

/// Number of images of the training split whose pixels are checked: enough to find problems that nearly all of them
/// have, within a few seconds.
const TRAIN_SAMPLE: usize = 60;
/// Number of images of the test split whose pixels are checked.
const TEST_SAMPLE: usize = 20;

/// Warns of oddities of the training split, and of problems of the test split if it has images. `path` is the
/// capture's, for messages.
///
/// # Errors
/// One sentence if the splits share images, or with everything that makes training pointless, unless `ignored`; then these
/// are also warnings.
pub fn check_before_training(
    capture: &Capture,
    path: &Path,
    train_split: &str,
    test_split: &str,
    ignored: bool,
) -> anyhow::Result<()> {
    let shared = shared_images(capture, train_split, test_split);
    if shared > 0 {
        let text = format!(
            "{}: {shared} of the images of split {test_split:?}, which judges the avatar, are those of {train_split:?}, which \
             trains it",
            path.display()
        );
        if !ignored {
            bail!("{text}; name other splits with --split and --test-split, or train anyway with --ignore-checks");
        }
        log::warn!("{text}: its figures are those of training");
    }
    let found = CaptureInspection::of_split(capture, train_split, TRAIN_SAMPLE)?.findings;
    let (refused, odd): (Vec<_>, Vec<_>) =
        found.into_iter().partition(|finding| finding.severity == Severity::Pointless && !ignored);
    if !refused.is_empty() {
        let reasons: Vec<String> = refused.iter().map(ToString::to_string).collect();
        bail!(
            "{}: training on the split {train_split:?} cannot succeed: {}; correct the capture (`ghand inspect` shows \
             more), or train anyway with --ignore-checks",
            path.display(),
            reasons.join("; ")
        );
    }
    odd.iter().for_each(|finding| log::warn!("{}: split {train_split:?}: {finding}", path.display()));
    if test_split != train_split && capture.splits.get(test_split).is_some_and(|split| !split.views.is_empty()) {
        for finding in CaptureInspection::of_split(capture, test_split, TEST_SAMPLE)?.findings {
            log::warn!("{}: split {test_split:?}: {finding}", path.display());
        }
    }
    Ok(())
}

/// Number of images that are in both splits.
fn shared_images(capture: &Capture, train_split: &str, test_split: &str) -> usize {
    let images = |name: &str| {
        let views = capture.splits.get(name).map_or(&[][..], |split| &split.views);
        views.iter().map(|view| (view.camera, view.frame)).collect::<BTreeSet<_>>()
    };
    images(train_split).intersection(&images(test_split)).count()
}

//! When an alignment cannot be right.

use ghand_core::HandModel;
use serde::{Deserialize, Serialize};

use super::MaskFit;

/// Why an alignment is not used.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, thiserror::Error)]
pub enum Rejection {
    /// There is nothing to align with.
    #[error("no mask shows the outline of the hand near that of the template")]
    NoOutline,
    /// The masks are not what this template looks like.
    #[error(
        "the aligned template's contours are {distance:.1} pixels off the masks, too far for hands of {size:.0} pixels; its \
         side, its size, the cameras or the masks may be wrong"
    )]
    NoMatch {
        /// Median distance of the contours, pixels.
        distance: f64,
        /// Square root of the masks' mean area, pixels.
        size: f64,
    },
    /// No hand has such proportions.
    #[error(
        "the aligned template's bones differ in length by {:.0} % from its own proportions; it may be of the wrong side",
        100.0 * deviation
    )]
    Proportions {
        /// Standard deviation of the logarithms of the bones' relative lengths.
        deviation: f64,
    },
    /// The given poses fit better.
    #[error("the given poses fit the masks better than the aligned ones")]
    NotBetter,
}

/// Largest median distance of the contours, relative to the size of the masks. Good fits are below 0.02, even with masks
/// off by 2 pixels of 80; those of templates ten times too large or too small above 0.045. The overlap would not tell:
/// masks may show an arm that the template lacks.
const FARTHEST: f64 = 0.03;
/// Largest standard deviation of the bones' relative lengths, logarithmic: right templates end below 0.05, a left one for
/// a right hand at 0.15.
const LARGEST_DEVIATION: f64 = 0.1;

/// Whether and why the aligned poses should not be used.
pub(super) fn rejection(fit: [MaskFit; 2], given: &HandModel, aligned: &HandModel) -> Option<Rejection> {
    let [before, after] = fit;
    let deviation = length_deviation(given, aligned);
    if after.contours[0].is_nan() {
        Some(Rejection::NoOutline)
    } else if after.contours[0] > FARTHEST * after.mask_size {
        Some(Rejection::NoMatch { distance: after.contours[0], size: after.mask_size })
    } else if deviation > LARGEST_DEVIATION {
        Some(Rejection::Proportions { deviation })
    } else if after.overlap <= before.overlap || after.contours[0] >= before.contours[0] {
        Some(Rejection::NotBetter)
    } else {
        None
    }
}

/// Standard deviation of the logarithms of the bones' lengths relative to those of another template of the same rig: the
/// size of the whole hand does not count.
fn length_deviation(given: &HandModel, aligned: &HandModel) -> f64 {
    let length = |model: &HandModel, k: usize, parent: usize| model.joints[k].distance(model.joints[parent]);
    let changes: Vec<f64> = (given.parents.iter().enumerate())
        .filter_map(|(k, parent)| {
            let change = (length(aligned, k, (*parent)?) / length(given, k, (*parent)?)).ln();
            change.is_finite().then_some(change)
        })
        .collect();
    let mean = changes.iter().sum::<f64>() / changes.len().max(1) as f64;
    (changes.iter().map(|change| (change - mean).powi(2)).sum::<f64>() / changes.len().max(1) as f64).sqrt()
}

//! When an alignment cannot be right.

use ghand_core::{HandModel, Side};
use serde::{Deserialize, Serialize};

use crate::alignment::MaskFit;

/// Why an alignment is not used.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, thiserror::Error)]
pub enum Rejection {
    /// There is nothing to align with.
    #[error(
        "no mask shows the outline of the hand near that of the template; `ghand inspect` shows where the poses and the \
         cameras put the hand"
    )]
    NoOutline,
    /// The masks are not what this template looks like.
    #[error(
        "the best fit leaves the template's contours {distance:.1} pixels off the masks, too far for hands of {size:.0} \
         pixels; compare masks, cameras and the template's size with the images (`ghand inspect`)"
    )]
    NoMatch {
        /// Median distance of the contours, pixels.
        distance: f64,
        /// Square root of the masks' mean area, pixels.
        size: f64,
    },
    /// The template is somewhere else, or of another size, where few of its contours meet the masks' outlines.
    #[error(
        "the best fit overlaps the masks by only {:.0} %; compare masks, cameras and the template's size with the images \
         (`ghand inspect`)",
        100.0 * overlap
    )]
    NoOverlap {
        /// Mean intersection over union of the hand and the masks.
        overlap: f64,
    },
    /// The masks show the other hand.
    #[error(
        "the masks fit a {other} hand better than the {side} one of the hand model; correct the capture's side and its hand \
         model, or the images if they are mirrored",
        other = side.other()
    )]
    OtherHand {
        /// The side of the hand model.
        side: Side,
    },
    /// No hand has such a bone.
    #[error(
        "the best fit makes the bone from {joint} {:.0} % as long as the template's, relative to the whole hand, which no \
         hand is; compare masks and cameras with the images (`ghand inspect`)",
        100.0 * ratio
    )]
    Proportions {
        /// The joint where the bone begins.
        joint: String,
        /// Its length relative to the template's, less what all bones have in common.
        ratio: f64,
    },
    /// The given poses fit better.
    #[error(
        "the given poses fit the masks better than the best fit does: images of too few sides, or masks that change \
         without the hand"
    )]
    NotBetter,
}

/// Largest median distance of the contours, relative to the size of the masks. Good fits are below 0.02, even with masks
/// off by 2 pixels of 80; those of templates ten times too large above 0.04.
const FARTHEST: f64 = 0.03;
/// Least overlap. Good fits have more than 0.85, those of templates ten times too small less than 0.2.
const LEAST_OVERLAP: f64 = 0.4;
/// Standard deviation of a bone's length in a population, relative to the size of the hand, logarithmic. Buryanov and
/// Kotiuk (2010) measured single phalanges and metacarpals of adults with 8 to 15 %, of which the size of the hand is 6.
const PERSONS: f64 = 0.11;
/// Standard deviation of where a template has its joints, relative to the lengths of the bones: of the middle of the joint
/// in its flesh nothing is seen, and the rigs that people use differ by so much.
const RIGS: f64 = 0.1;
/// A bone is judged impossible beyond so many standard deviations of both.
const MOST_DEVIATIONS: f64 = 4.5;

/// Whether a fit could be that of a hand to its own masks.
pub(crate) fn is_match(fit: &MaskFit) -> bool {
    fit.contours[0] <= FARTHEST * fit.mask_size && fit.overlap >= LEAST_OVERLAP
}

/// Whether and why the aligned poses should not be used. `is_other_hand` says whether the mirrored template fits better.
pub(crate) fn rejection(
    fit: [MaskFit; 2],
    given: &HandModel,
    aligned: &HandModel,
    is_other_hand: bool,
) -> Option<Rejection> {
    let [before, after] = fit;
    if after.contours[0].is_nan() {
        Some(Rejection::NoOutline)
    } else if is_other_hand {
        Some(Rejection::OtherHand { side: given.side })
    } else if after.contours[0] > FARTHEST * after.mask_size {
        Some(Rejection::NoMatch { distance: after.contours[0], size: after.mask_size })
    } else if after.overlap < LEAST_OVERLAP {
        Some(Rejection::NoOverlap { overlap: after.overlap })
    } else if let Some(impossible) = impossible_bone(given, aligned) {
        Some(impossible)
    } else if after.overlap <= before.overlap || after.contours[0] >= before.contours[0] {
        Some(Rejection::NotBetter)
    } else {
        None
    }
}

/// The bone whose length is the least likely, if no hand has it.
fn impossible_bone(given: &HandModel, aligned: &HandModel) -> Option<Rejection> {
    let length = |model: &HandModel, k: usize, parent: usize| model.joints[k].distance(model.joints[parent]);
    let mut changes: Vec<(usize, f64)> = (given.parents.iter().enumerate())
        .filter_map(|(k, parent)| {
            let parent = (*parent)?;
            let change = (length(aligned, k, parent) / length(given, k, parent)).ln();
            change.is_finite().then_some((parent, change))
        })
        .collect();
    // The median: what a few bones take does not count for the size of the hand.
    changes.sort_by(|a, b| a.1.total_cmp(&b.1));
    let size = changes.get(changes.len() / 2)?.1;
    let largest = |(parent, change): &(usize, f64)| (*parent, change - size);
    let (joint, change) = changes.iter().map(largest).max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))?;
    let joint = given.joint_names.get(joint).cloned().unwrap_or_else(|| format!("joint {joint}"));
    let is_impossible = change.abs() > MOST_DEVIATIONS * PERSONS.hypot(RIGS);
    is_impossible.then(|| Rejection::Proportions { joint, ratio: change.exp() })
}

#[cfg(test)]
mod tests {
    use ghand_hand_model::builtin::builtin_hand;
    use glam::DVec3;

    use super::*;

    /// The built-in hand with each joint moved so that the bones to these joints are so many times as long.
    fn stretched(factor: impl Fn(&str) -> f64) -> [HandModel; 2] {
        let model = builtin_hand(Side::Right).unwrap();
        let mut joints: Vec<DVec3> = model.joints.clone();
        for (k, parent) in model.parents.iter().enumerate() {
            if let Some(p) = *parent {
                joints[k] = joints[p] + factor(&model.joint_names[k]) * (model.joints[k] - model.joints[p]);
            }
        }
        [model.clone(), HandModel { joints, ..model }]
    }

    #[test]
    fn hands_at_the_ends_of_the_population_are_possible_and_a_finger_twice_as_long_is_not() {
        // Children's hands are a half of an adult's; phalanges differ by three standard deviations of a tenth beside that.
        for size in [0.5, 1.25] {
            for (bone, factor) in [("proximal", 1.35), ("intermediate", 0.72), ("tip", 0.72), ("metacarpal", 1.3)] {
                let [given, aligned] = stretched(|name| if name.contains(bone) { size * factor } else { size });
                assert_eq!(impossible_bone(&given, &aligned), None, "{bone} {size}");
            }
        }
        let [given, aligned] = stretched(|name| if name == "ring-finger-phalanx-intermediate" { 2.1 } else { 1.0 });
        let Some(Rejection::Proportions { joint, ratio }) = impossible_bone(&given, &aligned) else {
            panic!("a phalanx twice as long is possible")
        };
        assert!(joint == "ring-finger-phalanx-proximal" && (ratio - 2.1).abs() < 1e-9, "{joint} {ratio}");
    }
}

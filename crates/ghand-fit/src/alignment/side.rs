//! Whether the hand in the masks is the other one: left instead of right, or the reverse.
//!
//! Both hands are fitted to the masks of some frames, with all steps of an alignment, and compared by what remains: the
//! contours' distances and how unusual the proportions are that they need.

use ghand_core::posing::pose_hand;
use ghand_core::rotation::{axis_angle_from_rotation, rotation_from_axis_angle};
use ghand_core::{HandModel, InvalidHandModel, Pose};
use glam::{DMat3, DVec3};
use nalgebra::Matrix3;

use super::results::rejection::is_match;
use super::{Fit, Images, MaskFit, STEPS, Shape, round_proportions};

/// Frames that are fitted, evenly over those with masks. A few in different poses decide: a flat hand is its own mirror
/// image, a bent one is not.
const FRAMES: usize = 6;
/// What remains of the other hand's fit must be less than this part of what remains of the template's. In 18 synthetic
/// captures of persons whose bones differ from the template's by up to four standard deviations of the published spread, a
/// wrong side leaves 1.6 to 2.5 times as much as the right one; of a real hand with poor masks and few bent fingers 1.27
/// times, and then nothing is said.
const DECISIVE: f64 = 0.75;

/// What is left of a fit.
#[derive(Debug, Clone, Copy)]
struct Remains {
    cost: f64,
    fit: MaskFit,
}

impl Fit<'_> {
    /// Whether the mirror image of the template fits the masks decisively better than the template does.
    ///
    /// # Errors
    /// [`InvalidHandModel`] if a pose does not fit the template.
    pub(super) fn is_other_hand(&self, images: &[Images]) -> Result<bool, InvalidHandModel> {
        let shown: Vec<usize> = (0..self.given.len()).filter(|k| !images[*k].is_empty()).collect();
        // In a single image, the other hand seen from behind has the same outline.
        if shown.iter().all(|frame| images[*frame].len() < 2) {
            return Ok(false);
        }
        let count = FRAMES.min(shown.len());
        let chosen: Vec<usize> = (0..count).map(|k| shown[(2 * k + 1) * shown.len() / (2 * count)]).collect();
        let images: Vec<Images> = chosen.iter().map(|k| images[*k].clone()).collect();
        let given: Vec<&Pose> = chosen.iter().map(|k| self.given[*k]).collect();
        let template = self.template;
        let anew = Fit::of_proportions(self.proportions.clone(), template, given.clone(), Shape::Unknown);
        let own = remains(anew, &images)?;
        let other = template.mirrored();
        // Poses of the wrong hand come about in two ways: the hand was fitted with the wrong model, so that its joints are
        // about where they should be, or its rotations are right and only the side is not.
        let refitted: Vec<Pose> =
            given.iter().map(|pose| with_joints_of(&other, template, pose)).collect::<Result<_, _>>()?;
        let renamed: Vec<Pose> = given.iter().map(|pose| renamed(&other, template, pose)).collect();
        let proportions = round_proportions(&other);
        for poses in [refitted, renamed] {
            let anew = Fit::of_proportions(proportions.clone(), &other, poses.iter().collect(), Shape::Unknown);
            let found = remains(anew, &images)?;
            if found.cost < DECISIVE * own.cost && found.fit.overlap > own.fit.overlap && is_match(&found.fit) {
                return Ok(true);
            }
        }
        Ok(false)
    }
}

/// What is left of a fit: half the squared residuals of contours and proportions, relative to their standard deviations;
/// and the mean overlap, since the fewer contours there are near the masks' outlines, the less remains of them.
fn remains(mut fit: Fit, images: &[Images]) -> Result<Remains, InvalidHandModel> {
    fit.follow_contours(images, &mut |_, _, _| true)?;
    let equations = fit.equations(images, STEPS[STEPS.len() - 1])?;
    let contours: f64 = equations.iter().map(|frame| frame.cost).sum();
    let unusual = |(k, value): (usize, &f64)| 0.5 * (value / fit.proportions.deviation(k)).powi(2);
    let cost = contours + fit.shape.iter().enumerate().map(unusual).sum::<f64>();
    let (fit, _) = fit.fit_of(&fit.shaped()?, &fit.poses, images)?;
    Ok(Remains { cost, fit })
}

/// The pose of the other hand whose joints are as near as a rigid motion brings them to those of the given one; its
/// fingers are bent as much, as the mirror image.
fn with_joints_of(other: &HandModel, template: &HandModel, pose: &Pose) -> Result<Pose, InvalidHandModel> {
    let mut mirrored = pose.mirrored();
    let wanted = pose_hand(template, &[], pose)?;
    let found = pose_hand(other, &[], &mirrored)?;
    let [wanted, found]: [Vec<DVec3>; 2] =
        [wanted, found].map(|hand| hand.chain.world.iter().map(|bone| bone.translation).collect());
    let mean = |points: &[DVec3]| points.iter().sum::<DVec3>() / points.len() as f64;
    let (to, from) = (mean(&wanted), mean(&found));
    let turn = best_rotation(&wanted, &found, to, from);
    let root = rotation_from_axis_angle(mirrored.rotations[0]);
    mirrored.rotations[0] = axis_angle_from_rotation(&(turn * root));
    // The root turns about its rest place; the chains are without the translation.
    let origin = found[0];
    mirrored.translation = pose.translation + to + turn * (origin - from) - origin;
    Ok(mirrored)
}

/// The same rotations, with the wrist where it was.
fn renamed(other: &HandModel, template: &HandModel, pose: &Pose) -> Pose {
    Pose { translation: pose.translation + template.joints[0] - other.joints[0], ..pose.clone() }
}

/// The rotation that brings `from` about its mean nearest to `to` about its own (Kabsch).
fn best_rotation(to: &[DVec3], from: &[DVec3], to_mean: DVec3, from_mean: DVec3) -> DMat3 {
    let mut covariance = Matrix3::zeros();
    for (a, b) in to.iter().zip(from) {
        let (a, b) = ((*a - to_mean).to_array(), (*b - from_mean).to_array());
        covariance += nalgebra::Vector3::from(a) * nalgebra::Vector3::from(b).transpose();
    }
    let parts = covariance.svd(true, true);
    let (Some(u), Some(v)) = (parts.u, parts.v_t) else { return DMat3::IDENTITY };
    let sign = (u * v).determinant().signum();
    let turn = u * Matrix3::from_diagonal(&nalgebra::Vector3::new(1.0, 1.0, sign)) * v;
    DMat3::from_cols_array(&std::array::from_fn(|i| turn[(i % 3, i / 3)]))
}

//! The Gaussians that are visible in something: a training image, or a view of the hand in other poses and from other
//! sides.
//!
//! What no training image shows may be the hand's other side, or be between fingers that are closed in all of them. So a
//! Gaussian is superfluous only if other views do not show it either: it lies below the rest in all poses, or has next to
//! no size.

use std::ops::ControlFlow;

use ghand_avatar::{Avatar, Scene};
use ghand_capture::CaptureError;
use ghand_core::light::directions;
use ghand_core::posing::pose_hand;
use ghand_core::{Camera, HandModel, Pose};
use ghand_hand_model::named_poses::{POSE_NAMES, named_pose};
use ghand_render::splat::{Purpose, SplatOptions};
use ghand_render::{Gpu, RenderError, buffers};
use glam::DVec3;

use crate::train_error::TrainError;
use ghand_fit::texels::frames::evenly;

/// Less than this in each channel of each pixel is shown by no display.
const LEAST_WEIGHT: f32 = 1.0 / 255.0;
/// Most training poses that are drawn from all sides.
const POSES: usize = 12;
/// One in this many of the directions of a light is a view.
const DIRECTION_STEP: usize = 4;
/// Edge of the pictures from there, pixels.
const SIDE: u32 = 256;
/// Distance of the eye from there, in radii of the hand.
const DISTANCE: f64 = 4.0;

/// For each of an avatar's Gaussians whether its weight is at least 1/255 in a pixel of a training image or of one of the
/// other views. `poses` are those of the training frames; `images` are, with their frames, the cameras of the training
/// images, which have at most `size` pixels.
///
/// # Errors
/// [`TrainError`] if a view is unusable or the device failed.
pub(crate) fn visible_gaussians(
    gpu: &Gpu,
    avatar: &Avatar,
    poses: &[Pose],
    images: impl Iterator<Item = Result<(usize, Camera), CaptureError>>,
    size: [u32; 2],
) -> Result<Vec<bool>, TrainError> {
    let size = size.map(|edge| edge.max(SIDE));
    let options = SplatOptions { purpose: Purpose::Images, largest_weights: true, ..SplatOptions::default() };
    let mut scan = VisibilityScan {
        gpu,
        scene: Scene::with_options(gpu, &[avatar], 1, size, options)?,
        visible: vec![false; avatar.template.len()],
    };
    let model = &avatar.model;
    let named = POSE_NAMES.iter().filter_map(|name| named_pose(name, model));
    for pose in named.chain(evenly(poses, POSES, 0)) {
        let [low, high] = bounds(model, &pose)?;
        let center = 0.5 * (low + high);
        let radius = 0.5 * (high - low).length();
        scan.set_pose(&pose)?;
        for towards in directions().iter().step_by(DIRECTION_STEP) {
            if scan.add_view(&from_side(center, radius, *towards))?.is_break() {
                return Ok(scan.visible);
            }
        }
    }
    let mut posed = None;
    for image in images {
        let (frame, camera) = image?;
        if posed != Some(frame) {
            scan.set_pose(&poses[frame])?;
            posed = Some(frame);
        }
        if scan.add_view(&camera)?.is_break() {
            break;
        }
    }
    Ok(scan.visible)
}

/// Lowest and highest coordinates of a hand's vertices in a pose.
fn bounds(model: &HandModel, pose: &Pose) -> Result<[DVec3; 2], TrainError> {
    let vertices = pose_hand(model, &[], pose)?.vertices;
    let low = vertices.iter().copied().fold(DVec3::INFINITY, DVec3::min);
    Ok([low, vertices.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max)])
}

/// A camera that sees all of a ball from one side.
fn from_side(center: DVec3, radius: f64, towards: DVec3) -> Camera {
    let up = towards.any_orthonormal_vector();
    let angle = 2.0 * (1.0 / DISTANCE).asin();
    Camera::look_at(center + DISTANCE * radius * towards, center, up, angle, SIDE, SIDE)
}

struct VisibilityScan<'a> {
    gpu: &'a Gpu,
    scene: Scene,
    visible: Vec<bool>,
}

impl VisibilityScan<'_> {
    fn set_pose(&mut self, pose: &Pose) -> Result<(), RenderError> {
        self.scene.set_pose(self.gpu, 0, 0, pose)
    }

    /// Adds what a camera shows; breaks once all Gaussians are visible.
    fn add_view(&mut self, camera: &Camera) -> Result<ControlFlow<()>, RenderError> {
        self.scene.set_view(self.gpu, camera, [0.0; 3])?;
        self.scene.run_frame(self.gpu, |_, _| {})?;
        let weights: Vec<f32> = buffers::read(self.gpu, self.scene.splatter().largest_weights(), self.visible.len())?;
        for (visible, weight) in self.visible.iter_mut().zip(weights) {
            *visible |= weight >= LEAST_WEIGHT;
        }
        Ok(if self.visible.iter().all(|visible| *visible) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) })
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

    use ghand_avatar::{AvatarConfig, PropertyTables};
    use ghand_core::Side;
    use ghand_hand_model::builtin::builtin_hand;
    use ghand_hand_model::surface::sample_surface;
    use ghand_render::AdapterChoice;

    use super::*;

    #[test]
    fn only_what_is_inside_the_hand_is_never_shown() {
        let gpu = Gpu::new(&AdapterChoice::from_env()).unwrap_or_else(|e| panic!("{e}"));
        let model = builtin_hand(Side::Right).unwrap();
        let config = AvatarConfig { uv_resolution: 96, ..Default::default() };
        let samples = sample_surface(&model, 96).unwrap();
        let mut avatar = Avatar::untrained_at(&model, &samples, &config, [0.8, 0.6, 0.5], 0.0, 0).unwrap();
        let count = avatar.template.len();
        // Small ones, one in forty, are moved into the bone of a finger: the palm is open at the wrist. The skin has no gaps.
        let inside = |p: usize| p % 40 == 7;
        let PropertyTables::Direct(tables) = &mut avatar.tables else { unreachable!() };
        let sizes = tables.appearance[..count].iter_mut().enumerate();
        sizes.for_each(|(p, logit)| *logit = if inside(p) { -4.0 } else { -0.9 });
        let bone = model.parents.iter().rposition(Option::is_some).unwrap();
        let bone = model.parents[bone].unwrap();
        let middle = model.joints[bone];
        for p in (0..count).filter(|p| inside(*p)) {
            for (c, row) in avatar.template.rest.chunks_exact_mut(count).enumerate() {
                row[p] = middle[c] as f32;
            }
            for (joint, row) in avatar.template.weights.chunks_exact_mut(count).enumerate() {
                row[p] = if joint == bone { 1.0 } else { 0.0 };
            }
        }
        let visible = visible_gaussians(&gpu, &avatar, &[], std::iter::empty(), [SIDE; 2]).unwrap();
        let shown_inside = (0..count).filter(|p| inside(*p) && visible[*p]).count();
        let hidden_outside = (0..count).filter(|p| !inside(*p) && !visible[*p]).count();
        println!("{count} Gaussians; inside, {shown_inside} are shown, outside {hidden_outside} are not");
        assert_eq!(shown_inside, 0);
        assert!(hidden_outside * 100 < count);
        // An image from inside the finger shows them.
        let eye = middle + 0.014 * (model.joints[model.parents[bone].unwrap()] - middle).normalize();
        let camera = Camera::look_at(eye, middle, (middle - eye).any_orthonormal_vector(), 1.0, 64, 64);
        let pose = Pose::rest(model.joint_count());
        let visible = visible_gaussians(&gpu, &avatar, &[pose], std::iter::once(Ok((0, camera))), [64; 2]).unwrap();
        assert!((0..count).any(|p| inside(p) && visible[p]));
    }
}

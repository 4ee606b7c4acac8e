//! The texels that images require: fine ones where images show them large, coarse ones elsewhere.

use ghand_capture::{Capture, Split};
use ghand_core::Pose;
use ghand_hand_model::SurfaceSamples;
use ghand_hand_model::surface::sample_surface;
use ghand_render::Gpu;

use super::TexelError;
use super::views::{TexelObserver, some_views};

/// Most images that are looked at.
const VIEWS: usize = 200;

/// The texels of the template in a texture of `resolution` texels a side, those that are smaller in all images than
/// `merge_below` pixels merged. `poses` holds the poses of the split's frames.
///
/// # Errors
/// [`TexelError`] if an image or the model is unusable.
pub fn required_texels(
    gpu: &Gpu,
    capture: &Capture,
    split: &Split,
    poses: &[Pose],
    resolution: u32,
    merge_below: f64,
) -> Result<SurfaceSamples, TexelError> {
    let samples = sample_surface(&capture.template, resolution)?;
    if merge_below == 0.0 {
        return Ok(samples);
    }
    let edges = largest_edges(gpu, capture, split, poses, samples.clone())?;
    let may_merge: Vec<bool> = edges.iter().map(|edge| *edge < merge_below).collect();
    Ok(samples.merged(&may_merge))
}

/// The longest edge that each texel has in the images which show it, pixels; 0 for texels that none shows.
///
/// # Errors
/// [`TexelError`] if an image or the model is unusable.
pub fn largest_edges(
    gpu: &Gpu,
    capture: &Capture,
    split: &Split,
    poses: &[Pose],
    samples: SurfaceSamples,
) -> Result<Vec<f64>, TexelError> {
    let observer = TexelObserver::new(gpu, capture, samples)?;
    let mut largest = vec![0.0f64; observer.samples().len()];
    for view in some_views(split, VIEWS) {
        let seen = observer.observe(&view, &poses[view.position], 0.0)?;
        for (edge, view) in largest.iter_mut().zip(seen) {
            *edge = edge.max(view.map_or(0.0, |view| view.edge));
        }
    }
    Ok(largest)
}

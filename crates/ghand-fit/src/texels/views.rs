//! What the images of a capture show of the template's texels.

use ghand_capture::{Capture, Split, SplitView};
use ghand_core::mesh::Texture;
use ghand_core::posing::pose_hand;
use ghand_core::skinning::{ResidualWeights, Skinning, skin};
use ghand_core::{HandModel, InvalidHandModel, Pose};
use ghand_hand_model::SurfaceSamples;
use ghand_render::Gpu;
use glam::DVec3;
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::TexelError;
use super::mesh_painter::MeshPainter;

/// A texel counts as hidden if the rendered surface is more than this in front of it, metres.
const DEPTH_TOLERANCE: f64 = 0.002;
/// Least cosine of the angle at which a texel shows its colour.
pub const COLOR_COSINE: f64 = 0.3;

/// A texel in an image that shows it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TexelView {
    /// Its colour there, display values 0..1.
    pub color: [f64; 3],
    /// Cosine of the angle at which it is seen.
    pub weight: f64,
    /// Length of its edge if it faced the camera, pixels.
    pub edge: f64,
}

/// Finds a template's texels in the images of a capture.
pub struct TexelObserver<'a> {
    capture: &'a Capture,
    samples: SurfaceSamples,
    painter: MeshPainter<'a>,
    plain: Texture,
}

impl<'a> TexelObserver<'a> {
    /// Of some texels of the template.
    ///
    /// # Errors
    /// [`TexelError`] if an image or the model is unusable, or the device failed.
    pub fn new(gpu: &Gpu, capture: &'a Capture, samples: SurfaceSamples) -> Result<TexelObserver<'a>, TexelError> {
        Ok(TexelObserver {
            capture,
            samples,
            painter: MeshPainter::new(gpu, &capture.template)?,
            plain: Texture::plain([255; 3]),
        })
    }

    /// The texels.
    pub fn samples(&self) -> &SurfaceSamples {
        &self.samples
    }

    /// Each texel in a view's image, with the template in a pose; `None` where the image does not show it, or at a more
    /// grazing angle than this cosine.
    ///
    /// # Errors
    /// [`TexelError`] if an image or the model is unusable, or the device failed.
    pub fn observe(
        &self,
        view: &SplitView,
        pose: &Pose,
        least_cosine: f64,
    ) -> Result<Vec<Option<TexelView>>, TexelError> {
        let model = &self.capture.template;
        let samples = &self.samples;
        let camera = &self.capture.cameras[view.camera];
        let image = self.capture.load_view(view.camera, view.frame)?;
        let depth = self.painter.paint(pose, camera, &self.plain, 1)?.depth;
        let points = pose_samples(model, samples, pose, 0.0)?;
        // The posed normal comes from posing a second point, a small distance along the rest normal.
        let tips = pose_samples(model, samples, pose, 1e-4)?;
        let focal = (camera.focal.x * camera.focal.y).sqrt();
        let texel = |((point, tip), spacing): ((&DVec3, &DVec3), &f64)| {
            let (at, z) = camera.project(*point);
            let (x, y) = (at.x.floor(), at.y.floor());
            if z <= 0.0 || x < 0.0 || y < 0.0 || x >= f64::from(camera.width) || y >= f64::from(camera.height) {
                return None;
            }
            let pixel = y as usize * camera.width as usize + x as usize;
            let cosine = (*tip - *point).normalize_or_zero().dot((camera.center() - *point).normalize());
            let [r, g, b, mask] = image.rgba[pixel];
            if mask < 128 || cosine < least_cosine || z > f64::from(depth[pixel]) + DEPTH_TOLERANCE {
                return None;
            }
            let color = [r, g, b].map(|v| f64::from(v) / 255.0);
            Some(TexelView { color, weight: cosine, edge: focal * spacing / z })
        };
        Ok(points.par_iter().zip(&tips).zip(&samples.spacings).map(texel).collect())
    }
}

/// At most `count` of a split's views, chosen at random with a fixed seed, so that they spread over all cameras and frames.
pub fn some_views(split: &Split, count: usize) -> Vec<SplitView> {
    let mut views = split.views.clone();
    views.shuffle(&mut ChaCha8Rng::seed_from_u64(0));
    views.truncate(count);
    views
}

/// Surface samples in a pose: offset by `distance` metres along their normals, moved by the pose correctives of their
/// triangles, then skinned with their own weights.
fn pose_samples(
    model: &HandModel,
    samples: &SurfaceSamples,
    pose: &Pose,
    distance: f64,
) -> Result<Vec<DVec3>, InvalidHandModel> {
    let posed = pose_hand(model, &[], pose)?;
    let moved = |vertex: u32| posed.corrected[vertex as usize] - posed.shaped.vertices[vertex as usize];
    let rest: Vec<DVec3> = (0..samples.len())
        .map(|i| {
            let corners = model.faces[samples.faces[i] as usize].iter().zip(samples.barycentric[i]);
            let corrective: DVec3 = corners.map(|(vertex, weight)| moved(*vertex) * weight).sum();
            samples.positions[i] + samples.normals[i] * distance + corrective
        })
        .collect();
    Ok(skin(&Skinning {
        rest: &rest,
        weights: &samples.weights,
        residual_weights: &[],
        bones: &posed.chain.posed_from_rest,
        residual_bones: &[],
        translation: pose.translation,
        mode: ResidualWeights::Paper,
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sample_has_images_of_all_cameras() {
        let split = Split::product((0..8).collect(), (0..60).collect());
        let views = some_views(&split, 60);
        assert_eq!(views.len(), 60);
        assert!((0..8).all(|camera| views.iter().any(|view| view.camera == camera)));
        assert_eq!(some_views(&split, 1000).len(), 480);
    }
}

//! The floor: the baseline that an avatar must beat. It is the template mesh, posed by its hand model, with mean texel
//! colours.

use ghand_capture::{Capture, CaptureError, Split, SplitView};
use ghand_core::mesh::{RenderMesh, Texture};
use ghand_core::posing::pose_hand;
use ghand_core::skinning::{ResidualWeights, Skinning, skin};
use ghand_core::{Camera, HandModel, InvalidHandModel, Pose};
use ghand_hand_model::{HandModelError, SurfaceSamples, surface};
use ghand_render::Gpu;
use ghand_render::mesh::{MeshError, MeshImage, MeshInstance, MeshRenderer, MeshStyle, Shading, Surface};
use glam::DVec3;
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

/// Why the floor could not be made.
#[derive(Debug, thiserror::Error)]
pub enum FloorError {
    /// The hand model is unusable.
    #[error(transparent)]
    HandModel(#[from] HandModelError),
    /// An image is unusable.
    #[error(transparent)]
    Capture(#[from] CaptureError),
    /// A pose does not fit the hand model.
    #[error(transparent)]
    Pose(#[from] InvalidHandModel),
    /// The mesh could not be drawn.
    #[error(transparent)]
    Mesh(#[from] MeshError),
}

/// Resolution of the floor's texture: far finer than the blur from averaging over frames.
pub const FLOOR_RESOLUTION: u32 = 256;

/// A hand model's vertices and vertex normals in a pose.
fn pose_mesh(model: &HandModel, pose: &Pose) -> Result<(Vec<DVec3>, Vec<DVec3>), InvalidHandModel> {
    let positions = pose_hand(model, &[], pose)?.vertices;
    let normals = model.vertex_normals(&positions);
    Ok((positions, normals))
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

/// Draws a posed template with a texture.
struct MeshPainter<'a> {
    renderer: MeshRenderer,
    model: &'a HandModel,
    mesh: RenderMesh,
}

impl<'a> MeshPainter<'a> {
    fn new(gpu: &Gpu, model: &'a HandModel) -> Result<MeshPainter<'a>, MeshError> {
        Ok(MeshPainter { renderer: MeshRenderer::new(gpu)?, model, mesh: RenderMesh::from_model(model) })
    }

    fn paint(
        &self,
        pose: &Pose,
        camera: &Camera,
        texture: &Texture,
        supersample: u32,
    ) -> Result<MeshImage, FloorError> {
        let (positions, normals) = pose_mesh(self.model, pose)?;
        let instance = MeshInstance {
            positions: &self.mesh.gather(&positions),
            normals: &self.mesh.gather(&normals),
            light_visibility: None,
            triangles: &self.mesh.triangles,
            surface: Surface::Texture { uvs: &self.mesh.uvs, texture },
        };
        let style = MeshStyle { supersample, shading: Shading::Unlit, wireframe: None };
        Ok(self.renderer.render(&instance, camera, &style)?)
    }
}

/// Mean colours of a surface's texels, display values 0..1.
#[derive(Debug, Clone)]
pub struct TexelColors {
    /// One colour per sampled texel; texels that no view sees get the mean of the visible ones.
    pub colors: Vec<[f64; 3]>,
    /// Index of each texel in its raster.
    pub texels: Vec<u32>,
    /// Width and height of the raster, texels.
    pub resolution: u32,
}

/// A texel counts as hidden if the rendered surface is more than this in front of it, metres.
const DEPTH_TOLERANCE: f64 = 0.002;
/// Texels seen at a more grazing angle than this cosine are skipped.
const MIN_COSINE: f64 = 0.3;

/// Mean colours over at most `view_count` of a split's views, chosen at random with a fixed seed. `poses` holds the
/// poses of the split's frames.
///
/// # Errors
/// [`FloorError`] if an image or the model is unusable.
pub fn texel_colors(
    gpu: &Gpu,
    capture: &Capture,
    split: &Split,
    poses: &[Pose],
    resolution: u32,
    view_count: usize,
) -> Result<TexelColors, FloorError> {
    let model = &capture.template;
    let samples = surface::sample_surface(model, resolution)?;
    let painter = MeshPainter::new(gpu, model)?;
    let plain = Texture::plain([255; 3]);
    let mut views = split.views.clone();
    // Shuffled, so that the chosen views spread over all cameras and frames.
    views.shuffle(&mut ChaCha8Rng::seed_from_u64(0));
    views.truncate(view_count);
    let mut sums = vec![[0.0f64; 4]; samples.len()];
    for SplitView { position, frame, camera: camera_index } in views {
        let camera = &capture.cameras[camera_index];
        let view = capture.load_view(camera_index, frame)?;
        let depth = painter.paint(&poses[position], camera, &plain, 1)?.depth;
        let points = pose_samples(model, &samples, &poses[position], 0.0)?;
        // The posed normal comes from posing a second point, a small distance along the rest normal.
        let tips = pose_samples(model, &samples, &poses[position], 1e-4)?;
        sums.par_iter_mut().enumerate().for_each(|(t, sum)| {
            let (at, z) = camera.project(points[t]);
            let (x, y) = (at.x.floor(), at.y.floor());
            if z <= 0.0 || x < 0.0 || y < 0.0 || x >= f64::from(camera.width) || y >= f64::from(camera.height) {
                return;
            }
            let pixel = y as usize * camera.width as usize + x as usize;
            let cosine = (tips[t] - points[t]).normalize_or_zero().dot((camera.center() - points[t]).normalize());
            let [r, g, b, mask] = view.rgba[pixel];
            if mask < 128 || cosine < MIN_COSINE || z > f64::from(depth[pixel]) + DEPTH_TOLERANCE {
                return;
            }
            for (s, v) in sum.iter_mut().zip([r, g, b]) {
                *s += cosine * f64::from(v) / 255.0;
            }
            sum[3] += cosine;
        });
    }
    let seen: Vec<[f64; 3]> =
        sums.iter().filter(|s| s[3] > 0.0).map(|s| [s[0] / s[3], s[1] / s[3], s[2] / s[3]]).collect();
    let mean = [0, 1, 2].map(|c| seen.iter().map(|s| s[c]).sum::<f64>() / seen.len().max(1) as f64);
    let colors = sums.iter().map(|s| if s[3] > 0.0 { [s[0] / s[3], s[1] / s[3], s[2] / s[3]] } else { mean }).collect();
    Ok(TexelColors { colors, texels: samples.texels, resolution })
}

impl TexelColors {
    /// The colours as a texture. Texels next to the charts get a neighbour's colour, so that filtering does not darken
    /// the charts' edges.
    pub fn texture(&self) -> Texture {
        let n = self.resolution as usize;
        let mut grid: Vec<Option<[f64; 3]>> = vec![None; n * n];
        for (texel, color) in self.texels.iter().zip(&self.colors) {
            grid[*texel as usize] = Some(*color);
        }
        for _ in 0..4 {
            let previous = grid.clone();
            for y in 0..n {
                for x in 0..n {
                    if previous[y * n + x].is_none() {
                        let around = [(0, 1), (2, 1), (1, 0), (1, 2)];
                        let at = |(dx, dy): (usize, usize)| {
                            let (cx, cy) = ((x + dx).checked_sub(1)?, (y + dy).checked_sub(1)?);
                            if cx < n && cy < n { previous[cy * n + cx] } else { None }
                        };
                        grid[y * n + x] = around.into_iter().find_map(at);
                    }
                }
            }
        }
        let byte = |v: f64| (v * 255.0).round().clamp(0.0, 255.0) as u8;
        let rgb = grid.iter().map(|c| c.map_or([0; 3], |c| c.map(byte))).collect();
        Texture { width: self.resolution, height: self.resolution, rgb }
    }
}

/// The floor: a mesh with a texture, and the renderer that draws it.
pub struct Floor<'a> {
    painter: MeshPainter<'a>,
    texture: Texture,
}

impl<'a> Floor<'a> {
    /// The floor of a capture. Its colours are means over `view_count` views of a split in the given poses.
    ///
    /// # Errors
    /// [`FloorError`] if an image or the model is unusable.
    pub fn new(
        gpu: &Gpu,
        capture: &'a Capture,
        split: &Split,
        poses: &[Pose],
        view_count: usize,
    ) -> Result<Floor<'a>, FloorError> {
        let colors = texel_colors(gpu, capture, split, poses, FLOOR_RESOLUTION, view_count)?;
        Ok(Floor { painter: MeshPainter::new(gpu, &capture.template)?, texture: colors.texture() })
    }

    /// Renders the floor over a background; pixels are row-major.
    ///
    /// # Errors
    /// [`FloorError`] if it cannot be drawn, or the pose does not fit the hand model.
    pub fn render(&self, pose: &Pose, camera: &Camera, background: [f64; 3]) -> Result<Vec<[f32; 3]>, FloorError> {
        let image = self.painter.paint(pose, camera, &self.texture, 3)?;
        let over = |p: &[f32; 4]| [0, 1, 2].map(|c| p[c] + (1.0 - p[3]) * background[c] as f32);
        Ok(image.rgba.iter().map(over).collect())
    }
}

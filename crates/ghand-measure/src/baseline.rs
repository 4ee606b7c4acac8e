//! The baseline that an avatar must beat: the template mesh, posed by its hand model, with mean texel colours.

use ghand_capture::{Capture, Split};
use ghand_core::mesh::Texture;
use ghand_core::{Camera, Pose};
use ghand_fit::texels::TexelError;
use ghand_fit::texels::colors::texel_colors;
use ghand_fit::texels::mesh_painter::MeshPainter;
use ghand_hand_model::HandModelError;
use ghand_hand_model::surface::sample_surface;
use ghand_render::Gpu;
use ghand_render::mesh::MeshError;

/// Why the baseline could not be made or drawn.
#[derive(Debug, thiserror::Error)]
pub enum BaselineError {
    /// The hand model is unusable.
    #[error(transparent)]
    HandModel(#[from] HandModelError),
    /// The texture could not be made, or a pose does not fit the hand model.
    #[error(transparent)]
    Texels(#[from] TexelError),
    /// The mesh could not be drawn.
    #[error(transparent)]
    Mesh(#[from] MeshError),
}

/// Resolution of the texture: far finer than the blur from averaging over frames.
pub const RESOLUTION: u32 = 256;

/// The template mesh with a texture, and the renderer that draws it.
pub struct Baseline<'a> {
    painter: MeshPainter<'a>,
    texture: Texture,
}

impl<'a> Baseline<'a> {
    /// The baseline of a capture. Its colours are means over `view_count` views of a split in the given poses.
    ///
    /// # Errors
    /// [`BaselineError`] if an image or the model is unusable.
    pub fn new(
        gpu: &Gpu,
        capture: &'a Capture,
        split: &Split,
        poses: &[Pose],
        view_count: usize,
    ) -> Result<Baseline<'a>, BaselineError> {
        let samples = sample_surface(&capture.template, RESOLUTION)?;
        let colors = texel_colors(gpu, capture, split, poses, samples, view_count, None)?;
        Ok(Baseline { painter: MeshPainter::new(gpu, &capture.template)?, texture: colors.texture() })
    }

    /// Renders the baseline over a background; pixels are row-major.
    ///
    /// # Errors
    /// [`BaselineError`] if it cannot be drawn, or the pose does not fit the hand model.
    pub fn render(&self, pose: &Pose, camera: &Camera, background: [f64; 3]) -> Result<Vec<[f32; 3]>, BaselineError> {
        let image = self.painter.paint(pose, camera, &self.texture, 3)?;
        let over = |p: &[f32; 4]| [0, 1, 2].map(|c| p[c] + (1.0 - p[3]) * background[c] as f32);
        Ok(image.rgba.iter().map(over).collect())
    }
}

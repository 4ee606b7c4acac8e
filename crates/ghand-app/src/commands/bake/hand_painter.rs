//! Draws the Gaussians of a hand in given colours, in soft light.

use ghand_avatar::scene::OPACITY;
use ghand_core::{Camera, HandModel, Pose};
use ghand_render::splat::{Image, Purpose, Shape, SplatModel, SplatOptions, Splatter, View};
use ghand_render::{Gpu, RenderError};
use glam::DVec3;
use image::imageops::{FilterType, resize};
use image::{Rgb, RgbImage};

use ghand_avatar::framing::turntable;

/// Samples per pixel along each axis.
const SUPERSAMPLE: u32 = 2;
/// Standard deviation of a Gaussian in multiples of its spacing: neighbours close the surface.
const SCALE: f32 = 0.75;
/// A hand without numbers, display values.
pub const PALE: DVec3 = DVec3::new(0.80, 0.81, 0.84);

/// The Gaussians of one picture, N each.
#[derive(Clone, Copy)]
pub struct Dots<'a> {
    /// Positions, metres.
    pub positions: &'a [DVec3],
    /// Unit normals.
    pub normals: &'a [DVec3],
    /// Display values.
    pub colors: &'a [DVec3],
    /// Light that comes from everywhere, 0 to 1: 0.6 keeps colours legible, 0.35 shows the shape.
    pub ambient: f64,
}

/// Draws hands of one template.
pub struct HandPainter<'a> {
    gpu: &'a Gpu,
    splatter: Splatter,
    scales: Vec<f32>,
}

const MODEL: SplatModel = SplatModel { shape: Shape::Flat, ..SplatModel::HAND };

impl<'a> HandPainter<'a> {
    /// For Gaussians of these spacings (metres), and pictures of at most `size` pixels.
    ///
    /// # Errors
    /// [`RenderError`] if the device has too little memory or was lost.
    pub fn new(gpu: &'a Gpu, spacings: &[f32], size: [u32; 2]) -> Result<HandPainter<'a>, RenderError> {
        let options = SplatOptions { model: MODEL, purpose: Purpose::Images, ..SplatOptions::default() };
        let splatter = Splatter::new(gpu, options, spacings.len(), size.map(|edge| edge * SUPERSAMPLE))?;
        Ok(HandPainter { gpu, splatter, scales: spacings.iter().map(|spacing| SCALE * spacing).collect() })
    }

    /// Draws them on white.
    ///
    /// # Errors
    /// [`RenderError`] if the device failed or was lost.
    pub fn draw(&mut self, dots: &Dots, camera: &Camera) -> Result<RgbImage, RenderError> {
        // As `Shading::soft`: above the photographer's left shoulder.
        let light = (camera.rotation.transpose() * DVec3::new(-0.5, -0.7, -1.0)).normalize_or_zero();
        let ahead = camera.rotation.transpose() * DVec3::Z;
        let lit = |(color, normal): (&DVec3, &DVec3)| {
            // Only a surface that is turned inside out is seen from behind: it has light on both sides.
            let normal = if normal.dot(ahead) > 0.3 { -*normal } else { *normal };
            let wrapped = ((normal.dot(light) + 0.3) / 1.3).max(0.0);
            (*color * (dots.ambient + (1.1 - dots.ambient) * wrapped)).clamp(DVec3::ZERO, DVec3::ONE)
        };
        let colors: Vec<DVec3> = dots.colors.iter().zip(dots.normals).map(lit).collect();
        let mut table: Vec<f32> = vec![];
        let mut add = |vectors: &[DVec3]| (0..3).for_each(|c| table.extend(vectors.iter().map(|v| v[c] as f32)));
        add(dots.positions);
        // One row of sizes comes between positions and normals.
        add(dots.normals);
        add(&colors);
        let size_row = SplatModel::SCALE_ROW * self.scales.len();
        table.splice(size_row..size_row, self.scales.iter().copied());
        self.gpu.queue.write_buffer(self.splatter.gaussians(), 0, bytemuck::cast_slice(&table));
        let large = camera.resized(camera.width * SUPERSAMPLE, camera.height * SUPERSAMPLE);
        self.splatter.set_view(self.gpu, View::new(&large, self.scales.len(), [1.0; 3], OPACITY))?;
        self.splatter.run_frame(self.gpu, |splatter, encoder| {
            splatter.forward(encoder);
            Ok(())
        })?;
        let picture = to_rgb(&self.splatter.read_image(self.gpu)?);
        Ok(resize(&picture, camera.width, camera.height, FilterType::Triangle))
    }
}

/// A render as 8-bit display values.
pub fn to_rgb(image: &Image) -> RgbImage {
    RgbImage::from_fn(image.width, image.height, |x, y| {
        let pixel = image.rgba.get((y * image.width + x) as usize).copied().unwrap_or_default();
        Rgb([0, 1, 2].map(|c| (pixel[c].clamp(0.0, 1.0) * 255.0).round() as u8))
    })
}

/// Cameras in front of the palm and of the back of a posed hand, fingers up.
pub fn palm_and_back(model: &HandModel, pose: &Pose, size: [u32; 2]) -> [Camera; 2] {
    [around(model, pose, 1, 2, size), around(model, pose, 0, 2, size)]
}

/// View number `view` of `count` around a posed hand, starting at its back.
pub fn around(model: &HandModel, pose: &Pose, view: usize, count: usize, [width, height]: [u32; 2]) -> Camera {
    let ring = turntable(model, &[pose], count, [width, height]).into_iter().flatten().nth(view);
    // There is one for each pose and view.
    ring.unwrap_or_else(|| Camera::look_at(DVec3::Z, DVec3::ZERO, DVec3::Y, 1.0, width, height))
}

//! The posed template over an image: where template and mask overlap, and where there is only one of them.

use ghand_core::{Camera, HandModel};
use ghand_render::mesh::{MeshError, MeshImage, MeshInstance, MeshRenderer, MeshStyle, Shading, Surface};
use glam::{DVec2, DVec3, Vec3};
use image::imageops::{FilterType, resize};
use image::{GrayImage, Rgb, RgbImage};

/// Colour of the template on the mask, and of the template beyond it.
pub const ON_MASK: Rgb<u8> = Rgb([150, 240, 205]);
pub const OFF_MASK: Rgb<u8> = Rgb([255, 62, 48]);
/// Colour of the mask where the template misses it.
pub const MISSED: Rgb<u8> = Rgb([40, 120, 255]);

/// Fraction of the image's brightness that remains around and below the template.
const DARKENED: f32 = 0.65;
/// Opacity of the colours above: where both are, where only the template is, and where only the mask is.
const STRENGTH: [f32; 3] = [0.45, 0.85, 0.65];
/// Samples per pixel along each axis.
const SUPERSAMPLE: u32 = 4;
/// Light from all directions: just enough shade to distinguish the fingers without hiding the image.
const AMBIENT: f64 = 0.35;

/// An image at the size of its cell.
pub struct Cell {
    /// The camera of the scaled image.
    camera: Camera,
    /// The image.
    pub image: RgbImage,
    /// Mask coverage of each pixel, 255 for full.
    mask: GrayImage,
}

impl Cell {
    /// Scales a window (x, y, width, height) of an image (`rgba`, mask in place of alpha) of the camera's size to
    /// `size`.
    pub fn new(camera: &Camera, rgba: &[[u8; 4]], [left, top, width, height]: [u32; 4], size: [u32; 2]) -> Cell {
        let at = |x: u32, y: u32| {
            let index = (top + y) as usize * camera.width as usize + (left + x) as usize;
            rgba.get(index).copied().unwrap_or_default()
        };
        let image = RgbImage::from_fn(width, height, |x, y| {
            let [r, g, b, _] = at(x, y);
            Rgb([r, g, b])
        });
        let mask = GrayImage::from_fn(width, height, |x, y| image::Luma([at(x, y)[3]]));
        let scale = DVec2::new(f64::from(size[0]) / f64::from(width), f64::from(size[1]) / f64::from(height));
        let cut = camera.cropped(left as i32, top as i32, size[0], size[1]);
        Cell {
            camera: Camera { focal: cut.focal * scale, principal: cut.principal * scale, ..cut },
            image: resize(&image, size[0], size[1], FilterType::CatmullRom),
            mask: resize(&mask, size[0], size[1], FilterType::Triangle),
        }
    }

    /// The darkened image under a hand model's mesh with its vertices at `positions` (world, metres).
    ///
    /// # Errors
    /// [`MeshError`] if the mesh cannot be drawn.
    pub fn with_template(
        &self,
        renderer: &MeshRenderer,
        model: &HandModel,
        positions: &[DVec3],
    ) -> Result<RgbImage, MeshError> {
        let mesh = MeshInstance {
            positions,
            normals: &model.vertex_normals(positions),
            light_visibility: None,
            triangles: &model.faces,
            surface: Surface::Color(DVec3::ONE),
        };
        let shading = Shading::soft(&self.camera, AMBIENT);
        let style = MeshStyle { supersample: SUPERSAMPLE, shading, wireframe: None };
        Ok(self.blended(&renderer.render(&mesh, &self.camera, &style)?))
    }

    fn blended(&self, template: &MeshImage) -> RgbImage {
        let mut picture = self.image.clone();
        for ((pixel, mask), [light, _, _, on]) in picture.pixels_mut().zip(self.mask.pixels()).zip(&template.rgba) {
            let mask = f32::from(mask.0[0]) / 255.0;
            *pixel = blend(*pixel, mask, *on, if *on > 0.0 { light / on } else { 0.0 });
        }
        picture
    }
}

/// A pixel whose fractions `mask` and `template` are covered by mask and template, the latter with brightness `light`;
/// all in `[0, 1]`.
fn blend(pixel: Rgb<u8>, mask: f32, template: f32, light: f32) -> Rgb<u8> {
    let color = |c: Rgb<u8>| Vec3::from(c.0.map(f32::from));
    let dark = color(pixel) * DARKENED;
    let [both, alone, missed] = STRENGTH;
    let over = |paint: Vec3, strength: f32| dark * (1.0 - strength) + paint * strength;
    let mixed = over(color(ON_MASK) * light, both) * (template * mask)
        + over(color(OFF_MASK) * light, alone) * (template * (1.0 - mask))
        + over(color(MISSED), missed) * ((1.0 - template) * mask)
        + dark * ((1.0 - template) * (1.0 - mask));
    Rgb(mixed.to_array().map(|v| v.round().clamp(0.0, 255.0) as u8))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn areas_covered_by_one_of_both_have_its_colour_and_the_rest_is_darkened() {
        let grey = Rgb([100; 3]);
        let [r, _, b] = blend(grey, 0.0, 1.0, 1.0).0;
        assert!(r > b + 100, "only template is red");
        let [r, _, b] = blend(grey, 1.0, 0.0, 1.0).0;
        assert!(b > r + 100, "only mask is blue");
        let both = blend(grey, 1.0, 1.0, 1.0).0;
        assert!(both.iter().all(|v| *v > 100) && both[1] > both[0].max(both[2]), "both are green: {both:?}");
        assert!(blend(grey, 1.0, 1.0, 0.3).0 < both, "shade is seen");
        assert_eq!(blend(grey, 0.0, 0.0, 1.0), Rgb([65; 3]));
    }

    #[test]
    fn a_scaled_image_and_its_camera_show_a_point_at_the_same_place() {
        let camera = Camera::look_at(DVec3::NEG_Z, DVec3::ZERO, DVec3::NEG_Y, 0.5, 301, 200);
        // A white block around the pixel corner where a point is seen.
        let point = ((DVec2::new(190.0, 80.0) - camera.principal) / camera.focal).extend(0.0);
        let (pixel, _) = camera.project(point);
        let near = |i: usize| {
            let at = DVec2::new((i % 301) as f64 + 0.5, (i / 301) as f64 + 0.5);
            (at - pixel).abs().max_element() <= 8.0
        };
        let rgba: Vec<[u8; 4]> = (0..301 * 200).map(|i| if near(i) { [255; 4] } else { [0; 4] }).collect();
        for window in [[0, 0, 301, 200], [120, 40, 150, 101]] {
            let cell = Cell::new(&camera, &rgba, window, [99, 61]);
            let mut sum = DVec2::ZERO;
            let mut total = 0.0;
            for (x, y, value) in cell.mask.enumerate_pixels() {
                let weight = f64::from(value.0[0]);
                sum += DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5) * weight;
                total += weight;
            }
            let expected = cell.camera.project(point).0;
            assert!((sum / total - expected).length() < 0.02, "{} against {expected}", sum / total);
            assert_eq!(cell.image.dimensions(), (99, 61));
        }
    }
}

//! The image of a mesh, and its composition with an image of splats.

use super::MeshError;
use crate::splat::Image;

/// A rendered mesh.
#[derive(Debug, Clone, PartialEq)]
pub struct MeshImage {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Row-major pixels, premultiplied: (colour x coverage, coverage), each in `[0, 1]`.
    pub rgba: Vec<[f32; 4]>,
    /// Smallest camera z of the visible faces and lines in each pixel, metres; infinity in empty pixels. A line has the
    /// depth of its centre line.
    pub depth: Vec<f32>,
}

/// An image of splats from the splatter.
#[derive(Debug, Clone, Copy)]
pub struct SplatLayer<'a> {
    /// Colour over the background, and coverage.
    pub image: &'a Image,
    /// Expected camera z of each pixel, metres; 0 in empty pixels.
    pub depths: &'a [f32],
    /// The background of the image.
    pub background: [f32; 3],
}

impl MeshImage {
    /// Straight-alpha 8-bit pixels: colour of the covered part (black without coverage) and coverage.
    pub fn to_straight_rgba8(&self) -> Vec<[u8; 4]> {
        let to_byte = |v: f32| (v * 255.0).round().clamp(0.0, 255.0) as u8;
        self.rgba
            .iter()
            .map(|&[r, g, b, a]| {
                let gain = if a > 0.0 { 1.0 / a } else { 0.0 };
                [to_byte(r * gain), to_byte(g * gain), to_byte(b * gain), to_byte(a)]
            })
            .collect()
    }

    /// Composites the mesh with splats seen by the same camera: in each pixel the nearer of the two is in front.
    /// Returns colour over the splats' background, and coverage, in the splats' format.
    ///
    /// The mesh counts as nearer by `bias` metres; a few millimetres keep the lines of an avatar's own template
    /// visible. Expected depth is a mean, so inside a translucent splat the order is decided for the whole pixel.
    ///
    /// # Errors
    /// [`MeshError::Invalid`] if the sizes differ or the bias is not finite.
    pub fn composite_with_splats(&self, splats: &SplatLayer, bias: f32) -> Result<Image, MeshError> {
        let SplatLayer { image, depths, background } = splats;
        let (width, height) = (self.width, self.height);
        let pixels = self.rgba.len();
        let counts = [image.rgba.len(), depths.len(), self.depth.len()];
        if (image.width, image.height) != (width, height) || counts != [pixels; 3] {
            let found = format!("{} x {} with {} depths", image.width, image.height, depths.len());
            return MeshError::invalid("splats", format!("{found} do not match the mesh's {width} x {height} pixels"));
        }
        if !bias.is_finite() {
            return MeshError::invalid("bias", format!("{bias} is not finite; give metres"));
        }
        let pixel = |i: usize| {
            let mesh = self.rgba[i];
            let splat = image.rgba[i];
            let [mesh_coverage, splat_coverage] = [mesh[3], splat[3]];
            let mut out = [0.0; 4];
            let mesh_is_nearer = depths[i] == 0.0 || self.depth[i] <= depths[i] + bias;
            for c in 0..3 {
                out[c] = if mesh_is_nearer {
                    mesh[c] + (1.0 - mesh_coverage) * splat[c]
                } else {
                    // The mesh hides its part of the background that shows through the splats.
                    splat[c] + (1.0 - splat_coverage) * (mesh[c] - mesh_coverage * background[c])
                };
            }
            out[3] = mesh_coverage + splat_coverage - mesh_coverage * splat_coverage;
            out
        };
        Ok(Image { width, height, rgba: (0..pixels).map(pixel).collect() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BACKGROUND: [f32; 3] = [0.1, 0.2, 0.3];

    /// One pixel of a mesh, colour x coverage and coverage, at a depth.
    fn mesh(rgba: [f32; 4], z: f32) -> MeshImage {
        MeshImage { width: 1, height: 1, rgba: vec![rgba], depth: vec![z] }
    }

    /// Composites the mesh with one pixel of splats of this colour, coverage and depth.
    fn together(mesh: &MeshImage, color: [f32; 3], coverage: f32, depth: f32, bias: f32) -> [f32; 4] {
        let over = |c: usize| coverage * color[c] + (1.0 - coverage) * BACKGROUND[c];
        let image = Image { width: 1, height: 1, rgba: vec![[over(0), over(1), over(2), coverage]] };
        let layer = SplatLayer { image: &image, depths: &[depth], background: BACKGROUND };
        mesh.composite_with_splats(&layer, bias).unwrap().rgba[0]
    }

    /// A front layer over a back layer over the background: straight colours and coverages.
    fn expected(front: ([f32; 3], f32), back: ([f32; 3], f32)) -> [f32; 4] {
        let blend = |c: usize| {
            let behind = back.1 * back.0[c] + (1.0 - back.1) * BACKGROUND[c];
            front.1 * front.0[c] + (1.0 - front.1) * behind
        };
        [blend(0), blend(1), blend(2), 1.0 - (1.0 - front.1) * (1.0 - back.1)]
    }

    fn near(a: [f32; 4], b: [f32; 4]) -> bool {
        a.iter().zip(b).all(|(a, b)| (a - b).abs() <= 1e-6)
    }

    const RED: [f32; 3] = [0.8, 0.1, 0.2];
    const BLUE: [f32; 3] = [0.0, 0.3, 0.9];

    #[test]
    fn the_nearer_of_mesh_and_splats_is_in_front() {
        for (mesh_coverage, splat_coverage) in [(1.0, 1.0), (0.3, 0.6), (1.0, 0.4), (0.5, 1.0), (0.25, 0.01)] {
            let [r, g, b] = RED.map(|v| v * mesh_coverage);
            let red = mesh([r, g, b, mesh_coverage], 0.5);
            let (front, back) = ((RED, mesh_coverage), (BLUE, splat_coverage));
            let at = |depth, bias| together(&red, BLUE, splat_coverage, depth, bias);
            assert!(near(at(0.6, 0.0), expected(front, back)), "the mesh is in front");
            assert!(near(at(0.4, 0.0), expected(back, front)), "the splats are in front");
            assert!(!near(at(0.4, 0.0), expected(front, back)), "the comparison detects the wrong order");
            assert!(near(at(0.5, 0.0), expected(front, back)), "at the same depth the mesh is in front");
            assert!(near(at(0.499, 0.002), expected(front, back)), "within the bias the mesh is in front");
            assert!(near(at(0.499, -0.002), expected(back, front)));
            assert!(near(at(0.51, -0.02), expected(back, front)));
        }
    }

    #[test]
    fn where_one_is_empty_the_other_is_unchanged() {
        let nothing = mesh([0.0; 4], f32::INFINITY);
        assert!(near(together(&nothing, BLUE, 0.7, 0.5, 0.01), expected((BLUE, 0.7), (RED, 0.0))));
        assert!(near(together(&nothing, BLUE, 0.0, 0.0, 0.01), expected((BLUE, 0.0), (RED, 0.0))));
        let red = mesh([RED[0] * 0.5, RED[1] * 0.5, RED[2] * 0.5, 0.5], 0.5);
        assert!(near(together(&red, BLUE, 0.0, 0.0, 0.0), expected((RED, 0.5), (BLUE, 0.0))));
    }

    #[test]
    fn images_of_different_sizes_are_rejected() {
        let red = mesh([1.0; 4], 0.5);
        let image = |width, rgba| Image { width, height: 1, rgba };
        let fails = |image: &Image, depths: &[f32], bias| {
            let layer = SplatLayer { image, depths, background: BACKGROUND };
            red.composite_with_splats(&layer, bias).unwrap_err().to_string()
        };
        assert!(fails(&image(2, vec![[0.0; 4]; 2]), &[0.0; 2], 0.0).contains("splats: 2 x 1"));
        assert!(fails(&image(1, vec![[0.0; 4]]), &[], 0.0).contains("0 depths"));
        assert!(fails(&image(1, vec![]), &[0.0], 0.0).contains("splats"));
        assert!(fails(&image(1, vec![[0.0; 4]]), &[0.0], f32::NAN).contains("bias"));
    }
}

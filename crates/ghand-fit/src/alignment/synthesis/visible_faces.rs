//! Which face of a posed mesh each pixel of an image moves with.

use ghand_core::Camera;
use glam::DVec3;

use crate::alignment::triangles::cover_faces;

/// A surface is before another one if it is nearer by more than this, metres.
const BEFORE: f64 = 0.006;

/// By pixel, row-major, a face and its camera z (metres); an infinite z where there is none.
pub struct VisibleFaces {
    pub faces: Vec<u32>,
    pub depths: Vec<f64>,
}

impl VisibleFaces {
    /// Of a mesh at `positions` (metres, world axes). Pixels up to `reach` beside a nearer surface move with that one: what
    /// a blurred image shows there is its outline.
    pub fn new(camera: &Camera, positions: &[DVec3], faces: &[[u32; 3]], reach: usize) -> VisibleFaces {
        let size = [camera.width as usize, camera.height as usize];
        let count = size[0] * size[1];
        let mut nearest = VisibleFaces { faces: vec![0; count], depths: vec![f64::INFINITY; count] };
        cover_faces(camera, size, 1.0, positions, faces, |face, at, z| {
            if z < nearest.depths[at] {
                nearest.depths[at] = z;
                nearest.faces[at] = face as u32;
            }
        });
        nearest.spread(size, reach, 0).spread(size, reach, 1)
    }

    /// Spreads nearer surfaces along an axis.
    fn spread(&self, size: [usize; 2], reach: usize, axis: usize) -> VisibleFaces {
        let stride = if axis == 0 { 1 } else { size[0] };
        let source = |at: usize| {
            let place = if axis == 0 { at % size[0] } else { at / size[0] };
            let limit = self.depths[at] - BEFORE;
            for distance in 1..=reach {
                let before = (place >= distance).then(|| at - distance * stride);
                let behind = (place + distance < size[axis]).then(|| at + distance * stride);
                if let Some(found) = [before, behind].into_iter().flatten().find(|other| self.depths[*other] < limit) {
                    return found;
                }
            }
            at
        };
        let sources: Vec<usize> = (0..self.faces.len()).map(source).collect();
        VisibleFaces {
            faces: sources.iter().map(|at| self.faces[*at]).collect(),
            depths: sources.iter().map(|at| self.depths[*at]).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn outlines_belong_to_the_nearer_surface() {
        let camera = Camera::look_at(DVec3::new(0.0, 0.0, -0.5), DVec3::ZERO, DVec3::Y, 0.5, 80, 60);
        let square = |half: f64, z: f64| {
            [(-half, -half), (-half, half), (half, half), (half, -half)].map(|(x, y)| DVec3::new(x, y, z))
        };
        // A wall, and a small square before it.
        let positions: Vec<DVec3> = [square(0.08, 0.0), square(0.02, -0.05)].concat();
        let faces = [[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]];
        let plain = VisibleFaces::new(&camera, &positions, &faces, 0);
        let spread = VisibleFaces::new(&camera, &positions, &faces, 2);
        let near = |seen: &VisibleFaces| seen.depths.iter().filter(|z| **z < 0.46).count();
        let all = |seen: &VisibleFaces| seen.depths.iter().filter(|z| z.is_finite()).count();
        let side = (near(&plain) as f64).sqrt();
        assert!(side > 8.0);
        // Two pixels at each side, the corners too.
        assert!((near(&spread) as f64 - (side + 4.0).powi(2)).abs() < 3.0, "{} {}", near(&plain), near(&spread));
        assert!(all(&spread) > all(&plain));
        let center = 30 * 80 + 40;
        assert!(plain.faces[center] >= 2 && (plain.depths[center] - 0.45).abs() < 1e-9);
        let outside = spread.depths.iter().position(|z| z.is_infinite());
        assert_eq!(outside, Some(0), "far from all surfaces there is nothing");
    }
}

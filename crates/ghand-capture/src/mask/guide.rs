//! What the posed hand model says of an image: how far each pixel is from its outline, and where the arm begins.

use std::ops::Range;

use ghand_core::{Camera, HandModel};
use ghand_hand_model::surface::arm_end::{ArmEnd, ArmEndInImage};
use glam::{DVec2, DVec3};

use super::distance::squared_distances;
use super::fill::covered_pixels;

/// Distances from a posed model's outline in a part of an image around it.
pub(super) struct Guide {
    /// Columns and rows of the part.
    pub columns: Range<usize>,
    pub rows: Range<usize>,
    /// Row-major, pixels, negative inside.
    distances: Vec<f32>,
    /// Square root of the outline's area, pixels.
    pub size: f64,
    arm: Option<ArmEndInImage>,
}

impl Guide {
    /// The guide of a posed model (vertices in world axes, metres) with a margin relative to its size. `None` if it is not
    /// in the image.
    pub fn new(camera: &Camera, model: &HandModel, vertices: &[DVec3], margin: f64) -> Option<Guide> {
        let (width, height) = (camera.width as usize, camera.height as usize);
        let covered = covered_pixels(camera, vertices, &model.faces);
        let area = covered.iter().filter(|inside| **inside).count();
        let size = (area as f64).sqrt();
        let margin = (margin * size).ceil() as usize + 2;
        let mut low = [usize::MAX; 2];
        let mut high = [0; 2];
        for i in (0..covered.len()).filter(|&i| covered[i]) {
            let at = [i % width, i / width];
            low = [0, 1].map(|k| low[k].min(at[k]));
            high = [0, 1].map(|k| high[k].max(at[k]));
        }
        if area == 0 {
            return None;
        }
        let range = |k: usize, end: usize| low[k].saturating_sub(margin)..(high[k] + margin + 1).min(end);
        let (columns, rows) = (range(0, width), range(1, height));
        let inside = || rows.clone().flat_map(|y| columns.clone().map(move |x| y * width + x)).map(|i| covered[i]);
        let to = |wanted: bool| {
            let start = inside().map(|inside| if inside == wanted { 0.0 } else { f64::INFINITY }).collect();
            squared_distances(start, [columns.len(), rows.len()])
        };
        // Centres of pixels are half a pixel from the outline between them.
        let signed = |(to_inside, to_outside): (&f64, &f64)| {
            (if *to_outside > 0.0 { 0.5 - to_outside.sqrt() } else { to_inside.sqrt() - 0.5 }) as f32
        };
        let distances = to(true).iter().zip(&to(false)).map(signed).collect();
        let arm = ArmEnd::of(model).and_then(|end| end.seen(vertices, camera));
        Some(Guide { columns, rows, distances, size, arm })
    }

    /// Distance of a pixel of the image from the outline, relative to the hand's size; `None` beyond the margin.
    pub fn distance(&self, x: usize, y: usize) -> Option<f64> {
        if !self.columns.contains(&x) || !self.rows.contains(&y) {
            return None;
        }
        let at = (y - self.rows.start) * self.columns.len() + x - self.columns.start;
        self.distances.get(at).map(|d| f64::from(*d) / self.size)
    }

    /// Whether the arm may be at a pixel.
    pub fn may_be_arm(&self, x: usize, y: usize) -> bool {
        self.arm.is_some_and(|arm| arm.may_be_arm(center(x, y)))
    }

    /// Whether a pixel is farther along the arm than so many bands from where the band before the model's end starts.
    pub fn is_beyond(&self, x: usize, y: usize, bands: f64) -> bool {
        self.arm.is_some_and(|arm| arm.beyond(center(x, y)) > bands)
    }
}

fn center(x: usize, y: usize) -> DVec2 {
    DVec2::new(x as f64 + 0.5, y as f64 + 0.5)
}

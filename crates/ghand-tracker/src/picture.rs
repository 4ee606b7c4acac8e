//! A picture, and square pieces of it for the networks.

use glam::DVec2;
use rayon::prelude::*;

use crate::{Region, TrackerError};

/// What is outside of a picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Outside {
    /// Black.
    Black,
    /// The nearest pixel of the edge.
    Edge,
}

/// Bytes of a picture: red, green, blue, row by row.
#[derive(Clone, Copy)]
pub(crate) struct Picture<'a> {
    rgb: &'a [u8],
    width: usize,
    height: usize,
}

impl<'a> Picture<'a> {
    /// Checks the number of bytes.
    pub fn new(rgb: &'a [u8], width: u32, height: u32) -> Result<Self, TrackerError> {
        let expected = (u64::from(width) * u64::from(height)).saturating_mul(3);
        if expected == 0 || rgb.len() as u64 != expected {
            return Err(TrackerError::Picture { width, height, expected, got: rgb.len() });
        }
        Ok(Picture { rgb, width: width as usize, height: height as usize })
    }

    /// The smallest upright square around the picture.
    pub fn square(&self) -> Region {
        let size = DVec2::new(self.width as f64, self.height as f64);
        Region { center: size / 2.0, size: size.max_element(), turn: 0.0 }
    }

    /// The region as `edge` x `edge` pixels, by bilinear interpolation, from 0 to 1; row by row, three numbers a pixel.
    pub fn crop(&self, region: &Region, edge: usize, outside: Outside) -> Vec<f32> {
        let mut pixels = vec![0.0; edge * edge * 3];
        pixels.par_chunks_mut(edge * 3).enumerate().for_each(|(y, row)| {
            for (x, pixel) in row.as_chunks_mut::<3>().0.iter_mut().enumerate() {
                let place = DVec2::new(x as f64 + 0.5, y as f64 + 0.5) / edge as f64;
                *pixel = self.interpolate(region.to_picture(place), outside);
            }
        });
        pixels
    }

    fn interpolate(&self, place: DVec2, outside: Outside) -> [f32; 3] {
        // Relative to the middle of the first pixel.
        let place = place - 0.5;
        let first = place.floor();
        let [right, down] = (place - first).as_vec2().to_array();
        // A cast saturates, so that places far away stay outside.
        let [x, y] = first.to_array().map(|v| v as i64);
        let mut sum = [0.0; 3];
        for (dx, dy, weight) in [
            (0, 0, (1.0 - right) * (1.0 - down)),
            (1, 0, right * (1.0 - down)),
            (0, 1, (1.0 - right) * down),
            (1, 1, right * down),
        ] {
            if let Some(pixel) = self.pixel(x.saturating_add(dx), y.saturating_add(dy), outside) {
                for c in 0..3 {
                    sum[c] += weight * f32::from(pixel[c]);
                }
            }
        }
        sum.map(|sum| sum / 255.0)
    }

    fn pixel(&self, x: i64, y: i64, outside: Outside) -> Option<&[u8; 3]> {
        let [inside_x, inside_y] = [x.clamp(0, self.width as i64 - 1), y.clamp(0, self.height as i64 - 1)];
        if outside == Outside::Black && [x, y] != [inside_x, inside_y] {
            return None;
        }
        let index = (inside_y as usize * self.width + inside_x as usize) * 3;
        self.rgb.get(index..).and_then(|rest| rest.first_chunk())
    }
}

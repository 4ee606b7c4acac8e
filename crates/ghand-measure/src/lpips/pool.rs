//! Maxima over windows, and the gradient of what they are taken of. Maps are `[pixels][channels]`, row-major.

use super::alexnet::{POOL_KERNEL, POOL_STRIDE};

/// The maxima of a map.
#[derive(Debug)]
pub(super) struct Maxima {
    /// Width and height.
    pub size: [usize; 2],
    pub values: Vec<f32>,
    /// Where each value lies in the map.
    sources: Vec<u32>,
}

impl Maxima {
    /// Of a map of `size` (width, height) with at least one window.
    pub fn of([width, height]: [usize; 2], map: &[f32], channels: usize) -> Maxima {
        let size = [width, height].map(|side| side.saturating_sub(POOL_KERNEL) / POOL_STRIDE + 1);
        let mut values = Vec::with_capacity(size[0] * size[1] * channels);
        let mut sources = Vec::with_capacity(values.capacity());
        for (y, x) in (0..size[1]).flat_map(|y| (0..size[0]).map(move |x| (y, x))) {
            let first = (y * POOL_STRIDE * width + x * POOL_STRIDE) * channels;
            for source in first..first + channels {
                let mut most = source;
                for (i, j) in (0..POOL_KERNEL).flat_map(|i| (0..POOL_KERNEL).map(move |j| (i, j))) {
                    let other = source + (i * width + j) * channels;
                    if map[other] > map[most] {
                        most = other;
                    }
                }
                values.push(map[most]);
                sources.push(most as u32);
            }
        }
        Maxima { size, values, sources }
    }

    /// Adds the gradient of the maxima to that of the map.
    pub fn add_gradient(&self, gradient: &[f32], of_map: &mut [f32]) {
        self.sources.iter().zip(gradient).for_each(|(source, value)| of_map[*source as usize] += value);
    }
}

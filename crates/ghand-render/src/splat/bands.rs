//! Renders pictures that are too large for one frame in horizontal bands.
//!
//! A band starts at a row of tiles and keeps the projection of the whole picture, so that each tile has the same
//! Gaussians in the same order: the pixels equal those of a single frame, bit for bit.

use super::{Image, Splatter, TILE_SIZE, View};
use crate::{Gpu, RenderError};

/// Maximum size of a band's image, bytes, even if the device allows larger buffers: larger bands are not faster.
const LARGEST_BAND: u64 = 128 << 20;
/// Bytes per pixel of the image, the largest per-pixel buffer.
const BYTES_PER_PIXEL: u64 = 16;

/// Maximum number of rows per frame for a picture of this size on this device: all, or a multiple of [`TILE_SIZE`].
pub fn band_rows(gpu: &Gpu, [width, height]: [u32; 2]) -> u32 {
    let limits = gpu.device.limits();
    let bytes = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size).min(LARGEST_BAND);
    let rows = bytes / (BYTES_PER_PIXEL * u64::from(width.max(1)));
    if rows >= u64::from(height) { height } else { whole_tiles(rows as u32) }
}

/// The largest multiple of [`TILE_SIZE`] that is at most `rows`, but at least one row of tiles.
fn whole_tiles(rows: u32) -> u32 {
    (rows / TILE_SIZE).max(1) * TILE_SIZE
}

impl View {
    /// The view of `rows` rows of this view's image, from `first_row` on, which must be a multiple of [`TILE_SIZE`].
    pub fn band(&self, first_row: u32, rows: u32) -> View {
        View {
            size: [self.size[0], rows],
            tiles: [self.tiles[0], rows.div_ceil(TILE_SIZE)],
            first_row: self.first_row + first_row,
            ..*self
        }
    }
}

impl Splatter {
    /// Renders a view of any height in bands that fit the splatter, from top to bottom, and passes each to `sink` with
    /// its first row. If a band has too many intersections for the device, it is halved.
    ///
    /// # Errors
    /// [`RenderError`] if the device failed or was lost, if the view is wider than the splatter was made for, or if the
    /// device cannot render a single row of tiles.
    pub fn render_bands(
        &mut self,
        gpu: &Gpu,
        view: View,
        mut sink: impl FnMut(u32, &Image),
    ) -> Result<(), RenderError> {
        let [_, height] = view.size;
        let mut most = if self.max_size[1] >= height { height } else { whole_tiles(self.max_size[1]) };
        let mut first_row = 0;
        while first_row < height {
            let rows = most.min(height - first_row);
            self.set_view(gpu, view.band(first_row, rows))?;
            match self.render(gpu) {
                Ok(image) => {
                    sink(first_row, &image);
                    first_row += rows;
                }
                Err(RenderError::Invalid(_) | RenderError::OutOfMemory { .. }) if rows > TILE_SIZE => {
                    most = whole_tiles(rows / 2);
                }
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }
}

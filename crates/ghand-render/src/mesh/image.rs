//! The image of a mesh.

/// A rendered mesh.
#[derive(Debug, Clone, PartialEq)]
pub struct MeshImage {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Row-major pixels, premultiplied: (colour x coverage, coverage), each in `[0, 1]`.
    pub rgba: Vec<[f32; 4]>,
    /// Smallest camera z of the visible faces in each pixel, metres; infinity in pixels without a face.
    pub depth: Vec<f32>,
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
}

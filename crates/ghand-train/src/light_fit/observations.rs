//! What the frames of a capture show of the template's texels, in linear light.

use ghand_core::light::linear;
use ghand_hand_model::SurfaceSamples;
use nalgebra::DMatrix;

use super::least_squares::FrameColors;
use crate::texel_frames::TexelFrames;
use crate::texel_views::TexelView;

/// A texel takes part if this many frames show it.
const LEAST_FRAMES: usize = 4;

/// What frames show of the texels.
pub(super) struct Observations {
    pub samples: SurfaceSamples,
    /// Frames, counted in the split.
    pub frames: Vec<usize>,
    /// Mean linear colour of each texel in each frame, `None` where no view shows it or too few frames do.
    colors: Vec<Vec<Option<[f64; 3]>>>,
}

impl Observations {
    pub fn new(seen: &TexelFrames) -> Observations {
        let texels = seen.samples.len();
        let mut colors: Vec<Vec<Option<[f64; 3]>>> = Vec::new();
        for images in &seen.images {
            let mut sums = vec![[0.0; 4]; texels];
            for image in images {
                for (sum, seen) in sums.iter_mut().zip(&image.texels) {
                    let Some(TexelView { color, weight }) = seen else { continue };
                    for (s, value) in sum.iter_mut().zip(color) {
                        *s += weight * linear(*value);
                    }
                    sum[3] += weight;
                }
            }
            colors.push(sums.iter().map(|s| (s[3] > 0.0).then(|| [0, 1, 2].map(|c| s[c] / s[3]))).collect());
        }
        for texel in 0..texels {
            if colors.iter().filter(|frame| frame[texel].is_some()).count() < LEAST_FRAMES {
                colors.iter_mut().for_each(|frame| frame[texel] = None);
            }
        }
        Observations { samples: seen.samples.clone(), frames: seen.frames.clone(), colors }
    }

    /// Number of texels that take part.
    pub fn used(&self) -> usize {
        (0..self.samples.len()).filter(|t| self.colors.iter().any(|frame| frame[*t].is_some())).count()
    }

    /// A frame's colours with what each unknown of a light gives all texels.
    pub fn colors(&self, frame: usize, parts: DMatrix<f64>) -> FrameColors {
        let seen = self.colors[frame].iter().enumerate().filter_map(|(t, color)| color.map(|color| (t, color)));
        let (texels, colors): (Vec<usize>, Vec<[f64; 3]>) = seen.unzip();
        FrameColors { parts: parts.select_rows(&texels), texels, colors }
    }
}

//! What the frames of a capture show of the template's texels, in linear light.

use ghand_core::light::linear;
use ghand_hand_model::SurfaceSamples;

use super::gloss::ImageGloss;
use super::least_squares::{FrameColors, Parts};
use crate::texels::frames::TexelFrames;
use crate::texels::views::TexelView;

/// A texel takes part if this many frames show it.
const LEAST_FRAMES: usize = 4;

/// One texel of this many is enough for what concerns all of the hand.
const TEXEL_STRIDE: usize = 3;

/// What frames show of the texels.
pub(super) struct Observations {
    pub samples: SurfaceSamples,
    /// Frames, counted in the split.
    pub frames: Vec<usize>,
    /// Mean linear colour of each texel in each frame, `None` where no view shows it or too few frames do.
    colors: Vec<Vec<Option<[f64; 3]>>>,
}

impl Observations {
    /// What images show, less a gloss.
    pub fn new(seen: &TexelFrames, gloss: Option<&ImageGloss>) -> Observations {
        let texels = seen.samples.len();
        let mut colors: Vec<Vec<Option<[f64; 3]>>> = Vec::new();
        for (frame, images) in seen.images.iter().enumerate() {
            let mut sums = vec![[0.0; 4]; texels];
            for (i, image) in images.iter().enumerate() {
                for (t, (sum, seen)) in sums.iter_mut().zip(&image.texels).enumerate() {
                    let Some(TexelView { color, weight, .. }) = seen else { continue };
                    for (c, value) in color.iter().enumerate() {
                        let mirrored = gloss.map_or(0.0, |gloss| f64::from(gloss[frame][i][t][c]));
                        sum[c] += weight * (linear(*value) - mirrored).max(0.0);
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

    /// Some of the texels, all over the hand, in order.
    pub fn some_texels(&self) -> Vec<usize> {
        (0..self.samples.len()).step_by(TEXEL_STRIDE).collect()
    }

    /// The texels that a frame shows.
    pub fn shown(&self, frame: usize) -> impl Iterator<Item = usize> {
        self.colors[frame].iter().enumerate().filter_map(|(t, color)| color.map(|_| t))
    }

    /// Changes a frame's colours of other observations, which found the same texels, to these.
    pub fn recolor(&self, frame: usize, colors: &mut FrameColors) {
        for (t, color) in colors.texels.iter().zip(&mut colors.colors) {
            *color = self.colors[frame][*t].unwrap_or(*color);
        }
    }

    /// A frame's colours with what each unknown of a light gives all texels.
    pub fn colors(&self, frame: usize, parts: &Parts) -> FrameColors {
        let seen = self.colors[frame].iter().enumerate().filter_map(|(t, color)| color.map(|color| (t, color)));
        let (texels, colors): (Vec<usize>, Vec<[f64; 3]>) = seen.unzip();
        FrameColors { parts: parts.select(&texels), texels, colors }
    }
}

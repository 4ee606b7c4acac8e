//! What the frames of a capture show of the template's texels, in linear light.

use ghand_capture::{Capture, Split, SplitView};
use ghand_core::Pose;
use ghand_core::light::linear;
use ghand_hand_model::SurfaceSamples;
use ghand_render::Gpu;
use nalgebra::DMatrix;

use super::least_squares::FrameColors;
use crate::floor::FloorError;
use crate::texel_views::{TexelObserver, TexelView};

/// Resolution of the texels that the light is fitted to: some two thousand points.
const RESOLUTION: u32 = 72;
/// Most frames used, evenly spaced, and most views of each.
const MOST_FRAMES: usize = 60;
const VIEWS_PER_FRAME: usize = 5;
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
    pub fn new(gpu: &Gpu, capture: &Capture, split: &Split, poses: &[Pose]) -> Result<Observations, FloorError> {
        let observer = TexelObserver::new(gpu, capture, RESOLUTION)?;
        let mut frames: Vec<usize> = split.views.iter().map(|view| view.position).collect();
        frames.sort_unstable();
        frames.dedup();
        let frames = evenly(&frames, MOST_FRAMES);
        let mut colors: Vec<Vec<Option<[f64; 3]>>> = Vec::new();
        for frame in &frames {
            let views: Vec<&SplitView> = split.views.iter().filter(|view| view.position == *frame).collect();
            let mut sums = vec![[0.0; 4]; observer.samples().len()];
            for view in evenly(&views, VIEWS_PER_FRAME) {
                for (sum, seen) in sums.iter_mut().zip(observer.observe(view, &poses[*frame])?) {
                    let Some(TexelView { color, weight }) = seen else { continue };
                    for (s, value) in sum.iter_mut().zip(color) {
                        *s += weight * linear(value);
                    }
                    sum[3] += weight;
                }
            }
            colors.push(sums.iter().map(|s| (s[3] > 0.0).then(|| [0, 1, 2].map(|c| s[c] / s[3]))).collect());
        }
        for texel in 0..observer.samples().len() {
            if colors.iter().filter(|frame| frame[texel].is_some()).count() < LEAST_FRAMES {
                colors.iter_mut().for_each(|frame| frame[texel] = None);
            }
        }
        Ok(Observations { samples: observer.samples().clone(), frames, colors })
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

/// At most `most` of some items, evenly spaced.
fn evenly<T: Clone>(items: &[T], most: usize) -> Vec<T> {
    let count = items.len().min(most);
    (0..count).map(|i| items[i * items.len() / count].clone()).collect()
}

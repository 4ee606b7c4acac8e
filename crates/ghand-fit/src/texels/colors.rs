//! The mean colours that images show of texels.

use ghand_avatar::AvatarLight;
use ghand_capture::{Capture, Split};
use ghand_core::light::{linear, shade};
use ghand_core::mesh::Texture;
use ghand_core::{HandModel, Pose};
use ghand_hand_model::SurfaceSamples;
use ghand_render::Gpu;

use super::TexelError;
use super::views::{COLOR_COSINE, TexelObserver, TexelView, some_views};

/// Mean colours of a surface's texels, display values 0..1.
#[derive(Debug, Clone)]
pub struct TexelColors {
    /// One colour per sampled texel; texels that no view sees get the mean of the visible ones.
    pub colors: Vec<[f64; 3]>,
    /// Index of each texel in its raster.
    pub texels: Vec<u32>,
    /// Width and height of the raster, texels.
    pub resolution: u32,
}

/// How much the mean of all texels counts at each one, as a view with this weight: texels that training hardly saw, or
/// saw in deep shadow only, stay near it.
const PRIOR_WEIGHT: f64 = 0.02;

/// Mean colours over at most `view_count` of a split's views, chosen at random with a fixed seed. `poses` holds the
/// poses of the split's frames. With a light, whose Gaussians are the texels, the colours are those of the unlit skin:
/// least squares of the shade times the colour to what is seen less the gloss.
///
/// # Errors
/// [`TexelError`] if an image or the model is unusable.
pub fn texel_colors(
    gpu: &Gpu,
    capture: &Capture,
    split: &Split,
    poses: &[Pose],
    samples: SurfaceSamples,
    view_count: usize,
    lit: Option<(&AvatarLight, &HandModel)>,
) -> Result<TexelColors, TexelError> {
    let observer = TexelObserver::new(gpu, capture, samples)?;
    // Of each texel and channel: sums of weight * shade * colour and of weight * shade^2.
    let mut sums = vec![[[0.0f64; 2]; 3]; observer.samples().len()];
    for view in some_views(split, view_count) {
        let pose = &poses[view.position];
        let eye = capture.cameras[view.camera].center();
        let light = lit.map(|(light, model)| light.of_gaussians(model, pose, eye)).transpose()?;
        for (t, (sum, seen)) in sums.iter_mut().zip(observer.observe(&view, pose, COLOR_COSINE)?).enumerate() {
            let Some(TexelView { color, weight, .. }) = seen else { continue };
            for c in 0..3 {
                let [factor, mirrored] =
                    light.as_ref().map_or([1.0, 0.0], |light| [light.shades[t][c], light.gloss[t][c]].map(f64::from));
                let matte = if mirrored > 0.0 { shade((linear(color[c]) - mirrored).max(0.0)) } else { color[c] };
                sum[c][0] += weight * factor * matte;
                sum[c][1] += weight * factor * factor;
            }
        }
    }
    let total = |c: usize, k: usize| sums.iter().map(|sum| sum[c][k]).sum::<f64>();
    let mean = [0, 1, 2].map(|c| total(c, 0) / total(c, 1).max(f64::MIN_POSITIVE));
    let color =
        |sum: &[[f64; 2]; 3]| [0, 1, 2].map(|c| (sum[c][0] + PRIOR_WEIGHT * mean[c]) / (sum[c][1] + PRIOR_WEIGHT));
    let colors = sums.iter().map(color).collect();
    let SurfaceSamples { texels, resolution, .. } = observer.samples();
    Ok(TexelColors { colors, texels: texels.clone(), resolution: *resolution })
}

impl TexelColors {
    /// The colours as a texture. Texels next to the charts get a neighbour's colour, so that filtering does not darken
    /// the charts' edges.
    pub fn texture(&self) -> Texture {
        let n = self.resolution as usize;
        let mut grid: Vec<Option<[f64; 3]>> = vec![None; n * n];
        for (texel, color) in self.texels.iter().zip(&self.colors) {
            grid[*texel as usize] = Some(*color);
        }
        for _ in 0..4 {
            let previous = grid.clone();
            for y in 0..n {
                for x in 0..n {
                    if previous[y * n + x].is_none() {
                        let around = [(0, 1), (2, 1), (1, 0), (1, 2)];
                        let at = |(dx, dy): (usize, usize)| {
                            let (cx, cy) = ((x + dx).checked_sub(1)?, (y + dy).checked_sub(1)?);
                            if cx < n && cy < n { previous[cy * n + cx] } else { None }
                        };
                        grid[y * n + x] = around.into_iter().find_map(at);
                    }
                }
            }
        }
        let byte = |v: f64| (v * 255.0).round().clamp(0.0, 255.0) as u8;
        let rgb = grid.iter().map(|c| c.map_or([0; 3], |c| c.map(byte))).collect();
        Texture { width: self.resolution, height: self.resolution, rgb }
    }
}

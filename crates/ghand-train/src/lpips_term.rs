//! LPIPS as a term of the training loss: its value and its gradient.

use std::sync::Arc;

use ghand_render::splat::Splatter;
use ghand_render::{Gpu, RenderError, buffers};

use ghand_fit::views::TrainView;
use ghand_measure::lpips::{Lpips, LpipsError, Pair, SMALLEST_SIDE};

/// The display value of pixels that are added to crops smaller than LPIPS can process.
const PADDING: f32 = 0.5;

/// LPIPS between the splatted image and a view, computed on the host.
#[derive(Debug, Clone)]
pub(crate) struct LpipsTerm {
    lpips: Arc<Lpips>,
}

/// The splatted image and the view's, both padded to a size that LPIPS can process.
struct Padded {
    size: [u32; 2],
    picture: Vec<[f32; 3]>,
    truth: Vec<[f32; 3]>,
}

impl Padded {
    fn new(view: &TrainView, image: &[[f32; 4]]) -> Padded {
        let [width, height] = view.size;
        let size = view.size.map(|side| side.max(SMALLEST_SIDE));
        let pixels = (0..size[1]).flat_map(|y| (0..size[0]).map(move |x| (x, y)));
        let source = |(x, y): (u32, u32)| (x < width && y < height).then_some((y * width + x) as usize);
        let [mut picture, mut truth] = [Vec::new(), Vec::new()];
        for index in pixels.map(source) {
            let of = |at: Option<&[f32; 4]>| at.map_or([PADDING; 3], |pixel| [pixel[0], pixel[1], pixel[2]]);
            picture.push(of(index.and_then(|index| image.get(index))));
            let target =
                index.and_then(|index| view.pixels.get(index)).map(|pixel| pixel.map(|v| f32::from(v) / 255.0));
            truth.push(of(target.as_ref()));
        }
        Padded { size, picture, truth }
    }

    fn pair(&self) -> Pair<'_> {
        Pair { size: self.size, picture: &self.picture, truth: &self.truth }
    }

    /// Values of all pixels and channels.
    fn value_count(&self) -> f64 {
        3.0 * self.picture.len() as f64
    }
}

impl LpipsTerm {
    pub fn new(lpips: Arc<Lpips>) -> LpipsTerm {
        LpipsTerm { lpips }
    }

    fn padded(&self, gpu: &Gpu, splatter: &Splatter, view: &TrainView) -> Result<Padded, RenderError> {
        let image = splatter.read_image(gpu)?.rgba;
        Ok(Padded::new(view, &image))
    }

    /// LPIPS of the last frame, which shows `view`, over its crop.
    pub fn distance(&self, gpu: &Gpu, splatter: &Splatter, view: &TrainView) -> Result<f64, RenderError> {
        self.lpips.distance(&self.padded(gpu, splatter, view)?.pair()).map_err(failed)
    }

    /// Adds the gradient of `weight` times LPIPS to that of the last frame, which must be complete and show `view`, before
    /// the splatter's backward pass. LPIPS is a mean over the crop's pixels; it counts by the crop's part of
    /// `value_count`, so that crops of all sizes have the same weight per pixel.
    pub fn add_gradient(
        &self,
        gpu: &Gpu,
        splatter: &Splatter,
        view: &TrainView,
        weight: f64,
        value_count: f64,
    ) -> Result<(), RenderError> {
        let padded = self.padded(gpu, splatter, view)?;
        let (_, gradient) = self.lpips.distance_and_gradient(&padded.pair()).map_err(failed)?;
        let scale = (weight * padded.value_count() / value_count) as f32;
        let mut d_image: Vec<[f32; 4]> = buffers::read(gpu, splatter.d_image(), view.pixels.len())?;
        let rows = d_image.chunks_exact_mut(view.size[0].max(1) as usize);
        for (row, added) in rows.zip(gradient.chunks_exact(padded.size[0].max(1) as usize)) {
            for (pixel, added) in row.iter_mut().zip(added) {
                pixel.iter_mut().zip(added).for_each(|(sum, value)| *sum += scale * value);
            }
        }
        gpu.queue.write_buffer(splatter.d_image(), 0, bytemuck::cast_slice(&d_image));
        Ok(())
    }
}

fn failed(error: LpipsError) -> RenderError {
    RenderError::Invalid(error.to_string())
}

//! LPIPS as a term of the training loss, computed on the host.
//!
//! A step compares a window on the hand, not the whole image, once the avatar has taken shape: LPIPS of whole images in
//! all steps would take longer than everything else.

use std::sync::Arc;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use ghand_fit::views::TrainView;
use ghand_measure::lpips::{Lpips, LpipsError, Pair, SMALLEST_SIDE};
use ghand_render::splat::Splatter;
use ghand_render::{Gpu, RenderError, buffers};

/// The part of a stage after which LPIPS counts.
const FROM: f64 = 0.2;
/// The part of a crop that a window shows, and its smallest side, pixels.
const PART: f64 = 0.16;
const LEAST_SIDE: u32 = 128;
/// What is closer to the mask's outline than this, pixels, does not count: masks of photographs have jagged outlines,
/// which LPIPS would draw.
const MARGIN: i64 = 2;
/// How often a pixel of the hand is sought for a window.
const TRIES: usize = 16;
/// The display value of pixels that are added to crops smaller than LPIPS can process.
const PADDING: f32 = 0.5;

/// LPIPS between the splatted image and a view.
#[derive(Debug, Clone)]
pub(crate) struct LpipsTerm {
    lpips: Arc<Lpips>,
}

/// A rectangle of pixels in a view's crop.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Window {
    /// Left column and top row.
    start: [u32; 2],
    /// Width and height.
    size: [u32; 2],
}

impl Window {
    /// A window around a random pixel of the hand, another one in each step.
    fn new(view: &TrainView, step: u64) -> Window {
        let mut random = ChaCha8Rng::seed_from_u64(step);
        let pixels = f64::from(view.size[0]) * f64::from(view.size[1]);
        let side = LEAST_SIDE.max((PART * pixels).sqrt() as u32);
        let size = view.size.map(|whole| whole.min(side));
        let mut centre = [0; 2];
        for _ in 0..TRIES {
            centre = view.size.map(|side| random.random_range(0..side.max(1)));
            let pixel = view.pixels.get((centre[1] * view.size[0] + centre[0]) as usize);
            if pixel.is_some_and(|[.., mask]| *mask > 127) {
                break;
            }
        }
        let start = [0, 1].map(|k| centre[k].saturating_sub(size[k] / 2).min(view.size[k] - size[k]));
        Window { start, size }
    }

    /// The window's pixels of an image of the view's size, and around them what LPIPS lacks.
    fn cut(&self, width: u32, pixel: impl Fn(usize) -> Option<[f32; 3]>) -> Vec<[f32; 3]> {
        let [columns, rows] = self.padded_size();
        let places = (0..rows).flat_map(|y| (0..columns).map(move |x| [x, y]));
        let value = |[x, y]: [u32; 2]| {
            let is_inside = x < self.size[0] && y < self.size[1];
            let index = (self.start[1] + y) * width + self.start[0] + x;
            is_inside.then(|| pixel(index as usize)).flatten().unwrap_or([PADDING; 3])
        };
        places.map(value).collect()
    }

    /// Whether each pixel is on the hand, off its outline; what is beyond the crop counts as hand.
    fn on_hand(&self, view: &TrainView) -> Vec<bool> {
        let [width, height] = view.size.map(i64::from);
        let is_hand = |x: i64, y: i64| {
            let is_in_crop = (0..width).contains(&x) && (0..height).contains(&y);
            !is_in_crop || view.pixels.get((y * width + x) as usize).is_some_and(|[.., mask]| *mask == u8::MAX)
        };
        let [left, top] = self.start.map(i64::from);
        let [columns, rows] = self.padded_size().map(i64::from);
        // First along the rows, then along the columns of what came of that.
        let around = |x: i64, y: i64| (x - MARGIN..=x + MARGIN).all(|x| is_hand(x, y));
        let tall: Vec<bool> = (top - MARGIN..top + rows + MARGIN)
            .flat_map(|y| (left..left + columns).map(move |x| (x, y)))
            .map(|(x, y)| around(x, y))
            .collect();
        let columns = columns as usize;
        let is_off_outline = |at: usize| (0..=2 * MARGIN as usize).all(|row| tall[at + row * columns]);
        (0..columns * rows as usize).map(is_off_outline).collect()
    }

    /// Width and height of what LPIPS compares.
    fn padded_size(&self) -> [u32; 2] {
        self.size.map(|side| side.max(SMALLEST_SIDE))
    }
}

impl LpipsTerm {
    pub fn new(lpips: Arc<Lpips>) -> LpipsTerm {
        LpipsTerm { lpips }
    }

    /// Whether a step has the term; `fraction` is how much of the stage is done, 0..1.
    pub fn counts(fraction: f64) -> bool {
        fraction >= FROM
    }

    /// Adds the gradient of `weight` times LPIPS to that of the last frame, which must be complete and show `view`, before
    /// the splatter's backward pass. LPIPS is a mean over the window's pixels, which stand for those of the crop; it
    /// counts by the crop's part of `value_count`, so that crops of all sizes have the same weight per pixel. `step`
    /// chooses the window.
    pub fn add_gradient(
        &self,
        gpu: &Gpu,
        splatter: &Splatter,
        view: &TrainView,
        weight: f64,
        value_count: f64,
        step: u64,
    ) -> Result<(), RenderError> {
        let window = Window::new(view, step);
        let [width, height] = view.size;
        let image = splatter.read_image(gpu)?.rgba;
        let picture = window.cut(width, |at| image.get(at).map(|&[r, g, b, _]| [r, g, b]));
        let mut truth =
            window.cut(width, |at| view.pixels.get(at).map(|&[r, g, b, _]| [r, g, b].map(|v| f32::from(v) / 255.0)));
        let on_hand = window.on_hand(view);
        // Where nothing is to be learned, both pictures are the same.
        for ((truth, picture), _) in truth.iter_mut().zip(&picture).zip(&on_hand).filter(|(_, on_hand)| !**on_hand) {
            *truth = *picture;
        }
        let size = window.padded_size();
        let pair = Pair { size, picture: &picture, truth: &truth };
        let (_, gradient) = self.lpips.distance_and_gradient(&pair).map_err(failed)?;
        let pixels = (f64::from(width) * f64::from(height)).max(picture.len() as f64);
        let scale = (weight * 3.0 * pixels / value_count) as f32;
        let mut d_image: Vec<[f32; 4]> = buffers::read(gpu, splatter.d_image(), view.pixels.len())?;
        let [left, top] = window.start.map(|at| at as usize);
        let rows = d_image.chunks_exact_mut(width.max(1) as usize).skip(top);
        let columns = size[0] as usize;
        for (row, (added, on_hand)) in rows.zip(gradient.chunks_exact(columns).zip(on_hand.chunks_exact(columns))) {
            let pixels = row.iter_mut().skip(left).zip(added).zip(on_hand);
            for ((pixel, added), _) in pixels.filter(|(_, on_hand)| **on_hand) {
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

#[cfg(test)]
mod tests {
    use ghand_core::Camera;
    use glam::DVec3;

    use super::*;

    /// A crop whose hand is a disc around `centre`.
    fn view(size: [u32; 2], centre: [i64; 2], radius: i64) -> TrainView {
        let places = (0..size[1]).flat_map(|y| (0..size[0]).map(move |x| [x, y].map(i64::from)));
        let mask = |[x, y]: [i64; 2]| (x - centre[0]).pow(2) + (y - centre[1]).pow(2) < radius.pow(2);
        let camera = Camera::look_at(DVec3::Z, DVec3::ZERO, DVec3::Y, 1.0, size[0], size[1]);
        let pixels = places.map(|at| [0, 0, 0, if mask(at) { 255 } else { 0 }]).collect();
        TrainView { camera_index: 0, frame: 0, camera, size, pixels }
    }

    #[test]
    fn windows_lie_in_the_crop_on_the_hand_and_differ_from_step_to_step() {
        for (size, side) in [([300, 400], 138), ([1000, 400], 252), ([400, 90], 128)] {
            let [x, y] = size.map(|side| i64::from(side) / 3);
            let view = view(size, [x, y], x.min(y));
            let windows: Vec<Window> = (0..40).map(|step| Window::new(&view, step)).collect();
            for window in &windows {
                assert_eq!(window.size, size.map(|whole| whole.min(side)));
                assert!((0..2).all(|k| window.start[k] + window.size[k] <= size[k]), "{window:?}");
            }
            let shows_hand = |window: &&Window| {
                let pixel = |at: usize| Some([f32::from(view.pixels[at][3]), 0.0, 0.0]);
                window.cut(size[0], pixel).iter().any(|pixel| pixel[0] > 127.0)
            };
            assert!(windows.iter().filter(shows_hand).count() > 30);
            assert!(windows.windows(2).filter(|pair| pair[0] != pair[1]).count() > 20);
            assert_eq!(windows[7], Window::new(&view, 7));
        }
    }

    #[test]
    fn the_outline_and_what_is_outside_do_not_count() {
        let view = view([120, 90], [60, 45], 30);
        let on_hand = Window::new(&view, 1).on_hand(&view);
        let distance = |at: usize| ((at % 120) as f64 - 60.0).hypot((at / 120) as f64 - 45.0);
        for (at, on_hand) in on_hand.into_iter().enumerate() {
            // A square of 5 pixels is in the disc, or is not.
            let known = (distance(at) < 27.0).then_some(true).or((distance(at) > 29.5).then_some(false));
            assert!(known.is_none_or(|known| known == on_hand), "{} px from the centre", distance(at));
        }
        // Only the hand is in the picture: it has no outline at the edges of the crop.
        let whole = TrainView { pixels: vec![[0, 0, 0, 255]; 120 * 90], ..view };
        assert!(Window::new(&whole, 1).on_hand(&whole).into_iter().all(|on_hand| on_hand));
    }

    #[test]
    fn a_small_crop_is_compared_as_a_whole_with_grey_around_it() {
        let view = view([20, 100], [10, 50], 9);
        let window = Window::new(&view, 3);
        assert_eq!(window, Window { start: [0, 0], size: [20, 100] });
        assert_eq!(window.padded_size(), [SMALLEST_SIDE, 100]);
        let cut = window.cut(20, |at| Some([at as f32, 0.0, 0.0]));
        assert_eq!(cut.len(), 3100);
        assert_eq!([cut[0], cut[19], cut[20], cut[31]].map(|pixel| pixel[0]), [0.0, 19.0, PADDING, 20.0]);
    }
}

//! Masks from colours: which pixels are hand by what they look like, where the posed model is, and where edges are.
//!
//! Each pixel has the odds that its colour is the hand's against that of what is behind it, and odds by its distance from
//! the posed model's outline, which is as uncertain as poses are. A minimum cut finds the mask: parting neighbours costs
//! little where the image has an edge (Rother et al., GrabCut, 2004).

use super::contour::{EDGES, keep_largest, parts};
use super::guide::Guide;
use super::histogram::Histogram;
use super::min_cut::{GridCut, NEIGHBOURS};
use super::still::Still;

/// How exact the poses are that a mask is made from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum Poses {
    /// A tracker's.
    Given,
    /// Aligned to earlier masks.
    Aligned,
}

impl Poses {
    /// Standard deviation of the outline's place, relative to the hand's size. Outlines in a webcam tracker's poses are
    /// off by 3 % in the median (3 to 4 pixels of 130, on a real capture), more at fingertips; aligned ones by less than 1 %.
    fn deviation(self) -> f64 {
        match self {
            Poses::Given => 0.06,
            Poses::Aligned => 0.02,
        }
    }

    /// Beyond this distance from the outline, relative to the hand's size, no pixel is hand.
    pub fn reach(self) -> f64 {
        5.0 * self.deviation()
    }
}

/// The parts of hand and surroundings that may have any colour: a hand has few colours, what is behind it may have all.
const ODD_HAND: f64 = 0.003;
const ODD_SURROUNDINGS: f64 = 0.1;
/// Pixels outside of the posed model and this many bands beyond the start of its end are no part of a mask: the band is 6 % of
/// the hand long, and poses are off by a little.
const MOST_ARM: f64 = 1.6;
/// Integer costs per natural unit of information.
const UNIT: f64 = 64.0;
/// Largest odds by colour and by place, natural logarithms: neither decides alone.
const MOST_COLOR: f64 = 6.0;
const MOST_PLACE: f64 = 5.0;
/// Cost of parting neighbours of the same colour, and of parting any.
const CONTRAST: f64 = 7.0;
const LENGTH: f64 = 0.6;
/// Holes smaller than this, relative to the mask, are closed.
const LARGEST_HOLE: f64 = 0.004;

/// The colours of a camera.
#[derive(Debug)]
pub(super) struct Colors {
    pub hand: Histogram,
    pub surroundings: Histogram,
    pub still: Still,
}

impl Colors {
    /// The mask of an image (row-major; pixels with alpha 0 are outside what the camera sees): whether each pixel is hand.
    pub fn mask(&self, rgba: &[[u8; 4]], width: usize, guide: &Guide, poses: Poses) -> Vec<bool> {
        let (columns, rows) = (guide.columns.clone(), guide.rows.clone());
        let size = [columns.len(), rows.len()];
        let at = |x: usize, y: usize| (rows.start + y) * width + columns.start + x;
        let rgb = |x: usize, y: usize| rgba.get(at(x, y)).map_or([0; 3], |[r, g, b, _]| [*r, *g, *b]);
        let far = (1e4 * UNIT) as i32;
        let mut grid = GridCut::new(size[0], size[1]);
        for y in 0..size[1] {
            for x in 0..size[0] {
                let [column, row] = [columns.start + x, rows.start + y];
                let is_seen = rgba.get(at(x, y)).is_some_and(|pixel| pixel[3] > 0);
                let distance = guide.distance(column, row).filter(|d| *d < poses.reach() && is_seen);
                let may_be_hand = |d: &f64| *d < 0.0 || !guide.is_beyond(column, row, MOST_ARM);
                let preference = match distance.filter(may_be_hand) {
                    Some(distance) => {
                        let place = (-distance / poses.deviation()).clamp(-MOST_PLACE, MOST_PLACE);
                        (UNIT * (place + self.odds(at(x, y), rgb(x, y)))) as i32
                    }
                    None => -far,
                };
                grid.set_preference(x, y, preference);
            }
        }
        self.set_costs(&mut grid, size, rgb);
        let mut inside = grid.cut();
        keep_largest(&mut inside, size[0]);
        close_holes(&mut inside, size[0]);
        let mut mask = vec![false; rgba.len()];
        for (i, inside) in inside.into_iter().enumerate() {
            if let Some(pixel) = mask.get_mut(at(i % size[0].max(1), i / size[0].max(1))) {
                *pixel = inside;
            }
        }
        mask
    }

    /// Natural logarithm of the odds that a pixel is hand by its colour.
    fn odds(&self, pixel: usize, rgb: [u8; 3]) -> f64 {
        let anywhere = self.surroundings.probability(rgb, ODD_SURROUNDINGS);
        let behind = self.still.probability(pixel, rgb, anywhere);
        (self.hand.probability(rgb, ODD_HAND) / behind).ln().clamp(-MOST_COLOR, MOST_COLOR)
    }

    fn set_costs(&self, grid: &mut GridCut, size: [usize; 2], rgb: impl Fn(usize, usize) -> [u8; 3]) {
        let difference = |a: [u8; 3], b: [u8; 3]| (0..3).map(|c| f64::from(a[c].abs_diff(b[c])).powi(2)).sum::<f64>();
        let pairs = || {
            (0..size[1]).flat_map(move |y| (0..size[0]).map(move |x| [x, y])).flat_map(move |[x, y]| {
                NEIGHBOURS.iter().enumerate().take(4).filter_map(move |(direction, [dx, dy])| {
                    let (x2, y2) = (x.checked_add_signed(*dx)?, y.checked_add_signed(*dy)?);
                    (x2 < size[0] && y2 < size[1]).then_some(([x, y], direction, [x2, y2]))
                })
            })
        };
        let (sum, count) = pairs().fold((0.0, 0usize), |(sum, count), ([x, y], _, [x2, y2])| {
            (sum + difference(rgb(x, y), rgb(x2, y2)), count + 1)
        });
        let mean = (sum / count.max(1) as f64).max(1.0);
        for ([x, y], direction, [x2, y2]) in pairs() {
            let contrast = (-difference(rgb(x, y), rgb(x2, y2)) / (2.0 * mean)).exp();
            let length = if direction % 2 == 0 { 1.0 } else { std::f64::consts::SQRT_2 };
            grid.set_cost(x, y, direction, (UNIT * (CONTRAST * contrast + LENGTH) / length) as i32);
        }
    }
}

/// Closes small holes of a row-major mask.
fn close_holes(mask: &mut [bool], width: usize) {
    let least = (LARGEST_HOLE * mask.iter().filter(|inside| **inside).count() as f64) as usize;
    let free: Vec<bool> = mask.iter().map(|inside| !inside).collect();
    for hole in parts(&free, width, EDGES).iter().filter(|part| part.len() <= least) {
        hole.iter().for_each(|&i| mask[i] = true);
    }
}

#[cfg(test)]
mod tests {
    use ghand_core::{Camera, Side};
    use ghand_hand_model::builtin::builtin_hand;
    use glam::DVec3;

    use super::*;

    #[test]
    fn what_the_posed_model_covers_beyond_its_end_is_hand() {
        const SKIN: [u8; 3] = [200, 140, 120];
        let model = builtin_hand(Side::Right).unwrap();
        // The arm, along +Y, comes towards the camera.
        let wrist = model.joints[0];
        let eye = wrist + 0.4 * DVec3::new(30_f64.to_radians().sin(), 30_f64.to_radians().cos(), 0.0);
        let camera = Camera::look_at(eye, wrist, DVec3::Z, 0.6, 240, 200);
        let guide = Guide::new(&camera, &model, &model.vertices, Poses::Aligned.reach()).unwrap();
        let [mut hand, mut surroundings] = [0, 1].map(|_| Histogram::new());
        hand.add(SKIN);
        surroundings.add([60, 120, 90]);
        let colors = Colors { hand: hand.smoothed(), surroundings: surroundings.smoothed(), still: Still::of(vec![]) };
        // All is skin.
        let rgba = vec![[SKIN[0], SKIN[1], SKIN[2], 255]; 240 * 200];
        let mask = colors.mask(&rgba, 240, &guide, Poses::Aligned);
        let is = |i: usize, bands: f64| guide.is_beyond(i % 240, i / 240, bands);
        let inside = |i: &usize| guide.distance(i % 240, i / 240).is_some_and(|distance| distance < -0.02);
        let beyond: Vec<usize> = (0..mask.len()).filter(inside).filter(|i| is(*i, MOST_ARM)).collect();
        assert!(beyond.len() > 100, "{}", beyond.len());
        assert!(beyond.iter().all(|i| mask[*i]));
        // The arm beside it is not.
        assert!(
            (0..mask.len()).all(|i| !mask[i] || !is(i, MOST_ARM) || guide.distance(i % 240, i / 240).unwrap() < 0.0)
        );
    }
}

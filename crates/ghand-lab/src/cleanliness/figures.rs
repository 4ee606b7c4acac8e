//! How clean pictures of a hand are that nothing can be compared with: whether their colours occur in the training images,
//! whether their fine detail is as strong as there, and whether any part is darker or more saturated ([`super::tones`]).

use ghand_capture::mask::depths;
use ghand_measure::metrics::quantize;
use serde::Serialize;

use super::tones::{ToneSums, Tones};

/// Bins of a colour channel, 8 grey levels wide.
const BINS: usize = 32;
/// Part of the training pixels up to which a colour is an accident, such as a pixel that a mask has wrong.
const RARE: f64 = 1e-5;
/// Depth below the outline up to which the background may mix into a pixel, pixels.
const RIM: f64 = 2.0;
/// Half the width of the square that detail is compared with, pixels.
pub(super) const REACH: usize = 2;
/// Least depth of a pixel whose square has no pixel in the rim: the square's corners are 2.8 pixels away.
pub(super) const DEEP: f64 = RIM + 3.0;
/// Least coverage of a pixel that shows the hand alone.
const OPAQUE: f32 = 0.95;

/// A picture of a hand.
#[derive(Debug, Clone)]
pub struct HandPicture {
    pub(super) size: [u32; 2],
    pub(super) colors: Vec<[u8; 3]>,
    /// Depth of each pixel below the hand's outline, pixels.
    pub(super) depths: Vec<f64>,
    pub(super) is_opaque: Vec<bool>,
}

impl HandPicture {
    /// An image of a capture: red, green, blue, mask; row-major.
    pub fn of_image(rgba: &[[u8; 4]], size: [u32; 2]) -> HandPicture {
        HandPicture {
            size,
            colors: rgba.iter().map(|&[r, g, b, _]| [r, g, b]).collect(),
            depths: depths(rgba.iter().map(|pixel| pixel[3] >= 128), size),
            is_opaque: vec![true; rgba.len()],
        }
    }

    /// A rendering: colour over the background, and coverage; row-major, 0..1.
    pub fn of_rendering(rgba: &[[f32; 4]], size: [u32; 2]) -> HandPicture {
        HandPicture {
            size,
            colors: rgba.iter().map(|&[r, g, b, _]| quantize([r, g, b])).collect(),
            depths: depths(rgba.iter().map(|pixel| pixel[3] >= 0.5), size),
            is_opaque: rgba.iter().map(|pixel| pixel[3] >= OPAQUE).collect(),
        }
    }

    /// Whether every pixel is the hand's, as in images without masks.
    pub fn is_all_hand(&self) -> bool {
        self.depths.iter().all(|depth| *depth > 0.0)
    }

    /// Colours of the pixels below the rim, and whether they are opaque.
    fn hand_pixels(&self) -> impl Iterator<Item = ([u8; 3], bool)> {
        let pixels = self.depths.iter().zip(&self.colors).zip(&self.is_opaque);
        pixels.filter(|((depth, _), _)| **depth > RIM).map(|((_, color), is_opaque)| (*color, *is_opaque))
    }
}

/// The distribution of the training images' hand pixels over colours.
#[derive(Debug, Clone)]
pub struct KnownColors {
    /// Pixels in each bin and those that touch it.
    near: Vec<u64>,
    total: u64,
    tones: Tones,
}

impl Default for KnownColors {
    fn default() -> KnownColors {
        KnownColors { near: vec![0; BINS.pow(3)], total: 0, tones: Tones::default() }
    }
}

fn bin([r, g, b]: [usize; 3]) -> usize {
    (r * BINS + g) * BINS + b
}

fn bins_of(color: [u8; 3]) -> [usize; 3] {
    color.map(|value| usize::from(value) * BINS / 256)
}

impl KnownColors {
    /// Adds those of one image.
    pub fn add(&mut self, picture: &HandPicture) {
        self.tones.add(picture);
        for (color, _) in picture.hand_pixels() {
            let at = bins_of(color);
            let around = |k: usize| at[k].saturating_sub(1)..=(at[k] + 1).min(BINS - 1);
            for (r, g) in around(0).flat_map(|r| around(1).map(move |g| (r, g))) {
                around(2).for_each(|b| self.near[bin([r, g, b])] += 1);
            }
            self.total += 1;
        }
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.total == 0
    }

    /// Whether more than [`RARE`] of the training pixels have this colour or one at most a bin away in each channel.
    pub fn contains(&self, color: [u8; 3]) -> bool {
        self.near[bin(bins_of(color))] as f64 > RARE * self.total as f64
    }
}

/// High-frequency energy: the squares of the differences between a pixel's luminance and the mean of the 5 x 5 pixels
/// around it, relative to the squares of these means. Brightness does not change it.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct DetailEnergy {
    differences: f64,
    means: f64,
}

impl DetailEnergy {
    /// Adds the pixels of a picture whose whole square is hand.
    pub fn add(&mut self, picture: &HandPicture) {
        let [width, height] = picture.size.map(|n| n as usize);
        let luminance: Vec<f64> = picture.colors.iter().map(|c| luminance(c.map(|v| f64::from(v) / 255.0))).collect();
        let side = 2 * REACH + 1;
        for y in REACH..height.saturating_sub(REACH) {
            for x in REACH..width.saturating_sub(REACH) {
                if picture.depths[y * width + x] <= DEEP {
                    continue;
                }
                let rows = (y - REACH..=y + REACH).map(|y| &luminance[y * width + x - REACH..=y * width + x + REACH]);
                let mean = rows.flatten().sum::<f64>() / (side * side) as f64;
                self.differences += (luminance[y * width + x] - mean).powi(2);
                self.means += mean * mean;
            }
        }
    }

    /// Adds the pixels of other pictures.
    pub fn merge(&mut self, other: &DetailEnergy) {
        self.differences += other.differences;
        self.means += other.means;
    }

    /// The energy; `None` without pixels, or if all are black.
    pub fn value(&self) -> Option<f64> {
        (self.means > 0.0).then(|| self.differences / self.means)
    }

    /// The energy as a multiple of another; `None` if either has none.
    pub fn relative_to(&self, other: &DetailEnergy) -> Option<f64> {
        Some(self.value()? / other.value().filter(|value| *value > 0.0)?)
    }
}

/// Luminance of display values, 0..1.
pub(super) fn luminance([r, g, b]: [f64; 3]) -> f64 {
    0.2126 * r + 0.7152 * g + 0.0722 * b
}

/// Sums over pictures.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct PictureSums {
    pixels: usize,
    see_through: usize,
    outside: usize,
    tones: ToneSums,
    /// High-frequency energy.
    pub detail: DetailEnergy,
}

impl PictureSums {
    /// Adds one picture.
    pub fn add(&mut self, picture: &HandPicture, known: &KnownColors) {
        for (color, is_opaque) in picture.hand_pixels() {
            self.pixels += 1;
            if !is_opaque {
                self.see_through += 1;
            } else if !known.contains(color) {
                self.outside += 1;
            }
        }
        self.tones.add(picture, &known.tones);
        self.detail.add(picture);
    }

    /// Adds the sums over other pictures.
    pub fn merge(&mut self, other: &PictureSums) {
        self.pixels += other.pixels;
        self.see_through += other.see_through;
        self.outside += other.outside;
        self.tones.merge(&other.tones);
        self.detail.merge(&other.detail);
    }

    /// The figures, against the training images' energy.
    pub fn figures(&self, training: &DetailEnergy) -> Cleanliness {
        let share = |count: usize, of: usize| (of > 0).then(|| count as f64 / of as f64);
        let [darker_share, more_saturated_share] = self.tones.shares();
        Cleanliness {
            outside_share: share(self.outside, self.pixels - self.see_through),
            see_through_share: share(self.see_through, self.pixels),
            detail: self.detail.relative_to(training),
            darker_share,
            more_saturated_share,
        }
    }
}

/// Figures of pictures; `None` where there are no pixels to count.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Cleanliness {
    /// Part of the opaque hand pixels, deeper than 2 pixels below the outline, whose colour the training images lack.
    pub outside_share: Option<f64>,
    /// Part of the pixels deeper than 2 pixels below the outline that are not opaque.
    pub see_through_share: Option<f64>,
    /// High-frequency energy as a multiple of the training images'.
    pub detail: Option<f64>,
    /// Part of the hand that is darker than all but a hundredth of the skin in the training images, by a tenth or more:
    /// means over 5 x 5 pixels.
    pub darker_share: Option<f64>,
    /// Part of the hand that is more saturated in the same sense.
    pub more_saturated_share: Option<f64>,
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIDE: usize = 60;
    const SIZE: [u32; 2] = [SIDE as u32; 2];

    /// A disc of skin with soft stripes on a green background; `change` may replace its colour at a pixel.
    fn disc(change: impl Fn(usize, usize) -> Option<[u8; 3]>) -> Vec<[u8; 4]> {
        let pixels = (0..SIDE).flat_map(|y| (0..SIDE).map(move |x| (x, y)));
        let pixel = |(x, y): (usize, usize)| {
            let is_inside = x.abs_diff(30).pow(2) + y.abs_diff(30).pow(2) < 25 * 25;
            let stripe = (10.0 * (x as f64 * 0.4).sin()) as i32;
            let skin = [190, 140, 110].map(|v: i32| (v + stripe) as u8);
            let [r, g, b] = if is_inside { change(x, y).unwrap_or(skin) } else { [0, 255, 0] };
            [r, g, b, if is_inside { 255 } else { 0 }]
        };
        pixels.map(pixel).collect()
    }

    fn rendered(image: &[[u8; 4]]) -> Vec<[f32; 4]> {
        image.iter().map(|pixel| pixel.map(|v| f32::from(v) / 255.0)).collect()
    }

    fn measured(rendering: &[[f32; 4]]) -> Cleanliness {
        let training = HandPicture::of_image(&disc(|_, _| None), SIZE);
        let mut known = KnownColors::default();
        let mut detail = DetailEnergy::default();
        known.add(&training);
        detail.add(&training);
        let mut sums = PictureSums::default();
        sums.add(&HandPicture::of_rendering(rendering, SIZE), &known);
        sums.figures(&detail)
    }

    #[test]
    fn a_picture_like_the_training_image_is_clean() {
        let clean = measured(&rendered(&disc(|_, _| None)));
        assert_eq!((clean.outside_share, clean.see_through_share), (Some(0.0), Some(0.0)));
        assert!((clean.detail.unwrap() - 1.0).abs() < 1e-12, "{clean:?}");
        // A little darker: neither a new colour nor other detail.
        let darker: Vec<[f32; 4]> =
            rendered(&disc(|_, _| None)).iter().map(|&[r, g, b, a]| [r * 0.98, g * 0.98, b * 0.98, a]).collect();
        let darker = measured(&darker);
        assert_eq!(darker.outside_share, Some(0.0));
        assert!((darker.detail.unwrap() - 1.0).abs() < 0.05, "{darker:?}");
    }

    #[test]
    fn planted_specks_are_counted_and_raise_the_detail() {
        // 9 pixels of one colour in each 100, all inside the disc's rim.
        let is_speck = |x: usize, y: usize| (20..40).contains(&x) && (20..40).contains(&y) && x % 10 < 3 && y % 10 < 3;
        let speckled = measured(&rendered(&disc(|x, y| is_speck(x, y).then_some([40, 40, 160]))));
        let hand = depths(disc(|_, _| None).iter().map(|p| p[3] > 0), SIZE).iter().filter(|d| **d > RIM).count();
        assert_eq!(speckled.outside_share, Some(36.0 / hand as f64));
        assert!(speckled.detail.unwrap() > 10.0, "{speckled:?}");
        // Blurred skin has no detail.
        let flat = measured(&rendered(&disc(|_, _| Some([190, 140, 110]))));
        assert!(flat.outside_share == Some(0.0) && flat.detail.unwrap() < 1e-9, "{flat:?}");
    }

    #[test]
    fn the_background_at_the_outline_does_not_count_and_holes_count_once() {
        let mut mixed = rendered(&disc(|_, _| None));
        let depth = depths(mixed.iter().map(|p| p[3] > 0.5), SIZE);
        for (pixel, _) in mixed.iter_mut().zip(&depth).filter(|(_, depth)| (0.0..RIM).contains(*depth)) {
            *pixel = [0.5, 0.9, 0.3, 0.6];
        }
        assert_eq!(measured(&mixed).outside_share, Some(0.0));
        // Two pixels let the background through, in a colour that skin does not have.
        mixed[30 * SIDE + 30] = [0.5, 0.9, 0.3, 0.7];
        mixed[30 * SIDE + 20] = [0.5, 0.9, 0.3, 0.7];
        let found = measured(&mixed);
        let hand = depth.iter().filter(|depth| **depth > RIM).count() as f64;
        assert_eq!((found.outside_share, found.see_through_share), (Some(0.0), Some(2.0 / hand)));
    }

    #[test]
    fn colours_up_to_a_bin_away_are_known() {
        let mut known = KnownColors::default();
        assert!(known.is_empty());
        known.add(&HandPicture::of_image(&[[100, 0, 255, 255]], [1, 1]));
        // The bin of 100 is 96..=103.
        for (color, is_known) in
            [([100, 0, 255], true), ([88, 15, 240], true), ([111, 8, 250], true), ([87, 0, 255], false)]
        {
            assert_eq!(known.contains(color), is_known, "{color:?}");
        }
        assert!(!known.contains([112, 0, 255]) && !known.contains([100, 16, 255]) && !known.contains([100, 0, 239]));
    }

    #[test]
    fn colours_of_a_few_stray_pixels_are_not_known() {
        let image = |stray: usize| {
            let color = |i: usize| if i < stray { [20, 200, 20, 255] } else { [190, 140, 110, 255] };
            HandPicture::of_image(&(0..500 * 400).map(color).collect::<Vec<_>>(), [500, 400])
        };
        for (stray, is_known) in [(2, false), (3, true)] {
            let mut known = KnownColors::default();
            known.add(&image(stray));
            assert_eq!(known.contains([20, 200, 20]), is_known, "{stray} of 200,000 pixels");
            assert!(known.contains([190, 140, 110]));
        }
    }

    #[test]
    fn pictures_without_hand_have_no_figures() {
        let empty = vec![[0.0; 4]; SIDE * SIDE];
        let none = measured(&empty);
        assert_eq!((none.outside_share, none.see_through_share, none.detail), (None, None, None));
        assert!(HandPicture::of_image(&[[1, 2, 3, 255]; 4], [2, 2]).is_all_hand());
        assert!(!HandPicture::of_image(&disc(|_, _| None), SIZE).is_all_hand());
    }
}

//! Whether a part of a hand is darker or more saturated than skin in the training images.
//!
//! A part is the mean over a square of 5 x 5 pixels deep in the hand, so that neither noise nor the outline counts.

use super::figures::{DEEP, HandPicture, REACH, luminance};

/// Steps of luminance and saturation, 0..1.
const STEPS: usize = 256;
/// The part of the training images whose darkness and saturation are accidents: creases, and pixels that a mask has wrong.
const EXTREME: f64 = 0.01;
/// A part is darker if its luminance is less than this fraction of the darkest that is no accident, and more saturated if
/// what it lacks of saturation is less than this fraction: a step that is seen, but not a strong one.
const MARGIN: f64 = 0.9;

/// The distribution of the training images' parts over luminance and saturation.
#[derive(Debug, Clone)]
pub(super) struct Tones {
    luminances: [u64; STEPS],
    saturations: [u64; STEPS],
}

impl Default for Tones {
    fn default() -> Tones {
        Tones { luminances: [0; STEPS], saturations: [0; STEPS] }
    }
}

fn step(value: f64) -> usize {
    ((value * STEPS as f64) as usize).min(STEPS - 1)
}

/// Luminance and saturation of display values.
fn tone(color: [f64; 3]) -> [f64; 2] {
    let most = color.iter().copied().fold(0.0, f64::max);
    let least = color.iter().copied().fold(most, f64::min);
    [luminance(color), if most > 0.0 { 1.0 - least / most } else { 0.0 }]
}

impl Tones {
    /// Adds those of one image.
    pub fn add(&mut self, picture: &HandPicture) {
        for [luminance, saturation] in picture.parts().map(tone) {
            self.luminances[step(luminance)] += 1;
            self.saturations[step(saturation)] += 1;
        }
    }

    /// The darkest luminance and the strongest saturation that are no accidents; `None` without parts.
    fn extremes(&self) -> Option<[f64; 2]> {
        let few = EXTREME * self.luminances.iter().sum::<u64>() as f64;
        let darkest = first_beyond(few, self.luminances.iter())? as f64 / STEPS as f64;
        let strongest = 1.0 - first_beyond(few, self.saturations.iter().rev())? as f64 / STEPS as f64;
        Some([darkest, strongest])
    }
}

/// The first place at which the sum of counts is more than a few.
fn first_beyond<'a>(few: f64, mut counts: impl Iterator<Item = &'a u64>) -> Option<usize> {
    let mut sum = 0;
    counts.position(|count| {
        sum += count;
        sum as f64 > few
    })
}

/// Sums over pictures.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct ToneSums {
    parts: usize,
    darker: usize,
    more_saturated: usize,
}

impl ToneSums {
    /// Adds one picture.
    pub fn add(&mut self, picture: &HandPicture, known: &Tones) {
        let Some([darkest, strongest]) = known.extremes() else { return };
        for [luminance, saturation] in picture.parts().map(tone) {
            self.parts += 1;
            self.darker += usize::from(luminance < MARGIN * darkest);
            self.more_saturated += usize::from(1.0 - saturation < MARGIN * (1.0 - strongest));
        }
    }

    /// Adds the sums over other pictures.
    pub fn merge(&mut self, other: &ToneSums) {
        self.parts += other.parts;
        self.darker += other.darker;
        self.more_saturated += other.more_saturated;
    }

    /// The shares of parts that are darker and that are more saturated; `None` without parts.
    pub fn shares(&self) -> [Option<f64>; 2] {
        [self.darker, self.more_saturated].map(|count| (self.parts > 0).then(|| count as f64 / self.parts as f64))
    }
}

impl HandPicture {
    /// The mean colours of the squares around opaque pixels deep in the hand, display values.
    fn parts(&self) -> impl Iterator<Item = [f64; 3]> {
        let [width, height] = self.size.map(|n| n as usize);
        let inner = |n: usize| REACH..n.saturating_sub(REACH);
        let places = inner(height).flat_map(move |y| inner(width).map(move |x| (x, y)));
        let is_part = move |(x, y): &(usize, usize)| {
            let at = y * width + x;
            self.depths[at] > DEEP && self.is_opaque[at]
        };
        let side = 2 * REACH + 1;
        places.filter(is_part).map(move |(x, y)| {
            let rows = (y - REACH..=y + REACH).map(|y| &self.colors[y * width + x - REACH..=y * width + x + REACH]);
            let sum = rows.flatten().fold([0.0; 3], |sum, color| [0, 1, 2].map(|c| sum[c] + f64::from(color[c])));
            sum.map(|sum: f64| sum / (255 * side * side) as f64)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: [u32; 2] = [60, 60];

    /// Skin of which a part of the width has another colour.
    fn shares(other: [u8; 3], part: f64) -> [f64; 2] {
        let picture = |other: [u8; 3], part: f64| {
            let colors = (0..3600).map(|i| {
                let skin = (170 + (i / 60) as u8 % 8, 120, 100);
                let [r, g, b] = if ((i % 60) as f64) < 60.0 * part { other } else { skin.into() };
                [r, g, b, 255]
            });
            HandPicture::of_image(&colors.collect::<Vec<_>>(), SIZE)
        };
        let mut known = Tones::default();
        known.add(&picture([0; 3], 0.0));
        let mut sums = ToneSums::default();
        sums.add(&picture(other, part), &known);
        sums.shares().map(|share| share.unwrap())
    }

    #[test]
    fn dark_and_colourful_parts_are_counted_and_skin_is_not() {
        assert_eq!(shares([170, 120, 100], 0.0), [0.0, 0.0]);
        // A little darker, a little redder, much brighter, grey.
        for harmless in [[164, 114, 95], [180, 120, 98], [250, 240, 230], [140, 140, 140]] {
            assert_eq!(shares(harmless, 0.5), [0.0, 0.0], "{harmless:?}");
        }
        let [darker, more_saturated] = shares([110, 78, 65], 0.5);
        assert!((0.4..0.6).contains(&darker) && more_saturated == 0.0, "{darker} {more_saturated}");
        let [darker, more_saturated] = shares([210, 120, 70], 0.5);
        assert!((0.4..0.6).contains(&more_saturated) && darker == 0.0, "{darker} {more_saturated}");
    }

    #[test]
    fn a_few_dark_pixels_of_the_training_images_do_not_make_dark_skin_usual() {
        let skin = |dark: usize| {
            let color = |i: usize| if i < dark * 60 { [30, 20, 20, 255] } else { [180, 130, 100, 255] };
            HandPicture::of_image(&(0..3600).map(color).collect::<Vec<_>>(), SIZE)
        };
        let mut known = Tones::default();
        (0..200).for_each(|_| known.add(&skin(0)));
        known.add(&skin(60));
        let mut sums = ToneSums::default();
        sums.add(&skin(60), &known);
        assert_eq!(sums.shares()[0], Some(1.0));
        assert_eq!(ToneSums::default().shares(), [None, None]);
        let mut sums = ToneSums::default();
        sums.add(&skin(60), &Tones::default());
        assert_eq!(sums.shares(), [None, None], "nothing to compare with");
    }
}

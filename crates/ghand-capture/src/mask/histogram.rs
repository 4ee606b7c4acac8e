//! How often colours occur.

/// Bins of lightness (the mean of red, green and blue), of red less green and of yellow less blue, and their widths. Light
/// and shade move skin along lightness, whose bins are therefore wide.
const BINS: [usize; 3] = [16, 64, 64];
const WIDTHS: [i32; 3] = [16, 8, 8];
/// Times that the counts are blurred along each axis by 1, 2, 1.
const BLURS: usize = 2;
/// Colours in all.
const COLORS: f64 = 256.0 * 256.0 * 256.0;

/// Counts of colours.
#[derive(Debug, Clone)]
pub(super) struct Histogram {
    counts: Vec<f32>,
    total: f64,
}

impl Histogram {
    /// Of nothing: all colours are alike.
    pub fn new() -> Histogram {
        Histogram { counts: vec![0.0; BINS.iter().product()], total: 0.0 }
    }

    /// Counts a colour.
    pub fn add(&mut self, rgb: [u8; 3]) {
        self.counts[bin(rgb)] += 1.0;
        self.total += 1.0;
    }

    /// The mean of two distributions; one without any colour does not count.
    pub fn mixed(&self, other: &Histogram) -> Histogram {
        let part = |h: &Histogram| if h.total > 0.0 { 1.0 / h.total as f32 } else { 0.0 };
        let [a, b] = [part(self), part(other)];
        let counts = self.counts.iter().zip(&other.counts).map(|(x, y)| a * x + b * y).collect();
        Histogram { counts, total: f64::from(u8::from(a > 0.0)) + f64::from(u8::from(b > 0.0)) }
    }

    /// The same with neighbouring colours counting for each other.
    pub fn smoothed(mut self) -> Histogram {
        let strides = [BINS[1] * BINS[2], BINS[2], 1];
        for (axis, stride) in strides.into_iter().enumerate().flat_map(|pair| [pair; BLURS]) {
            let old = self.counts.clone();
            for (i, value) in self.counts.iter_mut().enumerate() {
                let place = i / stride % BINS[axis];
                // At the ends a colour counts for itself instead of for one that does not exist.
                let below = old[if place > 0 { i - stride } else { i }];
                let above = old[if place + 1 < BINS[axis] { i + stride } else { i }];
                *value = 0.25 * (below + above) + 0.5 * old[i];
            }
        }
        self
    }

    /// Probability of a colour among the 2^24, if `even` of the colours are distributed evenly: no colour is impossible.
    pub fn probability(&self, rgb: [u8; 3], even: f64) -> f64 {
        if self.total == 0.0 {
            return 1.0 / COLORS;
        }
        // The axes have a determinant of 1: a bin has as many colours as its widths say.
        let colors = f64::from(WIDTHS.iter().product::<i32>());
        even / COLORS + (1.0 - even) * f64::from(self.counts[bin(rgb)]) / (self.total * colors)
    }
}

fn bin(rgb: [u8; 3]) -> usize {
    let [r, g, b] = rgb.map(i32::from);
    let axes = [(r + g + b) / 3, r - g + 256, (r + g) / 2 - b + 256];
    (0..3).fold(0, |index, k| index * BINS[k] + ((axes[k] / WIDTHS[k]) as usize).min(BINS[k] - 1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn probabilities_sum_to_one_and_are_highest_near_what_was_counted() {
        let mut counted = Histogram::new();
        assert_eq!(counted.probability([1, 2, 3], 0.1), 1.0 / COLORS);
        (0..100).for_each(|k| counted.add([200, 150 + k / 10, 120]));
        let smooth = counted.smoothed();
        assert!((smooth.total - f64::from(smooth.counts.iter().sum::<f32>())).abs() < 1e-2);
        let [near, beside, far] =
            [[201, 154, 119], [208, 148, 122], [60, 80, 200]].map(|c| smooth.probability(c, 0.01));
        assert!(near > beside && beside > 20.0 * far && far > 0.0, "{near} {beside} {far}");
        let mut other = Histogram::new();
        other.add([60, 80, 200]);
        let both = smooth.mixed(&other);
        assert!(both.probability([60, 80, 200], 0.01) > 100.0 * far && both.probability([201, 154, 119], 0.01) < near);
    }
}

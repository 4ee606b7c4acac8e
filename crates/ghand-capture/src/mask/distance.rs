//! Exact Euclidean distances in an image.

/// Squared distances to the nearest pixel of value 0, along columns and then rows (Felzenszwalb and Huttenlocher, Distance
/// Transforms of Sampled Functions, 2012). `values` are 0 or infinite, row-major.
pub fn squared_distances(mut values: Vec<f64>, [columns, rows]: [usize; 2]) -> Vec<f64> {
    // Along columns: a pixel farther than the neighbour above, then than the one below.
    for y in 1..rows {
        let (above, row) = values[(y - 1) * columns..].split_at_mut(columns);
        row.iter_mut().zip(above).for_each(|(value, above)| *value = value.min(*above + 1.0));
    }
    for y in (1..rows).rev() {
        let (row, below) = values[(y - 1) * columns..].split_at_mut(columns);
        row.iter_mut().zip(below).for_each(|(value, below)| *value = value.min(*below + 1.0));
    }
    values.iter_mut().for_each(|value| *value *= *value);
    let mut envelope = Envelope::default();
    for row in values.chunks_exact_mut(columns) {
        let line = row.to_vec();
        envelope.lower(&line, |x, d| row[x] = d);
    }
    values
}

/// The depth of each pixel's centre below the outline of a mask, row-major, pixels: 0.5 next to the outline, infinite
/// if the mask covers the picture. Not positive outside the mask.
pub fn depths(is_inside: impl Iterator<Item = bool>, [width, height]: [u32; 2]) -> Vec<f64> {
    let start = is_inside.map(|inside| if inside { f64::INFINITY } else { 0.0 }).collect();
    // The outline runs half a pixel from the centre of the nearest pixel outside.
    squared_distances(start, [width as usize, height as usize])
        .into_iter()
        .map(|squared| squared.sqrt() - 0.5)
        .collect()
}

/// The lower envelope of parabolas.
#[derive(Default)]
struct Envelope {
    /// Each parabola's place and the place from which it is the lowest.
    parabolas: Vec<(usize, f64)>,
}

impl Envelope {
    /// Calls `set` with each place and the least of (place - q)^2 + line[q].
    fn lower(&mut self, line: &[f64], mut set: impl FnMut(usize, f64)) {
        self.parabolas.clear();
        for (q, value) in line.iter().enumerate().filter(|(_, value)| value.is_finite()) {
            let height = value + (q * q) as f64;
            let mut from = f64::NEG_INFINITY;
            while let Some(&(p, start)) = self.parabolas.last() {
                from = (height - line[p] - (p * p) as f64) / (2 * (q - p)) as f64;
                if from > start {
                    break;
                }
                self.parabolas.pop();
                from = f64::NEG_INFINITY;
            }
            self.parabolas.push((q, from));
        }
        let mut k = 0;
        for x in 0..line.len() {
            while self.parabolas.get(k + 1).is_some_and(|(_, from)| *from < x as f64) {
                k += 1;
            }
            let distance =
                self.parabolas.get(k).map_or(f64::INFINITY, |(p, _)| (x as f64 - *p as f64).powi(2) + line[*p]);
            set(x, distance);
        }
    }
}

//! How the board moves: it turns and moves as fast for all cameras, wherever these are, so that this tells by how much
//! their clocks may differ.

use ghand_capture::cameras::rigid::Rigid;
use glam::DVec3;

use super::track::Track;

/// Samples of a signal per second.
const RATE: f64 = 60.0;
/// Over this time speeds are measured, seconds.
const SPAN: f64 = 0.1;
/// Clocks are compared over at least this time, seconds.
const LEAST_OVERLAP: f64 = 1.5;
/// Clocks differ by at most this, seconds.
const MOST_OFFSET: f64 = 60.0;
/// Movements that agree by less (correlation) do not tell the time.
const LEAST_AGREEMENT: f64 = 0.4;
/// Differences of clocks that are proposed at most: people move a board in much the same way again and again.
const MOST_PROPOSALS: usize = 12;
/// A speed of the board in metres per second counts as so many radians per second.
const RADIANS_PER_METRE: f64 = 4.0;

/// How the board moves, in equal steps of time: how fast it turns and moves.
pub(super) struct Signal {
    start: f64,
    samples: Vec<Option<[f64; 2]>>,
}

impl Signal {
    /// From the board's pose in each image of a track, where there is one; `middle` is the board's.
    pub(super) fn of(track: &Track, poses: &[Option<Rigid>], middle: DVec3) -> Signal {
        let start = track.times.first().copied().unwrap_or(0.0);
        let end = track.times.last().copied().unwrap_or(0.0);
        let count = ((end - start) * RATE) as usize + 1;
        let sample = |k: usize| {
            let time = start + k as f64 / RATE;
            let [before, after] = [time - 0.5 * SPAN, time + 0.5 * SPAN].map(|time| nearest(track, time));
            let [before, after] = [before?, after?];
            if after <= before || !(before..after).all(|k| track.is_followed(k)) {
                return None;
            }
            let (a, b) = (poses.get(before)?.as_ref()?, poses.get(after)?.as_ref()?);
            let elapsed = track.times[after] - track.times[before];
            let moved = a.apply(middle).distance(b.apply(middle));
            Some([a.angle(b) / elapsed, RADIANS_PER_METRE * moved / elapsed])
        };
        Signal { start, samples: (0..count).map(sample).collect() }
    }

    /// What may have to be added to this signal's time to have the other one's, seconds: where their movements agree best.
    pub(super) fn offsets_to(&self, other: &Signal) -> Vec<f64> {
        let most = (MOST_OFFSET * RATE) as i64;
        let same_time = ((self.start - other.start) * RATE) as i64;
        let lags = same_time - most..=same_time + most;
        let found: Vec<(i64, f64)> = lags.filter_map(|lag| Some((lag, self.agreement(other, lag)?))).collect();
        let near = |k: usize, by: isize| {
            let lag = found[k].0 + by as i64;
            let other = k.checked_add_signed(by).and_then(|k| found.get(k));
            other.filter(|(other, _)| *other == lag).map_or(f64::NEG_INFINITY, |(_, value)| *value)
        };
        let is_peak =
            |k: &usize| found[*k].1 >= LEAST_AGREEMENT && found[*k].1 > near(*k, -1) && found[*k].1 >= near(*k, 1);
        let mut peaks: Vec<usize> = (0..found.len()).filter(is_peak).collect();
        peaks.sort_by(|a, b| found[*b].1.total_cmp(&found[*a].1));
        peaks.truncate(MOST_PROPOSALS);
        let seconds = |k: usize| {
            let curvature = near(k, -1) - 2.0 * found[k].1 + near(k, 1);
            let part = 0.5 * (near(k, -1) - near(k, 1)) / curvature;
            let part = if part.is_finite() { part.clamp(-0.5, 0.5) } else { 0.0 };
            other.start - self.start + (found[k].0 as f64 + part) / RATE
        };
        peaks.into_iter().map(seconds).collect()
    }

    /// The correlation if sample i of this signal is sample i + lag of the other one.
    fn agreement(&self, other: &Signal, lag: i64) -> Option<f64> {
        let pairs: Vec<(&[f64; 2], &[f64; 2])> = (self.samples.iter().enumerate())
            .filter_map(|(i, sample)| {
                let j = usize::try_from(i as i64 + lag).ok()?;
                Some((sample.as_ref()?, other.samples.get(j)?.as_ref()?))
            })
            .collect();
        if (pairs.len() as f64) < LEAST_OVERLAP * RATE {
            return None;
        }
        let count = pairs.len() as f64;
        let (mut covariance, mut first, mut second) = (0.0, 0.0, 0.0);
        for k in 0..2 {
            let (x, y) = pairs.iter().fold((0.0, 0.0), |sum, (x, y)| (sum.0 + x[k] / count, sum.1 + y[k] / count));
            for (a, b) in &pairs {
                covariance += (a[k] - x) * (b[k] - y);
                first += (a[k] - x).powi(2);
                second += (b[k] - y).powi(2);
            }
        }
        (first > 0.0 && second > 0.0).then(|| covariance / (first * second).sqrt())
    }
}

/// The image whose time is nearest; `None` beyond half the span.
fn nearest(track: &Track, time: f64) -> Option<usize> {
    let after = track.times.partition_point(|t| *t < time);
    let off = |k: &usize| (track.times[*k] - time).abs();
    let near = [after.checked_sub(1), Some(after).filter(|k| *k < track.times.len())];
    let nearest = near.into_iter().flatten().min_by(|a, b| off(a).total_cmp(&off(b)))?;
    (off(&nearest) <= 0.5 * SPAN).then_some(nearest)
}

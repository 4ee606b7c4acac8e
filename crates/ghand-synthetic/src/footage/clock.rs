//! When each camera takes its frames. Times are seconds on the clock of the first camera, at the middle of exposures.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{FootageOptions, OTHER_RATE, RATE};
use crate::normal::truncated_normal;

/// Largest time before or after the first camera's start at which others start: four frames.
const LARGEST_OFFSET: f64 = 0.13;

/// The clock of one camera.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Clock {
    /// When it starts.
    pub start: f64,
    /// Frames per second of its own time.
    pub rate: f64,
    /// The part by which its seconds are longer.
    pub drift: f64,
    /// Numbers of the frames that it loses, ascending, not the first.
    pub lost: Vec<usize>,
    /// Numbers of the others.
    kept: Vec<usize>,
}

impl Clock {
    /// The clocks of all cameras.
    pub(crate) fn all(options: &FootageOptions) -> Vec<Clock> {
        (0..options.views).map(|camera| Clock::of(options, camera)).collect()
    }

    fn of(options: &FootageOptions, camera: usize) -> Clock {
        let mut rng = ChaCha8Rng::seed_from_u64(options.seed ^ 0xC10C ^ ((camera as u64) << 32));
        // The first camera's clock is the others' measure.
        let of_others = |value: f64| if camera == 0 { 0.0 } else { value };
        let start = of_others(LARGEST_OFFSET * (2.0 * rng.random::<f64>() - 1.0));
        let drift = of_others(options.clock_drift * truncated_normal(&mut rng));
        let rate = if options.mixed_rates && camera % 3 == 1 { OTHER_RATE } else { RATE };
        let count = (options.seconds * rate).floor().max(1.0) as usize;
        let (lost, kept) = (0..count).partition(|&frame| {
            let drawn = rng.random::<f64>();
            frame > 0 && drawn < options.lost_frames
        });
        Clock { start, rate, drift, lost, kept }
    }

    /// Number of frames in the video.
    pub(crate) fn frames(&self) -> usize {
        self.kept.len()
    }

    /// When a frame of the video was taken, lost ones not counted.
    pub(crate) fn time(&self, frame: usize) -> f64 {
        self.at(self.kept.get(frame).copied().unwrap_or(0))
    }

    /// When all frames were taken or should have been, also lost ones.
    pub(crate) fn all_times(&self) -> impl Iterator<Item = f64> {
        (0..self.kept.len() + self.lost.len()).map(|frame| self.at(frame))
    }

    fn at(&self, frame: usize) -> f64 {
        self.start + frame as f64 / self.rate * (1.0 + self.drift)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clocks_start_tick_and_lose_frames_as_told() {
        let options =
            FootageOptions { views: 6, seconds: 20.0, mixed_rates: true, lost_frames: 0.1, ..Default::default() };
        let clocks = Clock::all(&FootageOptions { clock_drift: 0.001, ..options.clone() });
        assert_eq!(clocks.iter().map(|clock| clock.rate).collect::<Vec<_>>(), [30.0, 25.0, 30.0, 30.0, 25.0, 30.0]);
        assert!(clocks[0].start == 0.0 && clocks[0].drift == 0.0);
        for clock in &clocks[1..] {
            assert!(clock.start != 0.0 && clock.start.abs() <= LARGEST_OFFSET);
            assert!(clock.drift != 0.0 && clock.drift.abs() <= 0.002);
            let count = (20.0 * clock.rate) as usize;
            assert_eq!(clock.frames() + clock.lost.len(), count);
            assert!((0.06..0.14).contains(&(clock.lost.len() as f64 / count as f64)), "{}", clock.lost.len());
            // Frames after the first gap are later by it.
            let first = clock.lost[0];
            let step = (1.0 + clock.drift) / clock.rate;
            assert!((clock.time(first - 1) - clock.start - (first - 1) as f64 * step).abs() < 1e-12);
            assert!(clock.time(first) - clock.time(first - 1) > 1.5 * step);
        }
        assert!(Clock::all(&options).iter().all(|clock| clock.drift == 0.0));
    }
}

//! Events per second.

use std::time::{Duration, Instant};

/// Time over which events are counted.
const WINDOW: Duration = Duration::from_secs(1);

/// Counts events and knows their rate over the last second or two.
#[derive(Debug, Clone)]
pub struct Rate {
    total: u64,
    /// The count and the time at the beginning of the present window.
    begin: (u64, Instant),
    per_second: f64,
}

impl Rate {
    /// No events so far.
    pub fn new(now: Instant) -> Rate {
        Rate { total: 0, begin: (0, now), per_second: 0.0 }
    }

    /// Counts one event.
    pub fn add(&mut self) {
        self.total += 1;
    }

    /// There were so many events so far.
    pub fn count(&mut self, total: u64) {
        self.total = total;
    }

    /// Whether the rate is not zero, or will not be.
    pub fn is_moving(&self) -> bool {
        self.per_second > 0.0 || self.total > self.begin.0
    }

    /// The rate.
    pub fn per_second(&mut self, now: Instant) -> f64 {
        let (count, since) = self.begin;
        let passed = now.saturating_duration_since(since);
        if passed >= WINDOW {
            self.per_second = (self.total - count) as f64 / passed.as_secs_f64();
            self.begin = (self.total, now);
        }
        self.per_second
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rate_follows_the_events_and_falls_to_zero() {
        let start = Instant::now();
        let at = |ms: u64| start + Duration::from_millis(ms);
        let mut rate = Rate::new(start);
        assert!(!rate.is_moving());
        (0..30).for_each(|_| rate.add());
        assert_eq!(rate.per_second(at(500)), 0.0);
        assert_eq!(rate.per_second(at(1000)), 30.0);
        rate.count(90);
        assert_eq!((rate.per_second(at(2500)), rate.is_moving()), (40.0, true));
        assert_eq!((rate.per_second(at(3500)), rate.is_moving()), (0.0, false));
    }
}

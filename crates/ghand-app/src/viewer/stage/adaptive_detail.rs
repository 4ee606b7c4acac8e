//! Fewer pixels while the picture changes, if the device is too slow for all of them; all once it rests.

/// Pictures that change should take at most this long, milliseconds: 30 per second.
const TARGET_MS: f64 = 1000.0 / 30.0;
/// Edges of a changing picture as fractions of the whole: few steps, because each change of size makes a new texture.
const SCALES: [f32; 5] = [1.0, 0.75, 0.5, 0.35, 0.25];
/// A picture that was slower or faster than the target by these factors changes the step.
const TOO_SLOW: f64 = 1.25;
const FAST_ENOUGH: f64 = 0.8;
/// Two changes within this time are a movement, and after as long without a change it has ended, seconds. A slow picture
/// takes its own time in addition.
const REST_SECS: f64 = 0.25;

/// How many pixels the picture has.
#[derive(Debug, Clone, Default)]
pub struct AdaptiveDetail {
    /// Index of the scale of changing pictures.
    step: usize,
    changed: Option<f64>,
    is_moving: bool,
    /// Time of the last picture, seconds.
    picture_secs: f64,
}

impl AdaptiveDetail {
    /// Another picture is wanted, at this time of the user interface, seconds.
    pub fn changed(&mut self, now: f64) {
        self.is_moving = self.changed.replace(now).is_some_and(|last| now - last < self.rest_secs());
    }

    /// The same picture is wanted. Returns after how many seconds a movement will have ended, if there is one.
    pub fn same(&mut self, now: f64) -> Option<f64> {
        let left = self.changed.filter(|_| self.is_moving).map(|last| last + self.rest_secs() - now)?;
        self.is_moving = left > 0.0;
        self.is_moving.then_some(left)
    }

    /// Edge of the picture as a fraction of the whole.
    pub fn scale(&self) -> f32 {
        if self.is_moving { SCALES.get(self.step).copied().unwrap_or(1.0) } else { 1.0 }
    }

    /// A picture at this scale took this long.
    pub fn took(&mut self, scale: f32, ms: f64) {
        self.picture_secs = 1e-3 * ms;
        if SCALES.get(self.step) != Some(&scale) {
            // At rest, the time says at which scale a movement should begin.
            if scale == 1.0 && !self.is_moving {
                let fits = |step: &f32| ms * f64::from(step * step) <= TARGET_MS;
                self.step = SCALES.iter().position(fits).unwrap_or(SCALES.len() - 1);
            }
            return;
        }
        if ms > TOO_SLOW * TARGET_MS {
            self.step = (self.step + 1).min(SCALES.len() - 1);
        } else if let Some(larger) = self.step.checked_sub(1).and_then(|step| SCALES.get(step)) {
            // Most of the time goes into pixels.
            if ms * f64::from((larger / scale).powi(2)) < FAST_ENOUGH * TARGET_MS {
                self.step -= 1;
            }
        }
    }

    fn rest_secs(&self) -> f64 {
        REST_SECS + 1.5 * self.picture_secs
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Moves for some frames on a device that needs `ms` for a whole picture. Returns the scales.
    fn moved(detail: &mut AdaptiveDetail, start: f64, ms: f64, frames: usize) -> Vec<f32> {
        let mut now = start;
        (0..frames)
            .map(|_| {
                detail.changed(now);
                let scale = detail.scale();
                let took = 2.0 + ms * f64::from(scale * scale);
                detail.took(scale, took);
                now += 1e-3 * took + 0.01;
                scale
            })
            .collect()
    }

    #[test]
    fn a_slow_device_draws_fewer_pixels_in_motion_and_all_at_rest() {
        let mut detail = AdaptiveDetail::default();
        let scales = moved(&mut detail, 0.0, 200.0, 20);
        assert_eq!(scales[0], 1.0, "a single change is drawn whole");
        assert_eq!(scales[19], 0.35);
        assert!(scales[10..].windows(2).all(|pair| pair[0] == pair[1]), "{scales:?}");
        let end = 100.0;
        detail.changed(end);
        assert_eq!(detail.scale(), 1.0, "after a pause it is a single change again");
        moved(&mut detail, end, 200.0, 5);
        assert!(detail.scale() < 1.0 && detail.same(end + 0.2).is_some());
        assert_eq!((detail.same(end + 30.0), detail.scale()), (None, 1.0));
    }

    #[test]
    fn a_fast_device_always_draws_all_pixels() {
        let mut detail = AdaptiveDetail::default();
        assert!(moved(&mut detail, 0.0, 12.0, 50).iter().all(|scale| *scale == 1.0));
        // When another avatar is faster, the pixels come back.
        moved(&mut detail, 100.0, 500.0, 20);
        assert_eq!(moved(&mut detail, 200.0, 5.0, 20)[19], 1.0);
    }

    #[test]
    fn pictures_at_rest_say_where_a_movement_begins() {
        let mut detail = AdaptiveDetail::default();
        detail.changed(0.0);
        detail.took(1.0, 130.0);
        detail.changed(0.2);
        assert_eq!(detail.scale(), 0.75, "one step is learned from a picture at this very scale");
    }
}

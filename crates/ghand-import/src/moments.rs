//! What all cameras saw at the same moments: tracks by their clocks, without the distortion of the lenses.

use ghand_capture::cameras::list::LensCamera;
use glam::DVec2;

use crate::rig::{LANDMARKS, Moment, View};
use crate::track::Track;

/// Sightings further apart than this many frames are not interpolated.
const GAP: f64 = 2.5;

/// What the cameras saw at times of the first camera's clock, if camera k's clock shows `offsets[k]` seconds more.
pub fn moments(tracks: &[Track], lenses: &[LensCamera], offsets: &[f64], times: &[f64]) -> Vec<Moment> {
    let steps: Vec<f64> = tracks.iter().map(|track| GAP / track.rate()).collect();
    let at = |time: &f64| {
        let cameras = tracks.iter().zip(lenses).zip(offsets.iter().zip(&steps));
        cameras.map(|((track, lens), (offset, gap))| view_at(track, lens, time + offset, *gap)).collect()
    };
    times.iter().map(at).collect()
}

/// What a camera saw at a time of its own clock, seconds.
fn view_at(track: &Track, lens: &LensCamera, time: f64, gap: f64) -> Option<View> {
    let after = track.times.partition_point(|t| *t < time);
    // An exact hit may miss by rounding.
    let exact = |k: usize| track.times.get(k).is_some_and(|t| (t - time).abs() < 1e-6);
    let before = if exact(after) { after } else { after.checked_sub(1)? };
    let before = if exact(before) { before } else { (0..=before).rev().find(|k| track.sightings[*k].is_some())? };
    let after =
        if exact(before) { before } else { (after..track.times.len()).find(|k| track.sightings[*k].is_some())? };
    let (a, b) = (track.sightings.get(before)?.as_ref()?, track.sightings.get(after)?.as_ref()?);
    let step = track.times[after] - track.times[before];
    if step > gap {
        return None;
    }
    let part = if step > 0.0 { (time - track.times[before]) / step } else { 0.0 };
    let pixels: Option<Vec<DVec2>> =
        (a.pixels.iter().zip(&b.pixels)).map(|(a, b)| lens.undistorted(a.lerp(*b, part))).collect();
    let [from, to] = neighbours(track, before, after);
    let elapsed = track.times[to] - track.times[from];
    let velocities = match (&track.sightings[from], &track.sightings[to]) {
        (Some(a), Some(b)) if elapsed > 0.0 && elapsed <= 3.0 * gap => {
            std::array::from_fn(|k| (b.pixels[k] - a.pixels[k]) / elapsed)
        }
        _ => [DVec2::ZERO; LANDMARKS],
    };
    Some(View {
        pixels: pixels?.try_into().ok()?,
        velocities,
        world: std::array::from_fn(|k| a.world[k].lerp(b.world[k], part)),
    })
}

/// The frames before and after those that a view is interpolated from, if the hand was found in them: their errors have
/// nothing to do with the view's own, so that velocities do not follow these.
fn neighbours(track: &Track, before: usize, after: usize) -> [usize; 2] {
    let found = |k: usize| track.sightings.get(k).is_some_and(Option::is_some);
    let from = if before > 0 && found(before - 1) { before - 1 } else { before };
    let to = if found(after + 1) { after + 1 } else { after };
    [from, to]
}

//! The frames that a capture can be made of, each with what its choice depends on.

use ghand_capture::cameras::list::LensCamera;
use ghand_core::HandModel;
use ghand_motion::RestSkeleton;
use ghand_motion::ik::HandIk;
use glam::DVec2;

use crate::ImportError;
use crate::apart::{MOST_OVERLAP, overlap};
use crate::choice::Candidate;
use crate::hand::Hand;
use crate::track::Track;

/// Landmarks may be this far outside of an image, relative to its width, where the hand touches its border.
const BORDER: f64 = 0.005;
/// Images are taken at most this long before or after the moment that they stand for, in frames.
const MOST_OFF: f64 = 0.75;
/// Landmarks of another hand that are farther away, relative to the hand's length, are beyond where masks are searched.
const CLEAR: f64 = 0.15;

/// All frames with a pose, with their numbers: those of the first camera.
///
/// # Errors
/// If the names of the model's joints do not identify their parts.
pub fn candidates(
    tracks: &[Track],
    lenses: &[LensCamera],
    offsets: &[f64],
    model: &HandModel,
    hand: &Hand,
) -> Result<Vec<(usize, Candidate)>, ImportError> {
    let ik = HandIk::new(&RestSkeleton::of(model)?);
    let sharpest: Vec<f64> = tracks.iter().map(sharp_tenth).collect();
    let mut found = vec![];
    for residual in &hand.fit.frames {
        let Some(number) = residual.id.parse::<usize>().ok() else { continue };
        let Some(pose) = hand.poses.get(number).and_then(Option::as_ref) else { continue };
        let time = tracks[0].times[number];
        let mut candidate = Candidate {
            time,
            points: ik.landmarks(pose),
            error: 0.0,
            sharpness: f64::INFINITY,
            is_inside: true,
            is_alone: true,
            blur: 0.0,
            views: 0,
        };
        let mut spans = vec![];
        for (k, track) in tracks.iter().enumerate() {
            let Some(image) = image_at(track, time + offsets[k]) else { continue };
            let Some(sighting) = &track.sightings[image] else { continue };
            candidate.views += 1;
            candidate.sharpness = candidate.sharpness.min(sighting.sharpness / sharpest[k].max(1e-12));
            let camera = &lenses[k].camera;
            let size = DVec2::new(f64::from(camera.width), f64::from(camera.height));
            let border = BORDER * size.x;
            candidate.is_inside &=
                sighting.pixels.iter().all(|p| p.min_element() > -border && (size - *p).min_element() > -border);
            let middle = candidate.points[9];
            let span = camera.focal.x * hand.fit.lengths[1] / camera.camera_from_world(middle).z;
            spans.push(span);
            let size = [camera.width, camera.height].map(|edge| edge as usize);
            let is_clear = sighting.gap().is_none_or(|gap| gap > CLEAR * span);
            candidate.is_alone &= is_clear || overlap(sighting, size) < MOST_OVERLAP;
            candidate.blur = candidate.blur.max(moved(track, image, time + offsets[k]) / span);
        }
        let span = spans.iter().sum::<f64>() / spans.len().max(1) as f64;
        candidate.error = residual.distances.median / span;
        if candidate.views > 0 {
            found.push((number, candidate));
        }
    }
    Ok(found)
}

/// How many pixels the hand moves between the time of an image and another time of that camera's clock.
fn moved(track: &Track, image: usize, time: f64) -> f64 {
    let gap = (time - track.times[image]).abs();
    let near = |k: Option<usize>| k.and_then(|k| Some((track.times.get(k)?, track.sightings.get(k)?.as_ref()?)));
    let (Some((at, here)), Some((then, there))) =
        (near(Some(image)), near(image.checked_sub(1)).or_else(|| near(Some(image + 1))))
    else {
        return 0.0;
    };
    let way =
        here.pixels.iter().zip(&there.pixels).map(|(a, b)| a.distance(*b)).sum::<f64>() / here.pixels.len() as f64;
    way / (at - then).abs().max(1e-6) * gap
}

/// The sharpness that one image in ten exceeds.
pub fn sharp_tenth(track: &Track) -> f64 {
    let mut values: Vec<f64> = track.sightings.iter().flatten().map(|sighting| sighting.sharpness).collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len() * 9 / 10).copied().unwrap_or(0.0)
}

/// The image nearest to a time of its camera's clock, if it shows the hand and was not taken long before or after.
pub fn image_at(track: &Track, time: f64) -> Option<usize> {
    let after = track.times.partition_point(|t| *t < time).min(track.times.len().checked_sub(1)?);
    let before = after.saturating_sub(1);
    let off = |k: usize| (track.times[k] - time).abs();
    let nearest = if off(before) < off(after) { before } else { after };
    let is_seen = track.sightings.get(nearest).is_some_and(Option::is_some);
    (is_seen && off(nearest) < MOST_OFF / track.rate()).then_some(nearest)
}

//! How much light skin throws on skin: the parts with which frames are explained best, channel by channel.

use ghand_avatar::light::MOST_INTERREFLECTION;
use rayon::prelude::*;

use super::least_squares::{FrameColors, Unknowns, fit_channel, squared_error_of};

/// Number of parts compared, evenly from 0 to the most that skin throws back.
const COMPARED: usize = 6;

/// The part of each channel, RGB: between those compared, where a parabola through the best three is least.
pub(super) fn find(unknowns: &Unknowns, frames: &[&FrameColors], texels: usize) -> [f64; 3] {
    let part = |channel: usize, i: usize| f64::from(MOST_INTERREFLECTION[channel]) * i as f64 / (COMPARED - 1) as f64;
    let tried: Vec<(usize, usize)> = (0..3).flat_map(|channel| (0..COMPARED).map(move |i| (channel, i))).collect();
    let error = |(channel, i): &(usize, usize)| {
        squared_error_of(frames, &fit_channel(unknowns, frames, texels, *channel, part(*channel, *i)), *channel)
    };
    let errors: Vec<f64> = tried.par_iter().map(error).collect();
    [0, 1, 2].map(|channel| {
        let errors = &errors[channel * COMPARED..(channel + 1) * COMPARED];
        let best = (0..COMPARED).min_by(|a, b| errors[*a].total_cmp(&errors[*b])).unwrap_or(0);
        let [before, after] = [best.checked_sub(1), Some(best + 1)].map(|i| i.and_then(|i| errors.get(i)));
        let (Some(before), Some(after)) = (before, after) else { return part(channel, best) };
        let bend = before - 2.0 * errors[best] + after;
        let shift = if bend > 0.0 { 0.5 * (before - after) / bend } else { 0.0 };
        part(channel, best) + shift * part(channel, 1)
    })
}

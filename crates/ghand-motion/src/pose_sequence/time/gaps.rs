//! Gives frames their places: what was not seen is interpolated, or held where the recording begins and ends.

use super::timeline::{Timeline, around_number};
use crate::pose_sequence::{MOST_FRAMES, PoseFrame, between};

/// A longer pause than this is no gap in one motion, seconds: the recording was interrupted.
const LONGEST_GAP: f64 = 60.0;
/// Most gaps that a message names.
const NAMED_GAPS: usize = 3;

/// Frames at a constant rate, as long as the recording, and remarks about what is filled.
pub(crate) fn filled(
    frames: Vec<PoseFrame>,
    skipped: &[String],
    timeline: &Timeline,
    fps: f64,
) -> (Vec<PoseFrame>, Vec<String>) {
    let place = |id: &str| timeline.place(id);
    let placed: Option<Vec<f64>> = frames.iter().map(|frame| place(&frame.id)).collect();
    let Some(places) = placed.filter(|places| !places.is_empty()) else { return (frames, vec![]) };
    let mut placed: Vec<(f64, PoseFrame)> = places.into_iter().zip(frames).collect();
    placed.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (places, frames): (Vec<f64>, Vec<PoseFrame>) = placed.into_iter().unzip();
    let others = skipped.iter().filter_map(|id| Some((place(id)?, id.as_str())));
    let all = timeline.places.values().copied().chain(others.clone().map(|(place, _)| place));
    let (mut first, mut last) = (places[0], places[places.len() - 1]);
    for place in all {
        (first, last) = (first.min(place), last.max(place));
    }
    let names = others.map(|(place, id)| (place.round() as i64, id.to_owned()));
    let names = timeline.places.iter().map(|(id, place)| (place.round() as i64, id.clone())).chain(names).collect();
    let fill = Fill { frames, places, names, fps };
    if timeline.is_uneven { fill.resampled(first, last) } else { fill.with_gaps_filled(first, last) }
}

struct Fill {
    frames: Vec<PoseFrame>,
    /// Rising.
    places: Vec<f64>,
    /// Ids of frames by their places.
    names: std::collections::HashMap<i64, String>,
    fps: f64,
}

impl Fill {
    /// Interpolates everything at whole places.
    fn resampled(&self, first: f64, last: f64) -> (Vec<PoseFrame>, Vec<String>) {
        let count = (last - first).floor() as usize + 1;
        if count > MOST_FRAMES {
            let text =
                format!("at that rate, there were {count} frames, more than {MOST_FRAMES}: they stay as they are");
            return (self.frames.clone(), vec![text]);
        }
        let frame = |k: usize| {
            let at = first + k as f64;
            let after = self.places.partition_point(|place| *place < at).min(self.places.len() - 1);
            let before = after.saturating_sub(usize::from(self.places[after] > at));
            let found = self.interpolated(before, after, at);
            PoseFrame { id: format!("{k:04}"), ..found }
        };
        ((0..count).map(frame).collect(), vec!["the frames are interpolated at a constant rate".into()])
    }

    fn interpolated(&self, before: usize, after: usize, at: f64) -> PoseFrame {
        let (from, to) = (&self.frames[before], &self.frames[after]);
        let length = self.places[after] - self.places[before];
        let part = if length > 0.0 { ((at - self.places[before]) / length).clamp(0.0, 1.0) } else { 0.0 };
        PoseFrame { id: String::new(), pose: between(&from.pose, &to.pose, part), shape: from.shape.clone() }
    }

    fn with_gaps_filled(&self, first: f64, last: f64) -> (Vec<PoseFrame>, Vec<String>) {
        let mut found: Vec<PoseFrame> = vec![];
        let mut gaps = vec![];
        let mut warnings = vec![];
        let count_of = |length: f64| (length.round() as usize).saturating_sub(1);
        let longest = LONGEST_GAP * self.fps;
        let Some((start, end)) = self.frames.first().zip(self.frames.last()) else { return (found, warnings) };
        let held = |frame: &PoseFrame, id: String| PoseFrame { id, ..frame.clone() };
        let lead = count_of(self.places[0] - first + 1.0);
        if lead as f64 > longest {
            warnings.push(self.pause_text(lead, "before", &start.id));
        } else if lead > 0 {
            found.extend((0..lead).map(|k| held(start, self.name(first + k as f64, None, k))));
            warnings.push(held_text("first", lead, &start.id));
        }
        for k in 0..self.frames.len() {
            if let Some(before) = k.checked_sub(1) {
                let count = count_of(self.places[k] - self.places[before]);
                if count as f64 > longest || found.len() + count >= MOST_FRAMES {
                    warnings.push(self.pause_text(count, "after", &self.frames[before].id));
                } else if count > 0 {
                    gaps.push((count, &self.frames[before].id, &self.frames[k].id));
                    for n in 1..=count {
                        let at = self.places[before] + n as f64;
                        let id = self.name(at, Some(before), n);
                        found.push(PoseFrame { id, ..self.interpolated(before, k, at) });
                    }
                }
            }
            found.push(self.frames[k].clone());
        }
        let rest = count_of(last - self.places[self.places.len() - 1] + 1.0);
        if rest as f64 > longest {
            warnings.push(self.pause_text(rest, "after", &end.id));
        } else if rest > 0 {
            let from = self.places[self.places.len() - 1];
            let before = Some(self.frames.len() - 1);
            found.extend((1..=rest).map(|n| held(end, self.name(from + n as f64, before, n))));
            warnings.push(held_text("last", rest, &end.id));
        }
        if !gaps.is_empty() {
            let total: usize = gaps.iter().map(|(count, ..)| count).sum();
            gaps.sort_by_key(|(count, ..)| std::cmp::Reverse(*count));
            let named: Vec<String> = gaps
                .iter()
                .take(NAMED_GAPS)
                .map(|(count, from, to)| {
                    format!("{count} between {from:?} and {to:?} ({:.2} s)", *count as f64 / self.fps)
                })
                .collect();
            let more = gaps.len().saturating_sub(NAMED_GAPS);
            let more = if more > 0 { format!(" and {more} more gaps") } else { String::new() };
            let (is, frames) = if total == 1 { ("is", "frame") } else { ("are", "frames") };
            warnings.push(format!("{total} {frames} without a pose {is} interpolated: {}{more}", named.join(", ")));
        }
        (found, warnings)
    }

    fn pause_text(&self, count: usize, side: &str, id: &str) -> String {
        format!("there is no pose for {:.0} s {side} frame {id:?}; that pause is left out", count as f64 / self.fps)
    }

    /// The id of a frame that is filled, `n` places after a known one: its own, else the number between its neighbours',
    /// else the known one's with the distance.
    fn name(&self, place: f64, before: Option<usize>, n: usize) -> String {
        if let Some(name) = self.names.get(&(place.round() as i64)) {
            return name.clone();
        }
        let known = before.map_or(&self.frames[0], |k| &self.frames[k]);
        let other =
            before.and_then(|k| self.frames.get(k + 1).map(|frame| (frame, self.places[k + 1] - self.places[k])));
        let numbered = || {
            let [prefix, digits, suffix] = around_number(&known.id)?;
            let (next, distance) = other?;
            let [next_prefix, next_digits, next_suffix] = around_number(&next.id)?;
            let [from, to]: [f64; 2] = [digits.parse().ok()?, next_digits.parse().ok()?];
            let step = (to - from) / distance;
            let number = from + n as f64 * step;
            let is_whole = step >= 1.0 && (number - number.round()).abs() < 1e-6;
            ((prefix, suffix) == (next_prefix, next_suffix) && is_whole)
                .then(|| format!("{prefix}{:0width$}{suffix}", number.round() as u64, width = digits.len()))
        };
        numbered().unwrap_or_else(|| format!("{}+{n}", known.id))
    }
}

fn held_text(which: &str, count: usize, id: &str) -> String {
    match count {
        1 => format!("the {which} frame has no pose and is held as frame {id:?}"),
        _ => format!("the {which} {count} frames have no pose and are held as frame {id:?}"),
    }
}

//! When each frame of a file is: by times, else by the numbers in the frames' ids, else by their order.
//!
//! A tracker that loses the hand leaves frames out, or writes empty ones. Each frame keeps its place, so that a film is as
//! long as the recording.

use std::collections::HashMap;

use ghand_files::value::Value;

use crate::pose_sequence::reading::source::{ID_NAMES, frames_of, own_id, shown, side_of};
use crate::pose_sequence::{DEFAULT_FPS, PoseError, Source};

const TIME_NAMES: [&str; 14] = [
    "time",
    "timestamp",
    "timestamp_ms",
    "timestampMs",
    "time_ms",
    "timestamp_us",
    "timestamp_ns",
    "t",
    "times",
    "timestamps",
    "timestamps_ms",
    "time_s",
    "seconds",
    "frame_times",
];
const RATE_NAMES: [&str; 8] = [
    "fps",
    "frame_rate",
    "frameRate",
    "framerate",
    "mocap_framerate",
    "mocap_frame_rate",
    "file_fps",
    "frames_per_second",
];
const NUMBER_NAMES: [&str; 6] = ["ids", "frame_ids", "frame_indices", "frame_idx", "frame_numbers", "frame_ids_used"];

/// Allowed rates of a file, frames per second: from one frame in a quarter of an hour to more than any camera records.
const FPS_RANGE: std::ops::RangeInclusive<f64> = 0.001..=10_000.0;
/// A rate and times that differ by more than this part contradict each other.
const RATE_TOLERANCE: f64 = 0.05;
/// Steps of time within this part of each other are the same: a mean of them would only have rounding errors.
const SAME_STEP: f64 = 1e-6;
/// One in this many frames per second is no difference between rates.
const FINEST_RATE: f64 = 1e6;
/// Frames further than this from the places of a constant rate are not recorded at one, in frames.
const LARGEST_JITTER: f64 = 0.5;

/// Places of the frames of a file.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Timeline {
    /// The rate that times give, frames per second.
    pub fps: Option<f64>,
    /// Place of each frame by its id, counted in frames from the first.
    pub places: HashMap<String, f64>,
    /// By how much the numbers of the frames rise from one to the next, if they are places.
    number_step: Option<f64>,
    /// Whether the places are not whole numbers: the rate is not constant.
    pub is_uneven: bool,
    /// Remarks for the user.
    pub warnings: Vec<String>,
}

/// A frame of a file, usable or not.
struct Slot {
    id: String,
    time: Option<f64>,
    number: Option<f64>,
}

impl Timeline {
    /// The places of a file's frames; none if it has only arrays without times.
    pub fn of(value: &Value) -> Timeline {
        let mut slots = slots(value);
        let mut timeline = Timeline::default();
        if slots.len() < 2 {
            return timeline;
        }
        let (times, unit) = times(&slots, time_name(value));
        let known = |values: &[Option<f64>]| values.iter().flatten().count() >= 2;
        let is_rising = |values: &[Option<f64>]| values.iter().flatten().is_sorted();
        let mut is_time = known(&times);
        if is_time && !is_rising(&times) {
            is_time = false;
            timeline.warnings.push("the times of the frames go back and are not used".into());
        }
        let mut numbers = numbers(&slots);
        if !is_time && known(&numbers) && !is_rising(&numbers) {
            slots.sort_by(|a, b| a.number.unwrap_or(f64::MAX).total_cmp(&b.number.unwrap_or(f64::MAX)));
            numbers = slots.iter().map(|slot| slot.number).collect();
            timeline.warnings.push("the frames are not in the order of their numbers, and are sorted".into());
        }
        let has_numbers = known(&numbers);
        let coordinates = if is_time {
            times
        } else if has_numbers {
            numbers
        } else {
            (0..slots.len()).map(|k| Some(k as f64)).collect()
        };
        let Some(Places { places, step, is_uneven }) = places(&coordinates) else { return timeline };
        if is_time {
            // Differences of times have rounding errors.
            let fps = (unit / step * FINEST_RATE).round() / FINEST_RATE;
            timeline.fps = Some(fps).filter(|fps| FPS_RANGE.contains(fps));
        }
        timeline.number_step = (!is_time && has_numbers).then_some(step);
        if is_uneven {
            let fps = timeline.fps.map_or(String::new(), |fps| format!(", {fps:.4} frames per second,"));
            timeline.warnings.push(format!("the frames are unevenly spaced; their mean rate{fps} is used"));
        }
        timeline.is_uneven = is_uneven;
        for (slot, place) in slots.into_iter().zip(places) {
            timeline.places.entry(slot.id).or_insert(place);
        }
        timeline
    }

    /// Place of a frame that has none, by its number, if the file has no places at all.
    pub fn place(&self, id: &str) -> Option<f64> {
        if self.places.is_empty() { id.parse().ok() } else { self.places.get(id).copied() }
    }

    /// The rate of the frames: that of the user, else the file's times, else its rate, else that of its kind. Times come
    /// first, because a file's rate is often that of the film and not of the frames that were kept.
    pub fn rate(
        &mut self,
        source: &Source,
        value: &Value,
        usual: Option<f64>,
        given: Option<f64>,
    ) -> Result<Option<f64>, PoseError> {
        let stated = stated_rate(source, value, &mut self.warnings)?;
        let own = match (stated, self.fps) {
            (Some(stated), Some(timed)) if (stated / timed - 1.0).abs() > RATE_TOLERANCE => {
                self.warnings.push(format!(
                    "the file says {stated} frames per second, but the times of its frames say {timed:.4}, which are used"
                ));
                Some(timed)
            }
            (stated, timed) => stated.or(timed),
        };
        if let (Some(stated), Some(step), None) = (stated, self.number_step.filter(|step| *step > 1.5), given) {
            self.warnings.push(format!(
                "the numbers of the frames rise by {step:.1}; {stated} frames per second are taken as the rate of the frames in the \
                 file; if it is that of the numbers, give --file-fps {:.4}",
                stated / step
            ));
        }
        if let (Some(given), Some(own)) = (given, own)
            && (given / own - 1.0).abs() > SAME_STEP
        {
            self.warnings
                .push(format!("the file says {own:.4} frames per second; {given} are used, as --file-fps says"));
        }
        Ok(given.or(own).or(usual))
    }
}

/// Whether a field gives a rate, a time or an id.
pub(crate) fn is_known(name: &str) -> bool {
    RATE_NAMES.contains(&name) || TIME_NAMES.contains(&name) || ID_NAMES.contains(&name)
}

/// The rate that a file states, for all frames or in each.
fn stated_rate(source: &Source, value: &Value, warnings: &mut Vec<String>) -> Result<Option<f64>, PoseError> {
    let named = |value: &Value| RATE_NAMES.iter().find_map(|name| Some((*name, value.get(name)?.clone())));
    let mut in_frames = |value: &Value| {
        let frames = frames_of(value)?;
        let first = frames.iter().find_map(named)?;
        if frames.iter().filter_map(named).any(|other| other.1 != first.1) {
            warnings.push("the frames state different rates; the first is used".into());
        }
        Some(first)
    };
    // A file may have all of a hand below its side.
    let hands = value.entries().iter().filter(|(name, _)| side_of(&Value::Text(name.clone())).is_some());
    let mut holders = std::iter::once(value).chain(hands.map(|(_, hand)| hand));
    let stated = holders.find_map(|holder| named(holder).or_else(|| in_frames(holder)));
    let Some((name, fps)) = stated else { return Ok(None) };
    match fps.number() {
        Some(fps) if FPS_RANGE.contains(&fps) => Ok(Some(fps)),
        _ if fps == Value::Nothing => Ok(None),
        _ => {
            let (low, high) = (FPS_RANGE.start(), FPS_RANGE.end());
            let problem = format!(
                "is {}; give frames per second from {low} to {high}, or omit it for {DEFAULT_FPS}; cameras and trackers \
                 are in this range",
                shown(&fps)
            );
            Err(source.invalid(name, problem))
        }
    }
}

fn time_of(frame: &Value) -> Option<f64> {
    let value = TIME_NAMES.iter().find_map(|name| frame.get(name))?;
    let time = value.number().or_else(|| value.text()?.trim().parse().ok());
    time.filter(|time: &f64| time.is_finite())
}

/// The name by which a file gives times, for its unit.
fn time_name(value: &Value) -> Option<&'static str> {
    let named = |value: &Value| TIME_NAMES.iter().copied().find(|name| value.get(name).is_some());
    named(value)
        .or_else(|| frames_of(value)?.iter().find_map(named))
        .or_else(|| value.entries().iter().find_map(|(_, frame)| named(frame)))
}

/// The frames of a file, usable or not, in its order.
fn slots(value: &Value) -> Vec<Slot> {
    if let Some(frames) = frames_of(value) {
        let slot = |(k, frame): (usize, &Value)| {
            let own = own_id(frame);
            let number = own.as_deref().and_then(number_in);
            Slot { time: time_of(frame), number, id: own.unwrap_or_else(|| format!("{k:04}")) }
        };
        return frames.iter().enumerate().map(slot).collect();
    }
    let top = value.get("frames").unwrap_or(value);
    let is_frame = |(name, frame): &(String, Value)| {
        number_in(name).is_some() && matches!(frame, Value::Map(_) | Value::List(_) | Value::Nothing)
    };
    if top.entries().len() > 1 && top.entries().iter().all(is_frame) {
        let slot = |(id, frame): &(String, Value)| Slot { time: time_of(frame), number: number_in(id), id: id.clone() };
        return top.entries().iter().map(slot).collect();
    }
    // Arrays, with times or numbers of their rows.
    let row = |names: &[&str]| {
        let found = names.iter().find_map(|name| value.get(name)?.items())?;
        (found.len() > 1 && found.iter().all(|item| item.number().is_some() || item.text().is_some())).then_some(found)
    };
    let times = row(&TIME_NAMES);
    let ids = row(&NUMBER_NAMES);
    let count = times.as_ref().or(ids.as_ref()).map_or(0, Vec::len);
    let named = value.get("ids").is_some();
    let slot = |k: usize| {
        let at = |rows: &Option<Vec<Value>>| rows.as_ref().and_then(|rows| rows.get(k).cloned());
        let id = at(&ids).and_then(|id| id.text().map(str::to_owned).or_else(|| Some(id.number()?.to_string())));
        let number = id.as_deref().and_then(number_in);
        let time = at(&times).and_then(|time| time.number()).filter(|time| time.is_finite());
        Slot { id: id.filter(|_| named).unwrap_or_else(|| format!("{k:04}")), time, number }
    };
    (0..count).map(slot).collect()
}

/// The parts of an id before, in and after its last number.
pub(crate) fn around_number(id: &str) -> Option<[&str; 3]> {
    let end = id.rfind(|c: char| c.is_ascii_digit())? + 1;
    // The ending of a file's name is not its number.
    let stem = id.rfind('.').filter(|dot| *dot > 0 && id[*dot..].chars().any(|c| c.is_ascii_alphabetic()));
    let end = stem.map_or(Some(end), |dot| Some(id[..dot].rfind(|c: char| c.is_ascii_digit())? + 1))?;
    let start = id[..end]
        .rfind(|c: char| !c.is_ascii_digit())
        .map_or(0, |before| before + id[before..].chars().next().map_or(1, char::len_utf8));
    Some([&id[..start], &id[start..end], &id[end..]])
}

fn number_in(id: &str) -> Option<f64> {
    around_number(id)?[1].parse().ok()
}

/// The numbers of frames, if all ids that have one differ only in it.
fn numbers(slots: &[Slot]) -> Vec<Option<f64>> {
    let affixes = |slot: &Slot| around_number(&slot.id).map(|[before, _, after]| [before.to_owned(), after.to_owned()]);
    let mut named = slots.iter().filter(|slot| slot.number.is_some());
    let first = named.next().and_then(affixes);
    if named.all(|slot| affixes(slot) == first) {
        slots.iter().map(|slot| slot.number).collect()
    } else {
        vec![None; slots.len()]
    }
}

/// The times of frames, and how many of their units are a second: by the name, else by their median step.
fn times(slots: &[Slot], name: Option<&str>) -> (Vec<Option<f64>>, f64) {
    let times: Vec<Option<f64>> = slots.iter().map(|slot| slot.time).collect();
    let step = median_step(&times).unwrap_or(0.0);
    let name = name.unwrap_or_default();
    let unit = match name {
        _ if name.ends_with("_ms") || name.ends_with("Ms") => 1e3,
        _ if name.ends_with("_us") => 1e6,
        _ if name.ends_with("_ns") => 1e9,
        "time_s" | "seconds" => 1.0,
        _ if step <= 1.5 => 1.0,
        _ if step <= 1.5e3 => 1e3,
        _ if step <= 1.5e6 => 1e6,
        _ => 1e9,
    };
    (times, unit)
}

fn steps(values: &[Option<f64>]) -> Vec<f64> {
    let known: Vec<f64> = values.iter().copied().flatten().collect();
    known.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| *step > 0.0).collect()
}

fn median_step(values: &[Option<f64>]) -> Option<f64> {
    let mut steps = steps(values);
    steps.sort_by(f64::total_cmp);
    // Of an even number, the shorter one: gaps make steps longer.
    steps.get(steps.len().checked_sub(1)? / 2).copied()
}

struct Places {
    places: Vec<f64>,
    /// Mean step of the coordinate from a frame to the next.
    step: f64,
    is_uneven: bool,
}

/// Places of frames by their rising coordinates, unknown ones between their neighbours.
fn places(coordinates: &[Option<f64>]) -> Option<Places> {
    let median = median_step(coordinates)?;
    let all = without_unknown(coordinates, median);
    let whole = |pair: &[f64]| ((pair[1] - pair[0]) / median).round();
    // Steps shorter than half the median are frames at nearly the same time.
    let counts: Vec<f64> = all.windows(2).map(whole).collect();
    let total: f64 = counts.iter().sum();
    let (first, last) = (*all.first()?, *all.last()?);
    if !(total >= 1.0 && total.is_finite()) {
        return None;
    }
    let mean = (last - first) / total;
    let step = if (mean / median - 1.0).abs() <= SAME_STEP { median } else { mean };
    let mut at = 0.0;
    let even: Vec<f64> = std::iter::once(0.0)
        .chain(counts.iter().map(|count| {
            at += count;
            at
        }))
        .collect();
    let exact: Vec<f64> = all.iter().map(|value| (value - first) / step).collect();
    let is_off = |(even, exact): (&f64, &f64)| (even - exact).abs() > LARGEST_JITTER;
    let is_uneven = even.iter().zip(&exact).any(is_off);
    Some(Places { places: if is_uneven { exact } else { even }, step, is_uneven })
}

fn without_unknown(values: &[Option<f64>], step: f64) -> Vec<f64> {
    let known: Vec<(usize, f64)> = values.iter().enumerate().filter_map(|(k, value)| Some((k, (*value)?))).collect();
    let place = |k: usize| {
        let after = known.partition_point(|(at, _)| *at < k);
        match (after.checked_sub(1).and_then(|before| known.get(before)), known.get(after)) {
            (_, Some((at, value))) if *at == k => *value,
            (Some((a, from)), Some((b, to))) => from + (to - from) * (k - a) as f64 / (b - a) as f64,
            (Some((a, from)), None) => from + step * (k - a) as f64,
            (None, Some((b, to))) => to - step * (b - k) as f64,
            (None, None) => k as f64,
        }
    };
    (0..values.len()).map(place).collect()
}

//! The rate of frames from their times, and what is uneven in them.

/// The rate where nothing tells it, frames per second.
pub(crate) const USUAL_RATE: f64 = 30.0;

/// Frames that follow each other after this much more or less than usual, as a part of the usual, are not even. Files
/// round times to milliseconds, which is 6 % at 60 frames per second.
const UNEVEN: f64 = 0.25;
/// A gap of at least this many usual intervals lacks a frame.
const GAP: f64 = 1.5;
/// With more uneven intervals than this part the rate varies.
const MOST_UNEVEN: f64 = 0.05;

/// The usual rate, frames per second, and a remark if the frames are uneven. `times` ascend, seconds. `None` if the times
/// do not tell.
pub(crate) fn rate(times: &[f64]) -> Option<(f64, Option<String>)> {
    let intervals: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let mut sorted: Vec<f64> = intervals.iter().copied().filter(|interval| *interval > 0.0).collect();
    sorted.sort_by(f64::total_cmp);
    let usual = *sorted.get(sorted.len() / 2)?;
    let is_even = |interval: &&f64| (*interval / usual - 1.0).abs() <= UNEVEN;
    let even: Vec<f64> = sorted.iter().filter(is_even).copied().collect();
    let rate = even.len() as f64 / even.iter().sum::<f64>();
    let uneven = intervals.len() - even.len();
    let longest = 1000.0 * sorted.last()?;
    let missing: f64 =
        sorted.iter().map(|interval| interval / usual).filter(|n| *n >= GAP).map(|n| n.round() - 1.0).sum();
    let remark = if uneven == 0 {
        None
    } else if uneven as f64 > MOST_UNEVEN * intervals.len() as f64 {
        let shortest = 1000.0 * sorted.first()?;
        Some(format!(
            "the frame rate varies: frames follow each other after {shortest:.0} to {longest:.0} ms; each keeps its time"
        ))
    } else if missing > 0.0 {
        let (frames, are) = if missing == 1.0 { ("frame", "is") } else { ("frames", "are") };
        Some(format!("{missing} {frames} {are} missing between others; the longest gap has {longest:.0} ms"))
    } else {
        Some(format!("{uneven} frames come earlier or later than at a constant rate; each keeps its time"))
    };
    Some((rate, remark))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn remark(times: &[f64]) -> (f64, String) {
        let (rate, remark) = rate(times).unwrap();
        (rate, remark.unwrap_or_default())
    }

    #[test]
    fn the_rate_is_exact_in_spite_of_milliseconds_and_missing_frames() {
        let milliseconds: Vec<f64> = (0..100).map(|k| (f64::from(k) * 1000.0 / 30.0).round() / 1000.0).collect();
        let (rate, told) = remark(&milliseconds);
        assert!((rate - 30.0).abs() < 0.01 && told.is_empty(), "{rate} {told}");
        let gaps: Vec<f64> = (0..200).filter(|k| ![50, 51, 120].contains(k)).map(|k| f64::from(k) / 25.0).collect();
        let (rate, told) = remark(&gaps);
        assert!((rate - 25.0).abs() < 1e-9, "{rate}");
        assert!(told.contains("3 frames are missing") && told.contains("120 ms"), "{told}");
    }

    #[test]
    fn a_varying_rate_is_told() {
        let times: Vec<f64> = (0..60).map(|k| f64::from(k) / 30.0 + if k % 3 == 0 { 0.012 } else { 0.0 }).collect();
        assert!(remark(&times).1.contains("varies"));
    }

    #[test]
    fn one_frame_or_equal_times_have_no_rate() {
        assert!(rate(&[]).is_none() && rate(&[1.0]).is_none() && rate(&[1.0, 1.0]).is_none());
    }
}

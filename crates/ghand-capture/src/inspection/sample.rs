//! Images spread evenly over cameras and frames.

use std::collections::HashMap;

/// At most `count` of `views` (frames outermost), in their order: one from each of `count` stretches of equal length,
/// so that they are spread over the frames, and within a stretch one of the camera that has been chosen least so far.
///
/// `chosen` counts how often each camera has been chosen; it is updated, so that several calls together use the cameras
/// evenly.
pub(super) fn spread_evenly<'a, T>(
    views: &'a [T],
    camera: impl Fn(&T) -> usize,
    count: usize,
    chosen: &mut HashMap<usize, usize>,
) -> Vec<&'a T> {
    let total = views.len();
    let count = count.min(total);
    let mut sample = Vec::with_capacity(count);
    for i in 0..count {
        let stretch = views.get(i * total / count..(i + 1) * total / count).unwrap_or_default();
        // The first of several equals would always be in the stretch's first frame: start at another place in each
        // stretch.
        let start = (i * stretch.len()) / count;
        let turned = stretch.iter().skip(start).chain(stretch.iter().take(start));
        let least = turned.min_by_key(|view| chosen.get(&camera(view)).copied().unwrap_or(0));
        if let Some(view) = least {
            *chosen.entry(camera(view)).or_default() += 1;
            sample.push(view);
        }
    }
    sample
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::split::Split;

    fn sample(split: &Split, count: usize) -> Vec<(usize, usize)> {
        spread_evenly(&split.views, |v| v.camera, count, &mut HashMap::new())
            .into_iter()
            .map(|v| (v.camera, v.frame))
            .collect()
    }

    #[test]
    fn every_camera_and_every_frame_is_sampled() {
        // A stride of 20 would always hit the same one of the 20 cameras.
        let split = Split::product((0..20).collect(), (0..240).collect());
        let found = sample(&split, 240);
        let uses = |of: &dyn Fn(&(usize, usize)) -> usize| {
            let mut counts: HashMap<usize, usize> = HashMap::new();
            found.iter().for_each(|pair| *counts.entry(of(pair)).or_default() += 1);
            counts
        };
        let cameras = uses(&|p| p.0);
        let frames = uses(&|p| p.1);
        assert!(cameras.len() == 20 && cameras.values().all(|n| *n == 12), "{cameras:?}");
        assert!(frames.len() == 240 && frames.values().all(|n| *n == 1), "{frames:?}");
    }

    #[test]
    fn samples_are_bounded_without_repetition_and_complete_if_there_are_few() {
        let split = Split::product((0..3).collect(), (0..7).collect());
        for count in [0, 1, 5, 20, 21, 99] {
            let mut found = sample(&split, count);
            assert_eq!(found.len(), count.min(21));
            found.sort_unstable();
            found.dedup();
            assert_eq!(found.len(), count.min(21));
        }
        assert!(sample(&Split::default(), 5).is_empty());
    }

    #[test]
    fn several_calls_use_the_cameras_evenly() {
        let split = Split::product((0..6).collect(), (0..4).collect());
        let mut chosen = HashMap::new();
        for _ in 0..3 {
            assert_eq!(spread_evenly(&split.views, |v| v.camera, 2, &mut chosen).len(), 2);
        }
        assert!(chosen.len() == 6 && chosen.values().all(|n| *n == 1), "{chosen:?}");
    }
}

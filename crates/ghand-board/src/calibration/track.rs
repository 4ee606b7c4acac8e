//! The board in one camera's footage, and where its corners are between two images.

use glam::DVec2;

use super::homography::homography;
use crate::{BoardCamera, BoardKind};

/// Fewer corners than this do not tell where the board is.
const LEAST_CORNERS: usize = 8;
/// Images further apart than this many usual steps, or seconds, are not interpolated.
const GAP_STEPS: f64 = 2.5;
const LONGEST_GAP: f64 = 0.3;
/// Times are as exact as this, seconds: files store milliseconds.
const TIME_ERROR: f64 = 0.0005;
/// Times that differ by less are the same, seconds.
const SAME_TIME: f64 = 1e-6;
/// The part of the way by which a corner moves faster or slower between two images by which it may be off in between.
const BOW: f64 = 1.0 / 16.0;

/// The board in one image: pixels of all corners, where they are seen.
pub(super) type Corners = Vec<Option<DVec2>>;

/// The board in one camera's footage.
#[derive(Debug, Clone)]
pub(super) struct Track {
    pub times: Vec<f64>,
    pub views: Vec<Corners>,
    /// Longest time between images that are interpolated, seconds.
    gap: f64,
}

/// A corner at some time.
#[derive(Debug, Clone, Copy)]
pub(super) struct MovingCorner {
    pub number: usize,
    pub pixel: DVec2,
    /// Pixels per second.
    pub velocity: DVec2,
    /// How much it may be off because it moves, pixels.
    pub slack: f64,
}

impl Track {
    /// The images of a camera that show enough of the board. Where the board has several numberings, corners keep theirs
    /// from image to image.
    pub(super) fn of(camera: &BoardCamera, kind: &BoardKind) -> Track {
        let symmetries = kind.symmetries();
        let mut track = Track { times: vec![], views: vec![], gap: 0.0 };
        for view in &camera.views {
            let mut corners = vec![None; kind.corner_count()];
            for corner in &view.corners {
                if let Some(slot) = corners.get_mut(corner.number) {
                    *slot = Some(corner.pixel);
                }
            }
            if !view.time.is_finite()
                || track.times.last().is_some_and(|last| view.time <= *last)
                || outline(&corners, kind).is_none()
            {
                continue;
            }
            if let Some(before) = track.views.last() {
                let turned = symmetries.iter().map(|symmetry| renumbered(&corners, symmetry));
                let nearest = turned.min_by(|a, b| distance(a, before).total_cmp(&distance(b, before)));
                corners = nearest.unwrap_or(corners);
            }
            track.times.push(view.time);
            track.views.push(corners);
        }
        let mut steps: Vec<f64> = track.times.windows(2).map(|pair| pair[1] - pair[0]).collect();
        steps.sort_by(f64::total_cmp);
        track.gap = steps.get(steps.len() / 2).map_or(0.0, |step| (GAP_STEPS * step).min(LONGEST_GAP));
        track
    }

    /// Whether image k + 1 follows image k without a gap.
    pub(super) fn is_followed(&self, k: usize) -> bool {
        self.times.get(k + 1).is_some_and(|next| next - self.times[k] <= self.gap)
    }

    /// The corners at a time of the camera's clock, interpolated; `None` if the board is not seen then.
    pub(super) fn at(&self, time: f64) -> Option<Vec<MovingCorner>> {
        let after = self.times.partition_point(|t| *t < time - SAME_TIME);
        let is_exact = self.times.get(after).is_some_and(|t| (t - time).abs() <= SAME_TIME);
        let corners: Vec<MovingCorner> = if is_exact {
            let view = self.views[after].iter().enumerate();
            view.filter_map(|(number, pixel)| {
                let velocity = self.velocity(after, number);
                let slack = TIME_ERROR * velocity.length();
                Some(MovingCorner { number, pixel: (*pixel)?, velocity, slack })
            })
            .collect()
        } else {
            let before = after.checked_sub(1).filter(|before| self.is_followed(*before))?;
            let numbers = 0..self.views[before].len();
            numbers.filter_map(|number| self.between(before, time, number)).collect()
        };
        (corners.len() >= LEAST_CORNERS).then_some(corners)
    }

    /// A corner between an image and the next one: on a cubic curve with the velocities at both.
    fn between(&self, before: usize, time: f64, number: usize) -> Option<MovingCorner> {
        let (a, b) = ((*self.views[before].get(number)?)?, (*self.views[before + 1].get(number)?)?);
        let step = self.times[before + 1] - self.times[before];
        let [va, vb] = [self.velocity(before, number), self.velocity(before + 1, number)];
        let part = (time - self.times[before]) / step;
        let rest = 1.0 - part;
        let pixel = a * (1.0 + 2.0 * part) * rest * rest
            + b * part * part * (3.0 - 2.0 * part)
            + (va * rest - vb * part) * (step * part * rest);
        let velocity =
            ((b - a) * (6.0 * part * rest)) / step + va * rest * (1.0 - 3.0 * part) + vb * part * (3.0 * part - 2.0);
        let slack = TIME_ERROR * velocity.length() + BOW * step * (vb - va).length();
        Some(MovingCorner { number, pixel, velocity, slack })
    }

    /// How fast a corner moves in an image, from the ones before and after it; pixels per second.
    fn velocity(&self, k: usize, number: usize) -> DVec2 {
        let seen = |k: usize| Some((self.times[k], (*self.views[k].get(number)?)?));
        let here = seen(k);
        let before = k.checked_sub(1).filter(|before| self.is_followed(*before)).and_then(seen);
        let after = Some(k + 1).filter(|_| self.is_followed(k)).and_then(seen);
        let slope = |a: (f64, DVec2), b: (f64, DVec2)| (b.1 - a.1) / (b.0 - a.0);
        match (before, here, after) {
            (Some(before), Some(here), Some(after)) => {
                let (first, second) = (slope(before, here), slope(here, after));
                let part = (here.0 - before.0) / (after.0 - before.0);
                first.lerp(second, part)
            }
            (Some(before), Some(here), None) => slope(before, here),
            (None, Some(here), Some(after)) => slope(here, after),
            (Some(before), None, Some(after)) => slope(before, after),
            _ => DVec2::ZERO,
        }
    }

    /// How fast the board moves in an image: the median over its corners, pixels per second.
    pub(super) fn speed(&self, k: usize) -> f64 {
        let seen = self.views[k].iter().enumerate().filter(|(_, pixel)| pixel.is_some());
        let mut speeds: Vec<f64> = seen.map(|(number, _)| self.velocity(k, number).length()).collect();
        speeds.sort_by(f64::total_cmp);
        speeds.get(speeds.len() / 2).copied().unwrap_or(0.0)
    }
}

/// The corners with other numbers: `symmetry` has for each number the corner that gets it.
pub(super) fn renumbered(corners: &Corners, symmetry: &[usize]) -> Corners {
    symmetry.iter().map(|from| corners.get(*from).copied().flatten()).collect()
}

/// Mean distance of corners that are in both, infinite if there are none.
fn distance(a: &Corners, b: &Corners) -> f64 {
    let both = a.iter().zip(b).filter_map(|(a, b)| Some(a.as_ref()?.distance(*b.as_ref()?)));
    let (sum, count) = both.fold((0.0, 0.0), |(sum, count), distance| (sum + distance, count + 1.0));
    if count > 0.0 { sum / count } else { f64::INFINITY }
}

/// Where the outermost corners of the board are in an image, also unseen ones, clockwise, pixels; `None` if too few are
/// seen, nearly on a line, or mirrored.
pub(super) fn outline(corners: &Corners, kind: &BoardKind) -> Option<[DVec2; 4]> {
    let seen: Vec<(DVec2, DVec2)> = (corners.iter().enumerate())
        .filter_map(|(number, pixel)| Some((kind.corner(number).truncate(), (*pixel)?)))
        .collect();
    if seen.len() < LEAST_CORNERS {
        return None;
    }
    let (places, pixels): (Vec<DVec2>, Vec<DVec2>) = seen.into_iter().unzip();
    let map = homography(&places, &pixels)?;
    let outer = kind.outermost().map(|number| {
        let at = map * kind.corner(number).truncate().extend(1.0);
        at.truncate() / at.z
    });
    let [right, down] = [outer[1] - outer[0], outer[3] - outer[0]];
    // Mirrored, it is no board.
    (outer.iter().all(|pixel| pixel.is_finite()) && right.perp_dot(down) > 0.0).then_some(outer)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{BoardView, SeenCorner};

    fn filmed(kind: &BoardKind, place: impl Fn(f64, usize) -> DVec2) -> Track {
        let view = |k: u32| {
            let time = f64::from(k) / 30.0;
            let corner = |number| SeenCorner { number, pixel: place(time, number) };
            BoardView { time, corners: (0..kind.corner_count()).map(corner).collect() }
        };
        let mut camera = BoardCamera::new("a", [640, 480], None);
        camera.views = (0..30).filter(|k| ![14, 15, 16].contains(k)).map(view).collect();
        Track::of(&camera, kind)
    }

    #[test]
    fn corners_between_images_are_where_they_move_and_gaps_are_not_bridged() {
        let kind: BoardKind = "chessboard:9x6:25mm".parse().unwrap();
        let grid = |number: usize| DVec2::new((number % 9) as f64, (number / 9) as f64) * 20.0;
        let truth = |time: f64, number: usize| {
            DVec2::new(100.0 + 60.0 * (4.0 * time).sin(), 80.0 + 300.0 * time * time) + grid(number)
        };
        let track = filmed(&kind, truth);
        for time in [0.215, 0.3, 0.3333333, 0.71] {
            let found = track.at(time).unwrap();
            assert_eq!(found.len(), 54);
            for corner in found {
                assert!(corner.pixel.distance(truth(time, corner.number)) < 0.02, "{time}");
                let step = 1e-4;
                let velocity = (truth(time + step, 0) - truth(time - step, 0)) / (2.0 * step);
                assert!(corner.velocity.distance(velocity) < 3.0, "{time}: {} {velocity}", corner.velocity);
                assert!(corner.slack > 0.01 && corner.slack < 0.3);
            }
        }
        assert!(track.at(0.5).is_none() && track.at(-0.01).is_none() && track.at(1.01).is_none());
    }

    #[test]
    fn boards_that_look_alike_turned_keep_their_numbers() {
        let kind: BoardKind = "chessboard:8x6:25mm".parse().unwrap();
        let grid = |number: usize| DVec2::new((number % 8) as f64, (number / 8) as f64) * 20.0;
        // Every third image is numbered from the other end.
        let track = filmed(&kind, |time, number| {
            let turned = (time * 30.0).round() as u32 % 3 == 1;
            DVec2::splat(50.0 + 10.0 * time) + grid(if turned { 47 - number } else { number })
        });
        let firsts: Vec<DVec2> = track.views.iter().map(|view| view[0].unwrap()).collect();
        assert!(firsts.windows(2).all(|pair| pair[0].distance(pair[1]) < 2.0), "{firsts:?}");
    }
}

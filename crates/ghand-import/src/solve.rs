//! Cameras, clocks and lengths of the hand from the tracks of all cameras.

use ghand_capture::cameras::list::LensCamera;
use ghand_motion::image_landmarks::UsualFocal;

use crate::clocks::{self, ClockOffset};
use crate::moments::moments;
use crate::rig::bundle::refine;
use crate::rig::equations::first_points;
use crate::rig::lengths::BONES;
use crate::rig::start::place_cameras;
use crate::rig::{Moment, Rig, Unknowns};
use crate::track::Track;

/// Most moments that cameras are found from: more of them tell nothing new.
const MOST_MOMENTS: usize = 150;
/// And from which it is told which of several clocks is right.
const MOMENTS_OF_A_CLOCK: usize = 60;
/// Rounds of interpolating landmarks by the clocks and refining these.
const ROUNDS: usize = 4;
/// Clocks that change by less than this in a round are found, seconds.
const SMALL_OFFSET: f64 = 2e-4;
/// Fewer moments than this that two cameras see do not place a camera.
const LEAST_MOMENTS: usize = 10;

/// What is known of cameras before.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Known {
    /// All but the clocks.
    All,
    /// All but the clocks and the unit of length.
    AllButTheUnit,
    /// Focal lengths and distortion, but not where cameras are.
    Lenses,
    /// Only sizes of images, and a guess of the focal lengths.
    Nothing,
}

/// What was found.
#[derive(Debug, Clone)]
pub struct Solved {
    /// Cameras, clocks and the hand's lengths.
    pub rig: Rig,
    /// Clocks as the movements tell them; `None` for the first camera, and where they do not.
    pub clocks: Vec<Option<ClockOffset>>,
    /// Noise of a landmark, metres at a hand of mean size; 0 for a single camera.
    pub noise: f64,
}

/// Finds what is not known. `focals` are the likeliest focal lengths, `lengths` those of the mean hand; `clocks`, if they
/// are known, what to add to the first camera's time to have each one's, seconds.
///
/// # Errors
/// The number of a camera that sees the hand at too few moments at which another one sees it, too.
pub fn solve(
    tracks: &[Track],
    lenses: &[LensCamera],
    known: Known,
    focals: &[UsualFocal],
    lengths: &[f64; BONES.len()],
    clocks: Option<&[f64]>,
) -> Result<Solved, usize> {
    let footage = Footage { tracks, lenses, known, focals, lengths };
    let mut found = vec![None];
    found.extend((1..tracks.len()).map(|camera| {
        let offsets = clocks::offsets(&tracks[0], &tracks[camera]);
        if clocks.is_some() { offsets.first().copied() } else { footage.likeliest(camera, offsets) }
    }));
    let moved = || found.iter().map(|clock| clock.map_or(0.0, |clock| clock.seconds)).collect();
    let offsets = clocks.map_or_else(moved, <[f64]>::to_vec);
    let (rig, noise) = footage.solve(offsets, clocks.is_none(), ROUNDS, MOST_MOMENTS)?;
    Ok(Solved { rig, clocks: found, noise })
}

/// What cameras saw, and what is known of them.
#[derive(Clone, Copy)]
struct Footage<'a> {
    tracks: &'a [Track],
    lenses: &'a [LensCamera],
    known: Known,
    focals: &'a [UsualFocal],
    lengths: &'a [f64; BONES.len()],
}

impl Footage<'_> {
    /// Which of several clocks a camera has: the one with which it and the first camera see one hand.
    fn likeliest(&self, camera: usize, offsets: Vec<ClockOffset>) -> Option<ClockOffset> {
        if offsets.len() < 2 {
            return offsets.first().copied();
        }
        let tracks = [0, camera].map(|k| self.tracks[k].clone());
        let lenses = [0, camera].map(|k| self.lenses[k].clone());
        let focals = [0, camera].map(|k| self.focals[k]);
        let both = Footage { tracks: &tracks, lenses: &lenses, focals: &focals, ..*self };
        let noise = |clock: &ClockOffset| {
            let solved = both.solve(vec![0.0, clock.seconds], true, 1, MOMENTS_OF_A_CLOCK);
            solved.map_or(f64::INFINITY, |(_, noise)| noise)
        };
        let noises: Vec<f64> = offsets.iter().map(noise).collect();
        let best = (0..offsets.len()).min_by(|a, b| noises[*a].total_cmp(&noises[*b]))?;
        Some(offsets[best])
    }

    /// The rig and the noise of landmarks, from clocks that are right or nearly so.
    fn solve(&self, offsets: Vec<f64>, clocks: bool, rounds: usize, most_moments: usize) -> Result<(Rig, f64), usize> {
        let Footage { tracks, lenses, known, focals, lengths } = *self;
        let cameras = lenses.iter().map(|lens| lens.camera.clone()).collect();
        let mut rig = Rig { cameras, size: 1.0, bones: [0.0; BONES.len()], offsets };
        let mut noise = 0.0;
        if tracks.len() < 2 {
            return Ok((rig, noise));
        }
        for round in 0..rounds {
            let seen = common_moments(tracks, lenses, &rig.offsets, most_moments);
            for camera in 0..tracks.len() {
                if seen.iter().filter(|moment| moment[camera].is_some()).count() < LEAST_MOMENTS {
                    return Err(camera);
                }
            }
            if round == 0 {
                if matches!(known, Known::Nothing | Known::Lenses) {
                    place_cameras(&mut rig.cameras, &seen)?;
                }
                let size = seen_size(&rig, &seen, lengths);
                match known {
                    // The unit of length is such that the hand is the mean hand.
                    Known::Nothing | Known::Lenses => {
                        rig.cameras.iter_mut().for_each(|camera| camera.translation /= size);
                    }
                    Known::All | Known::AllButTheUnit => rig.size = size,
                }
            }
            let unknowns = Unknowns {
                places: matches!(known, Known::Nothing | Known::Lenses),
                focals: known == Known::Nothing,
                clocks,
                size: matches!(known, Known::All | Known::AllButTheUnit),
            };
            let before = rig.offsets.clone();
            (rig, noise) = refine(&rig, &seen, lengths, unknowns, focals);
            if before.iter().zip(&rig.offsets).all(|(a, b)| (a - b).abs() < SMALL_OFFSET) {
                break;
            }
        }
        Ok((rig, noise))
    }
}

/// Moments that two cameras or more see, spread evenly over the footage.
fn common_moments(tracks: &[Track], lenses: &[LensCamera], offsets: &[f64], most: usize) -> Vec<Moment> {
    let all = moments(tracks, lenses, offsets, &tracks[0].times);
    let common: Vec<Moment> = all.into_iter().filter(|moment| moment.iter().flatten().count() >= 2).collect();
    let count = common.len().min(most);
    (0..count).map(|k| common[k * common.len() / count].clone()).collect()
}

/// How many times the mean hand the hand is, as the rig's lines of sight say: the median over bones and moments.
fn seen_size(rig: &Rig, moments: &[Moment], lengths: &[f64; BONES.len()]) -> f64 {
    let mut ratios = vec![];
    for points in moments.iter().filter_map(|moment| first_points(moment, &rig.cameras)) {
        ratios.extend(BONES.iter().zip(lengths).map(|((from, to), mean)| points[*from].distance(points[*to]) / mean));
    }
    ratios.sort_by(f64::total_cmp);
    ratios.get(ratios.len() / 2).copied().filter(|size| size.is_finite() && *size > 0.0).unwrap_or(1.0)
}

//! Fits the pose of a frame to what was seen of it, with landmarks that may be wrong.

use ghand_core::Camera;
use glam::DVec3;

use super::sightings::{Gap, SeenFrame};
use crate::ik::derivatives::{Square, add, settle_root};
use crate::ik::levenberg_marquardt::{Problem, minimize, prior};
use crate::ik::limits::{Coupling, Range};
use crate::ik::{HandIk, UNKNOWNS};

/// A hand and what was seen of it.
#[derive(Clone, Copy)]
pub(crate) struct FrameFit<'a> {
    pub hand: &'a HandIk,
    pub seen: &'a SeenFrame,
    pub cameras: &'a [Camera],
    /// Metres per pixel at the hand, by camera.
    pub scales: &'a [f64],
    /// The noise of a coordinate, metres.
    pub noise: f64,
}

impl FrameFit<'_> {
    /// The pose near `start` that fits best, and its cost.
    pub fn solve(&self, start: [f64; UNKNOWNS], most: usize) -> (f64, [f64; UNKNOWNS]) {
        let (x, _) = minimize(self, start, most);
        (self.cost(&x), x)
    }

    /// Twice the negative logarithm of the probability of what was seen, and of the pose.
    pub fn cost(&self, x: &[f64; UNKNOWNS]) -> f64 {
        self.squares(x) + prior(self, x)
    }

    /// The part of the cost that is the pose's, whatever was seen.
    pub fn prior(&self, x: &[f64; UNKNOWNS]) -> f64 {
        prior(self, x)
    }

    /// The part of the cost that is what was seen.
    pub fn sighting_cost(&self, x: &[f64; UNKNOWNS]) -> f64 {
        self.squares(x)
    }

    /// The same frame, in which nothing was seen.
    pub fn without_sightings(self) -> Self {
        static NOTHING: SeenFrame = SeenFrame { id: String::new(), sightings: vec![] };
        FrameFit { seen: &NOTHING, ..self }
    }

    /// Angles that are out of their ranges are brought to their ends.
    pub fn keep_in_range(&self, x: &mut [f64; UNKNOWNS]) {
        let angles = &mut x[UNKNOWNS - self.hand.ranges.len()..];
        angles.iter_mut().zip(&self.hand.ranges).for_each(|(value, range)| *value = value.clamp(range.low, range.high));
    }

    /// How far each sighting is from the hand.
    pub fn gaps(&self, x: &[f64; UNKNOWNS]) -> Vec<Gap> {
        let places = self.hand.places(&self.hand.chain(x), x);
        self.seen.sightings.iter().map(|s| s.gap(places[s.landmark], self.cameras, self.scales)).collect()
    }

    /// Median distance, metres; infinite without any sighting.
    pub fn median(&self, x: &[f64; UNKNOWNS]) -> f64 {
        let mut distances: Vec<f64> = self.gaps(x).iter().map(|gap| gap.squared.sqrt()).collect();
        distances.sort_by(f64::total_cmp);
        distances.get(distances.len() / 2).copied().unwrap_or(f64::INFINITY)
    }
}

impl Problem for FrameFit<'_> {
    fn ranges(&self) -> &[Range] {
        &self.hand.ranges
    }

    fn couplings(&self) -> &[Coupling] {
        &self.hand.couplings
    }

    fn squares(&self, x: &[f64; UNKNOWNS]) -> f64 {
        let gaps = self.gaps(x);
        self.seen.sightings.iter().zip(&gaps).map(|(s, gap)| s.cost_and_weight(gap, self.noise).0).sum()
    }

    /// Errors are counted in units of the noise.
    fn variance(&self, _squares: f64) -> f64 {
        1.0
    }

    fn normal_equations(&self, x: &[f64; UNKNOWNS]) -> (Square, [f64; UNKNOWNS]) {
        let chain = self.hand.chain(x);
        let places = self.hand.places(&chain, x);
        let rows = self.hand.landmark_derivatives(&chain, x);
        let mut matrix = Box::new([[0.0; UNKNOWNS]; UNKNOWNS]);
        let mut vector = [0.0; UNKNOWNS];
        for sighting in &self.seen.sightings {
            let gap = sighting.gap(places[sighting.landmark], self.cameras, self.scales);
            let (_, weight) = sighting.cost_and_weight(&gap, self.noise);
            let pull: DVec3 = gap.pull * weight;
            add(&rows[sighting.landmark], &(gap.information * weight), pull, &mut matrix, &mut vector);
        }
        (matrix, vector)
    }

    fn settle(&self, x: &mut [f64; UNKNOWNS]) {
        settle_root(x);
    }
}

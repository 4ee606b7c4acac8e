//! Finds palms in a picture, with MediaPipe's palm detector.

use glam::DVec2;

use crate::Region;
use crate::network::Network;
use crate::picture::{Outside, Picture};
use crate::region::overlap;

/// MediaPipe's network, which comes with this crate.
pub(crate) const NETWORK: &[u8] = include_bytes!("../../../assets/hand-tracker/palm_detection_full.tflite");

/// Edge of the network's input, pixels.
const EDGE: usize = 192;

/// Numbers for each anchor: middle, size, and seven points.
const NUMBERS: usize = 18;

/// Rows and columns of anchors, and how many are at each place.
const GRIDS: [[usize; 2]; 2] = [[24, 2], [12, 6]];

/// Least score of a palm.
const LEAST_SCORE: f64 = 0.5;

/// Boxes that overlap by more than this are the same palm.
const SAME_PALM: f64 = 0.3;

/// Scores before the logistic function are limited to this.
const LARGEST_LOGIT: f32 = 100.0;

/// Points of a palm that give the region of its hand.
const WRIST: usize = 0;
const MIDDLE_KNUCKLE: usize = 2;

/// A palm, in pixels.
#[derive(Clone)]
pub(crate) struct Palm {
    /// How certain it is, 0.5 to 1.
    pub score: f64,
    /// Middle of its box.
    pub center: DVec2,
    /// Width and height of its box.
    pub size: DVec2,
    /// Wrist, first knuckles of index, middle, ring and little finger, and the thumb's first two joints.
    pub points: [DVec2; 7],
}

impl Palm {
    /// Where the whole hand is.
    pub fn region(&self) -> Region {
        Region::from_palm(self.center, self.size, self.points[WRIST], self.points[MIDDLE_KNUCKLE])
    }
}

/// The network with its anchors.
pub(crate) struct PalmDetector {
    network: Network,
    anchors: Vec<DVec2>,
}

impl PalmDetector {
    /// Reads the network.
    pub fn new() -> Self {
        PalmDetector { network: Network::from_tflite(NETWORK), anchors: anchors() }
    }

    /// All palms, the most certain first.
    pub fn detect(&self, picture: Picture) -> Vec<Palm> {
        let square = picture.square();
        let outputs = self.network.run(&picture.crop(&square, EDGE, Outside::Black));
        let (boxes, scores) = (outputs[0].as_chunks::<NUMBERS>().0, &outputs[1]);
        let anchors = self.anchors.iter().zip(boxes).zip(scores);
        let mut palms: Vec<Palm> = anchors
            .filter_map(|((&anchor, numbers), &logit)| {
                let logit = logit.clamp(-LARGEST_LOGIT, LARGEST_LOGIT);
                let score = 1.0 / (1.0 + f64::from(-logit).exp());
                let pair = |k: usize| DVec2::new(f64::from(numbers[k]), f64::from(numbers[k + 1])) / EDGE as f64;
                let place = |k: usize| square.to_picture(anchor + pair(k));
                let points = std::array::from_fn(|point| place(4 + 2 * point));
                // Rejects NaN, too.
                (score >= LEAST_SCORE).then(|| Palm { score, center: place(0), size: pair(2) * square.size, points })
            })
            .collect();
        palms.sort_by(|a, b| b.score.total_cmp(&a.score));
        merge(palms)
    }
}

/// Middles of the anchors, from 0 to 1.
fn anchors() -> Vec<DVec2> {
    let grid = |[edge, count]: [usize; 2]| {
        (0..edge * edge).flat_map(move |k| {
            let middle = DVec2::new((k % edge) as f64 + 0.5, (k / edge) as f64 + 0.5) / edge as f64;
            std::iter::repeat_n(middle, count)
        })
    };
    GRIDS.into_iter().flat_map(grid).collect()
}

/// One palm for boxes that overlap: their mean, weighted by score. Takes and gives the most certain first.
fn merge(mut palms: Vec<Palm>) -> Vec<Palm> {
    let mut merged = Vec::new();
    while let Some(best) = palms.first() {
        let (score, first) = (best.score, [best.center, best.size]);
        let is_same = |palm: &Palm| overlap(first, [palm.center, palm.size]) > SAME_PALM;
        let (mut same, other): (Vec<Palm>, Vec<Palm>) = palms.iter().cloned().partition(is_same);
        if same.is_empty() {
            // A box without area overlaps nothing, not even itself.
            same.push(best.clone());
        }
        let total: f64 = same.iter().map(|palm| palm.score).sum();
        let mean = |of: &dyn Fn(&Palm) -> DVec2| same.iter().map(|palm| of(palm) * palm.score).sum::<DVec2>() / total;
        merged.push(Palm {
            score,
            center: mean(&|palm| palm.center),
            size: mean(&|palm| palm.size),
            points: std::array::from_fn(|k| mean(&|palm| palm.points[k])),
        });
        let rest = if other.len() == palms.len() { other[1..].to_vec() } else { other };
        palms = rest;
    }
    merged
}

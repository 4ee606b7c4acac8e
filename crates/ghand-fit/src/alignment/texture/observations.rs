//! What the images show at the surface's points, and how much that should count.
//!
//! A point looks the same in all images of a frame: its *views* differ by their errors only. And it looks much as in other
//! frames: its mean over a frame's images differs from its *reference*, the mean over the other frames, by what light and
//! folds change besides. Both variances are measured, and so is how far the points of a patch err alike.

use std::collections::BTreeMap;

use ghand_core::{Camera, InvalidHandModel, Pose};
use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::bands::{Band, Contrast};
use super::surface::{NearestDepth, SurfacePoint};
use crate::alignment::proportions::Shaped;

/// An image shows a point if it faces the camera with at least this cosine.
const LEAST_COSINE: f64 = 0.55;
/// Degrees of freedom of Student's distribution, which bounds the influence of outliers.
pub const FREEDOM: f64 = 5.0;
/// Frames that must show a point for a reference.
const LEAST_FRAMES: f64 = 3.0;
/// Rounds in which variances and the weights of outliers settle.
const ROUNDS: usize = 4;
/// Least standard deviations of contrast: images have 8 bits.
const LEAST_DEVIATION: f64 = 0.001;

/// A frame's images.
pub type Contrasts<'a> = Vec<(&'a Camera, &'a Contrast)>;

/// A point in one image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Observation {
    /// Which of the frame's images.
    pub image: usize,
    /// Contrast.
    pub value: f64,
    /// Its derivative by the point's position, per metre, world axes.
    pub gradient: DVec3,
}

/// What a frame's images show, by point.
pub type Observed = Vec<Vec<Observation>>;

/// What images show in a pose, of the points chosen by `is_used` (of image and point).
///
/// # Errors
/// [`InvalidHandModel`] if the pose does not fit the template.
pub fn observe(
    shaped: &Shaped,
    points: &[SurfacePoint],
    pose: &Pose,
    images: &Contrasts,
    band: Band,
    is_used: impl Fn(usize, &SurfacePoint) -> bool,
) -> Result<Observed, InvalidHandModel> {
    let posed = shaped.pose(pose)?.vertices;
    let normals = shaped.model.vertex_normals(&posed);
    let places: Vec<(DVec3, DVec3)> =
        points.iter().map(|point| (point.mean_of(&posed), point.mean_of(&normals).normalize_or_zero())).collect();
    let mut observed = vec![vec![]; points.len()];
    for (image, (camera, contrast)) in images.iter().enumerate() {
        let nearest = NearestDepth::new(camera, &posed, &shaped.model.faces);
        let center = camera.center();
        for ((own, (place, normal)), point) in observed.iter_mut().zip(&places).zip(points) {
            if !is_used(image, point) || (center - *place).normalize_or_zero().dot(*normal) < LEAST_COSINE {
                continue;
            }
            let (pixel, depth) = camera.project(*place);
            if !nearest.shows(pixel, depth) {
                continue;
            }
            let Some((value, slope)) = contrast.at(band, pixel) else { continue };
            let at = camera.camera_from_world(*place);
            let [x, y] = (slope * camera.focal / at.z).to_array();
            let gradient = camera.rotation.transpose() * DVec3::new(x, y, -(x * at.x + y * at.y) / at.z);
            own.push(Observation { image, value, gradient });
        }
    }
    Ok(observed)
}

/// Half the squared residuals of a point as a function of its position, to second order.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Pull {
    pub information: DMat3,
    pub gradient: DVec3,
}

/// The mean of a point over a frame's images.
struct Mean {
    value: f64,
    gradient: DVec3,
    /// What each image counts, at most about 1, and the sum.
    weights: Vec<f64>,
    total: f64,
}

impl Mean {
    /// `None` without observations.
    fn of(own: &[Observation], variance: f64) -> Option<Mean> {
        if own.is_empty() {
            return None;
        }
        let mut weights = vec![1.0; own.len()];
        let mut mean = weighted(own, &weights);
        for _ in 0..2 {
            for (observation, weight) in own.iter().zip(&mut weights) {
                *weight = student(observation.value - mean, variance);
            }
            mean = weighted(own, &weights);
        }
        let total = weights.iter().sum::<f64>();
        let gradient = own.iter().zip(&weights).map(|(o, weight)| *weight * o.gradient).sum::<DVec3>() / total;
        Some(Mean { value: mean, gradient, weights, total })
    }
}

/// Weighted mean of the values.
fn weighted(own: &[Observation], weights: &[f64]) -> f64 {
    own.iter().zip(weights).map(|(o, weight)| weight * o.value).sum::<f64>() / weights.iter().sum::<f64>()
}

/// Weight of a residual under Student's distribution.
fn student(residual: f64, variance: f64) -> f64 {
    (FREEDOM + 1.0) / (FREEDOM + residual * residual / variance)
}

/// Measured variances.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Variances {
    /// Of contrast among the views of a point in a frame.
    pub views: f64,
    /// Of a point's mean from frame to frame, besides.
    pub frames: f64,
    /// How many times as much the pulls of whole patches vary as independent points' would: of views, of means.
    pub patches: [f64; 2],
}

/// What points look like in all frames, by frame and point.
pub struct References {
    /// Value and weight of the own means.
    means: Vec<Vec<Option<(f64, f64)>>>,
    /// Sums of the means over the frames, and numbers of frames.
    sums: Vec<(f64, f64)>,
    pub variances: Variances,
}

impl References {
    /// Measures all frames.
    pub fn new(observed: &[Observed], points: &[SurfacePoint]) -> References {
        let views = views_variance(observed);
        let mean = |own: &Vec<Observation>| Mean::of(own, views).map(|mean| (mean.value, mean.total));
        let means: Vec<Vec<Option<(f64, f64)>>> =
            observed.par_iter().map(|frame| frame.iter().map(mean).collect()).collect();
        let mut sums = vec![(0.0, 0.0); points.len()];
        for frame in &means {
            for (sum, (value, _)) in sums.iter_mut().zip(frame).filter_map(|(sum, mean)| Some((sum, (*mean)?))) {
                *sum = (sum.0 + value, sum.1 + 1.0);
            }
        }
        let variances = Variances { views, frames: LEAST_DEVIATION.powi(2), patches: [1.0; 2] };
        let mut references = References { means, sums, variances };
        references.variances.frames = references.frames_variance();
        references.variances.patches = references.patch_factors(observed, points);
        references
    }

    /// The mean of a point over the other frames, and their number.
    fn without(&self, frame: usize, point: usize) -> Option<(f64, f64)> {
        let (sum, count) = self.sums[point];
        let (own, one) = self.means[frame][point].map_or((0.0, 0.0), |(value, _)| (value, 1.0));
        (count - one >= LEAST_FRAMES).then(|| ((sum - own) / (count - one), count - one))
    }

    /// How a point is pulled by the differences among its views, and by that of their mean from the reference. `frame` is
    /// the frame's place among those measured.
    pub fn pulls(&self, frame: usize, point: usize, own: &[Observation]) -> Option<[Pull; 2]> {
        let Variances { views, frames, patches } = self.variances;
        let mean = Mean::of(own, views)?;
        let mut among = Pull::default();
        let mut against = Pull::default();
        for (observation, weight) in own.iter().zip(&mean.weights) {
            let off = observation.gradient - mean.gradient;
            let weight = weight / (views * patches[0]);
            among.information += weight * outer(off);
            among.gradient += weight * (observation.value - mean.value) * off;
        }
        if let Some((reference, count)) = self.without(frame, point) {
            let variance = frames * (1.0 + 1.0 / count) + views / mean.total;
            let residual = mean.value - reference;
            let weight = student(residual, variance) / (variance * patches[1]);
            against.information = weight * outer(mean.gradient);
            against.gradient = weight * residual * mean.gradient;
        }
        Some([among, against])
    }

    /// What another image of the frame should show at a point, and its variance. `own` may be empty.
    pub fn expected(&self, frame: usize, point: usize, own: &[Observation]) -> Option<(f64, f64)> {
        let Variances { views, frames, .. } = self.variances;
        let reference = self.without(frame, point).map(|(value, count)| (value, frames * (1.0 + 1.0 / count)));
        let Some(mean) = Mean::of(own, views) else {
            return reference.map(|(value, variance)| (value, views + variance));
        };
        let error = views / mean.total;
        let Some((reference, variance)) = reference else { return Some((mean.value, views + error)) };
        let trust = variance / (variance + error);
        Some((reference + trust * (mean.value - reference), views + trust * error))
    }

    fn frames_variance(&self) -> f64 {
        let mut variance = self.variances.views;
        for _ in 0..ROUNDS {
            let mut squares = 0.0;
            let mut weights = 0.0;
            for (frame, means) in self.means.iter().enumerate() {
                for (point, mean) in means.iter().enumerate() {
                    if let (Some((value, total)), Some((reference, count))) = (mean, self.without(frame, point)) {
                        let scale = 1.0 + 1.0 / count;
                        let error = self.variances.views / total;
                        let residual = value - reference;
                        let weight = student(residual, variance * scale + error);
                        squares += weight * (residual * residual - error) / scale;
                        weights += weight;
                    }
                }
            }
            variance = (squares / f64::max(weights, 1.0)).max(LEAST_DEVIATION.powi(2));
        }
        variance
    }

    /// Squared pulls of whole patches, relative to what they are if points err independently.
    fn patch_factors(&self, observed: &[Observed], points: &[SurfacePoint]) -> [f64; 2] {
        let of_frame = |(frame, observed): (usize, &Observed)| {
            let mut patches: BTreeMap<[i32; 3], [Pull; 2]> = BTreeMap::new();
            for (point, own) in observed.iter().enumerate() {
                if let Some(pulls) = self.pulls(frame, point, own) {
                    for (sum, pull) in patches.entry(points[point].patch).or_default().iter_mut().zip(pulls) {
                        sum.information += pull.information;
                        sum.gradient += pull.gradient;
                    }
                }
            }
            let mut sums = [[0.0; 2]; 2];
            for (cue, pull) in patches.values().flat_map(|patch| patch.iter().enumerate()) {
                sums[cue][0] += pull.gradient.length_squared();
                sums[cue][1] += (0..3).map(|axis| pull.information.col(axis)[axis]).sum::<f64>();
            }
            sums
        };
        let parts: Vec<[[f64; 2]; 2]> = observed.par_iter().enumerate().map(of_frame).collect();
        [0, 1].map(|cue| {
            let [squares, expected] = [0, 1].map(|k| parts.iter().map(|part| part[cue][k]).sum::<f64>());
            if expected > 0.0 { (squares / expected).max(1.0) } else { 1.0 }
        })
    }
}

/// Variance of contrast among the views of a point in a frame.
fn views_variance(observed: &[Observed]) -> f64 {
    let mut variance = 0.01;
    for _ in 0..ROUNDS {
        let of_frame = |frame: &Observed| {
            let mut sums = [0.0; 2];
            for own in frame.iter().filter(|own| own.len() > 1) {
                let Some(mean) = Mean::of(own, variance) else { continue };
                let squares = own.iter().zip(&mean.weights).map(|(o, weight)| weight * (o.value - mean.value).powi(2));
                sums[0] += squares.sum::<f64>();
                sums[1] += mean.total * (1.0 - 1.0 / own.len() as f64);
            }
            sums
        };
        let parts: Vec<[f64; 2]> = observed.par_iter().map(of_frame).collect();
        let [squares, count] = [0, 1].map(|k| parts.iter().map(|part| part[k]).sum::<f64>());
        variance = (squares / count.max(1.0)).max(LEAST_DEVIATION.powi(2));
    }
    variance
}

fn outer(v: DVec3) -> DMat3 {
    DMat3::from_cols(v * v.x, v * v.y, v * v.z)
}

//! The light of a capture, from its images, before any splatting.
//!
//! A texel's mean colour in a frame, in linear light, is its albedo times its irradiance, which is linear in the light's
//! coefficients: albedo and light are fitted in turns, each by least squares, radiances without negative ones. Which kind
//! of light a capture needs is decided on frames that the fit has not seen.

use ghand_avatar::light::Parts;
use ghand_avatar::{Light, LightKind};
use ghand_capture::{Capture, Split, SplitView};
use ghand_core::light::{directions, linear, shade};
use ghand_core::{InvalidHandModel, Pose};
use ghand_hand_model::SurfaceSamples;
use ghand_render::Gpu;
use glam::DVec3;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::floor::FloorError;
use crate::settings::LightChoice;
use crate::texel_views::{TexelObserver, TexelView};

/// Resolution of the texels that the light is fitted to: some thousand points.
const RESOLUTION: u32 = 96;
/// Most frames used, evenly spaced, and most views of each.
const MOST_FRAMES: usize = 60;
const VIEWS_PER_FRAME: usize = 5;
/// Turns of light and albedo.
const ROUNDS: usize = 40;
/// Ridge on the light, as a fraction of the mean diagonal.
const LIGHT_RIDGE: f64 = 1e-3;
/// Ridge on the albedos, towards their mean: the squared ratio of what the model leaves unexplained to how much skin
/// varies. A hand that hardly turns does not tell light from skin otherwise.
const ALBEDO_RIDGE: f64 = 0.1;
/// Every this many frames, one is held out.
const HOLD_OUT: usize = 3;
/// A kind of light must reduce the held-out error of the simpler one to less than this fraction.
const WORTHWHILE: f64 = 0.9;
/// A texel takes part if this many frames show it.
const LEAST_FRAMES: usize = 4;

/// How well each kind of light explains frames that its fit has not seen: mean squared error of the display values.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct LightFigures {
    /// Each texel has one colour in all frames.
    pub none: f64,
    /// Spherical harmonics of the normal.
    pub sh: f64,
    /// Directions with shadows.
    pub transfer: f64,
}

/// The light found.
#[derive(Debug, Clone, PartialEq)]
pub struct LightFit {
    /// The light; `None` if none is apart from the colours.
    pub light: Option<Light>,
    /// The kinds compared.
    pub figures: LightFigures,
    /// Number of frames and texels that they come from.
    pub frames: usize,
    /// See `frames`.
    pub texels: usize,
}

/// A fit in `metrics.json`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LightReport {
    /// The kind of light; `null` if none is apart from the colours.
    pub kind: Option<LightKind>,
    /// The kinds compared, on frames left out.
    pub squared_error_left_out: LightFigures,
    /// Number of frames and of texels in them.
    pub frames: usize,
    /// See `frames`.
    pub texels: usize,
    /// Unit vector towards the brightest part of the light, world axes: the mean of the directions by radiance above the
    /// mean; `null` without directions.
    pub towards: Option<[f64; 3]>,
}

impl LightFit {
    /// The fit as it is reported.
    pub fn report(&self) -> LightReport {
        LightReport {
            kind: self.light.as_ref().map(|light| light.kind),
            squared_error_left_out: self.figures,
            frames: self.frames,
            texels: self.texels,
            towards: self.light.as_ref().and_then(towards),
        }
    }
}

/// Unit vector towards the brightest part of a light from directions.
fn towards(light: &Light) -> Option<[f64; 3]> {
    let brightness = |c: &[f32; 3]| f64::from(c.iter().sum::<f32>()) / 3.0;
    let above = light.coefficients.iter().map(|c| (brightness(c) - 1.0).max(0.0));
    let sum: DVec3 = above.zip(directions()).map(|(weight, d)| d * weight).sum();
    (light.kind == LightKind::Transfer).then(|| sum.try_normalize()).flatten().map(|d| d.to_array())
}

/// Fits the light of a split. `poses` holds the poses of its frames; they are fitted already.
///
/// # Errors
/// [`FloorError`] if an image or the model is unusable.
pub fn fit_light(
    gpu: &Gpu,
    capture: &Capture,
    split: &Split,
    poses: &[Pose],
    choice: LightChoice,
) -> Result<LightFit, FloorError> {
    let observations = Observations::new(gpu, capture, split, poses)?;
    let model = capture.template.without_blend_shapes();
    let columns = |kind: LightKind| -> Result<Vec<DMatrix<f64>>, InvalidHandModel> {
        let parts = |frame: &usize| Parts::new(kind, &model, &poses[*frame], &|_| true);
        let at_texels = |parts: Parts| at_texels(&parts, &model.faces, &observations.samples);
        observations.frames.par_iter().map(|frame| parts(frame).map(at_texels)).collect()
    };
    let (sh, transfer) = (columns(LightKind::Sh)?, columns(LightKind::Transfer)?);
    let held_out = |frame: usize| frame % HOLD_OUT == HOLD_OUT - 1 && observations.frames.len() >= 2 * HOLD_OUT;
    let error = |kind: LightKind, parts: &[DMatrix<f64>]| {
        let fits = observations.fit(kind, parts, &|frame| !held_out(frame));
        observations.error(parts, &fits, &held_out)
    };
    let constant = vec![DMatrix::from_element(observations.samples.len(), 1, 1.0); observations.frames.len()];
    let figures = LightFigures {
        none: error(LightKind::Sh, &constant),
        sh: error(LightKind::Sh, &sh),
        transfer: error(LightKind::Transfer, &transfer),
    };
    let kind = match choice {
        LightChoice::None => None,
        LightChoice::Sh => Some(LightKind::Sh),
        LightChoice::Transfer => Some(LightKind::Transfer),
        LightChoice::Auto => needed(&figures),
    };
    let light = kind.map(|kind| {
        let parts = if kind == LightKind::Sh { &sh } else { &transfer };
        let fits = observations.fit(kind, parts, &|_| true);
        let coefficients = (0..kind.len()).map(|k| [0, 1, 2].map(|c| fits[c].light[k] as f32)).collect();
        Light { kind, coefficients }
    });
    let texels = (0..observations.samples.len()).filter(|t| observations.is_used(*t)).count();
    Ok(LightFit { light, figures, frames: observations.frames.len(), texels })
}

/// The simplest kind that is not clearly worse.
fn needed(figures: &LightFigures) -> Option<LightKind> {
    let LightFigures { none, sh, transfer } = *figures;
    let (kind, error) = if sh < WORTHWHILE * none { (Some(LightKind::Sh), sh) } else { (None, none) };
    if transfer < WORTHWHILE * error { Some(LightKind::Transfer) } else { kind }
}

/// The parts of vertices, interpolated at a surface's texels: a row for each.
fn at_texels(parts: &Parts, faces: &[[u32; 3]], samples: &SurfaceSamples) -> DMatrix<f64> {
    DMatrix::from_fn(samples.len(), parts.columns.len(), |t, k| {
        let corners = faces[samples.faces[t] as usize].iter().zip(samples.barycentric[t]);
        corners.map(|(vertex, weight)| f64::from(parts.columns[k][*vertex as usize]) * weight).sum()
    })
}

/// Light and albedos of one channel.
#[derive(Debug, Clone, PartialEq)]
struct ChannelFit {
    light: DVector<f64>,
    albedo: DVector<f64>,
}

/// What frames show of the texels.
struct Observations {
    samples: SurfaceSamples,
    /// Frames, counted in the split.
    frames: Vec<usize>,
    /// Mean linear colour of each texel in each frame, `None` where no view shows it.
    colors: Vec<Vec<Option<[f64; 3]>>>,
}

impl Observations {
    fn new(gpu: &Gpu, capture: &Capture, split: &Split, poses: &[Pose]) -> Result<Observations, FloorError> {
        let observer = TexelObserver::new(gpu, capture, RESOLUTION)?;
        let mut frames: Vec<usize> = split.views.iter().map(|view| view.position).collect();
        frames.sort_unstable();
        frames.dedup();
        let frames = evenly(&frames, MOST_FRAMES);
        let mut colors = Vec::new();
        for frame in &frames {
            let views: Vec<&SplitView> = split.views.iter().filter(|view| view.position == *frame).collect();
            let mut sums = vec![[0.0; 4]; observer.samples().len()];
            for view in evenly(&views, VIEWS_PER_FRAME) {
                for (sum, seen) in sums.iter_mut().zip(observer.observe(view, &poses[*frame])?) {
                    let Some(TexelView { color, weight }) = seen else { continue };
                    for (s, value) in sum.iter_mut().zip(color) {
                        *s += weight * linear(value);
                    }
                    sum[3] += weight;
                }
            }
            colors.push(sums.iter().map(|s| (s[3] > 0.0).then(|| [0, 1, 2].map(|c| s[c] / s[3]))).collect());
        }
        Ok(Observations { samples: observer.samples().clone(), frames, colors })
    }

    /// Whether enough frames show a texel.
    fn is_used(&self, texel: usize) -> bool {
        self.colors.iter().filter(|frame| frame[texel].is_some()).count() >= LEAST_FRAMES
    }

    /// Light and albedos of the three channels from the frames chosen.
    fn fit(&self, kind: LightKind, parts: &[DMatrix<f64>], chosen: &(dyn Fn(usize) -> bool + Sync)) -> Vec<ChannelFit> {
        (0..3usize).into_par_iter().map(|channel| self.fit_channel(kind, parts, chosen, channel)).collect()
    }

    fn fit_channel(
        &self,
        kind: LightKind,
        parts: &[DMatrix<f64>],
        chosen: &dyn Fn(usize) -> bool,
        channel: usize,
    ) -> ChannelFit {
        let texels = self.samples.len();
        let unknowns = parts.first().map_or(0, DMatrix::ncols);
        let used: Vec<bool> = (0..texels).map(|t| self.is_used(t)).collect();
        let seen = |frame: usize, t: usize| if used[t] { self.colors[frame][t].map(|c| c[channel]) } else { None };
        let frames: Vec<usize> = (0..parts.len()).filter(|frame| chosen(*frame)).collect();
        let mut light = DVector::from_element(unknowns, 0.0);
        // Even light; with harmonics only the first one is constant.
        match kind {
            LightKind::Transfer => light.fill(1.0),
            LightKind::Sh => light.rows_mut(0, unknowns.min(1)).fill(1.0),
        }
        // All skin alike: what light explains is light.
        let mut albedo = DVector::from_element(texels, 1.0);
        for round in 0..=ROUNDS {
            if round > 0 || unknowns < 2 {
                albedo = fit_albedo(&frames, parts, &light, texels, &seen);
            }
            if round == ROUNDS || unknowns < 2 {
                break;
            }
            let mut matrix = DMatrix::zeros(unknowns, unknowns);
            let mut vector = DVector::zeros(unknowns);
            for f in &frames {
                let mut rows = parts[*f].clone();
                let mut values = DVector::zeros(texels);
                for (t, mut row) in rows.row_iter_mut().enumerate() {
                    let value = seen(*f, t);
                    row *= value.map_or(0.0, |_| albedo[t]);
                    values[t] = value.unwrap_or(0.0);
                }
                matrix += rows.tr_mul(&rows);
                vector += rows.tr_mul(&values);
            }
            let ridge = LIGHT_RIDGE * matrix.trace() / unknowns as f64;
            // Drawn to even light, so that directions that nothing shows are not dark.
            for k in 0..unknowns {
                matrix[(k, k)] += ridge;
                if kind == LightKind::Transfer {
                    vector[k] += ridge;
                }
            }
            light = match kind {
                LightKind::Transfer => non_negative(&matrix, &vector, light),
                LightKind::Sh => matrix.lu().solve(&vector).unwrap_or(light),
            };
            // Albedo carries the scale.
            let scale = match kind {
                LightKind::Transfer => light.mean(),
                LightKind::Sh => light[0],
            };
            if scale > 0.0 {
                light /= scale;
            }
        }
        ChannelFit { light, albedo }
    }

    /// Mean squared error of display values in the frames chosen.
    fn error(&self, parts: &[DMatrix<f64>], fits: &[ChannelFit], chosen: &dyn Fn(usize) -> bool) -> f64 {
        let mut errors = Vec::new();
        for (channel, fit) in fits.iter().enumerate() {
            for (f, parts) in parts.iter().enumerate().filter(|(f, _)| chosen(*f)) {
                let irradiance = parts * &fit.light;
                for (t, color) in self.colors[f].iter().enumerate().filter(|(t, _)| self.is_used(*t)) {
                    let Some(color) = color else { continue };
                    let display = shade(irradiance[t] * fit.albedo[t]).min(1.0);
                    errors.push((display - shade(color[channel])).powi(2));
                }
            }
        }
        mean(errors.into_iter())
    }
}

/// The albedos of all texels under a light, drawn to their mean.
fn fit_albedo(
    frames: &[usize],
    parts: &[DMatrix<f64>],
    light: &DVector<f64>,
    texels: usize,
    seen: &dyn Fn(usize, usize) -> Option<f64>,
) -> DVector<f64> {
    // Of each texel: sums of irradiance * colour and of irradiance^2.
    let mut sums = vec![[0.0; 2]; texels];
    for f in frames {
        let irradiance = &parts[*f] * light;
        for (t, sum) in sums.iter_mut().enumerate() {
            if let Some(value) = seen(*f, t) {
                sum[0] += irradiance[t] * value;
                sum[1] += irradiance[t] * irradiance[t];
            }
        }
    }
    let total = |k: usize| sums.iter().map(|sum| sum[k]).sum::<f64>();
    let mean = total(0) / total(1).max(f64::MIN_POSITIVE);
    DVector::from_iterator(texels, sums.iter().map(|sum| (sum[0] + ALBEDO_RIDGE * mean) / (sum[1] + ALBEDO_RIDGE)))
}

/// At most `most` of some items, evenly spaced.
fn evenly<T: Clone>(items: &[T], most: usize) -> Vec<T> {
    let count = items.len().min(most);
    (0..count).map(|i| items[i * items.len() / count].clone()).collect()
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0usize), |(sum, count), value| (sum + value, count + 1));
    sum / count.max(1) as f64
}

/// Sweeps of coordinate descent; the matrix is small and its diagonal strong.
const SWEEPS: usize = 400;

/// The minimum of `x^T A x / 2 - b^T x` without negative `x`, by coordinate descent from `x`.
fn non_negative(matrix: &DMatrix<f64>, vector: &DVector<f64>, mut x: DVector<f64>) -> DVector<f64> {
    for _ in 0..SWEEPS {
        for k in 0..x.len() {
            let gradient = matrix.column(k).dot(&x) - vector[k];
            if matrix[(k, k)] > 0.0 {
                x[k] = (x[k] - gradient / matrix[(k, k)]).max(0.0);
            }
        }
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_non_negative_minimum_meets_its_conditions() {
        let rows = DMatrix::from_fn(30, 6, |i, k| (1.7 * (i * (k + 1)) as f64 + k as f64).sin());
        let values = DVector::from_fn(30, |i, _| (0.9 * i as f64).cos());
        let (matrix, vector) = (rows.tr_mul(&rows), rows.tr_mul(&values));
        let x = non_negative(&matrix, &vector, DVector::from_element(6, 1.0));
        let gradient = &matrix * &x - &vector;
        assert!(x.iter().any(|x| *x == 0.0) && x.iter().any(|x| *x > 0.0), "{x}");
        for (x, g) in x.iter().zip(&gradient) {
            assert!(if *x > 0.0 { g.abs() < 1e-8 } else { *g > -1e-8 }, "{x}: {g}");
        }
    }

    #[test]
    fn the_simplest_light_that_explains_the_frames_is_taken() {
        let figures = |none, sh, transfer| LightFigures { none, sh, transfer };
        assert_eq!(needed(&figures(1.0, 0.95, 0.93)), None);
        assert_eq!(needed(&figures(1.0, 0.5, 0.47)), Some(LightKind::Sh));
        assert_eq!(needed(&figures(1.0, 0.5, 0.3)), Some(LightKind::Transfer));
        assert_eq!(needed(&figures(1.0, f64::NAN, f64::NAN)), None);
    }
}

//! Light and albedos from the colours of texels in many frames, by alternating least squares.
//!
//! Errors count as they are seen: those of dark skin, which say how bright the shadows are, as much as those of lit skin.
//! Large ones count less: the edge of a shadow is where template and hand differ.

use ghand_core::light::{DIRECTION_COUNT, DISPLAY_EXPONENT, linear, shade};
use ghand_core::statistics::median;
use nalgebra::{DMatrix, DVector, RowDVector};
use rayon::prelude::*;

/// Most turns of light and albedo, and the change of the light, as a fraction of it, that ends them.
const ROUNDS: usize = 40;
const SMALL_CHANGE: f64 = 1e-3;
/// Ridge on the light, as a fraction of the mean diagonal.
const LIGHT_RIDGE: f64 = 1e-3;
/// Ridge on how much the light of a channel differs from the mean of all three, likewise.
const COLOR_RIDGE: f64 = 0.1;
/// What [`LightModel::Lamps`] takes from the pull on each direction, as a fraction of the mean pull: what little is
/// gained by a lamp of its own there stays in the sky.
const SPARSITY: f64 = 0.03;
/// Ridge on the albedos, towards their mean: the squared ratio of what the model leaves unexplained to how much skin
/// varies. A hand that hardly turns does not tell light from skin otherwise.
const ALBEDO_RIDGE: f64 = 0.1;
/// Linear values below this count as much as it does: their errors are those of 8 bits and of stray light.
const DARKEST: f64 = 0.01;
/// Display values; errors of three times the median one, but at least of this, count half.
const LEAST_LARGE_ERROR: f64 = 0.03;
/// Sweeps of coordinate descent; the matrix is small and its diagonal strong.
const SWEEPS: usize = 400;

/// What is to be found of a light.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum LightModel {
    /// Nothing: all light is even.
    Constant,
    /// A sky that is the same from everywhere, and lamps in few of the directions.
    Lamps,
    /// The radiance of each direction.
    Directions,
}

/// The unknowns of a light: the columns of [`Parts`].
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Unknowns {
    pub model: LightModel,
    /// How many of the light's directions each is: their sum is all of them, and each lamp counts as one more.
    pub shares: DVector<f64>,
    /// Lamps near the hand, which come last.
    pub lamps: usize,
}

impl Unknowns {
    /// Even light.
    pub fn constant() -> Unknowns {
        Unknowns { model: LightModel::Constant, shares: DVector::from_element(1, DIRECTION_COUNT as f64), lamps: 0 }
    }

    /// All directions, and lamps.
    pub fn directions(model: LightModel, lamps: usize) -> Unknowns {
        Unknowns { model, shares: DVector::from_element(DIRECTION_COUNT + lamps, 1.0), lamps }
    }

    /// Light of which nothing is known: the same from everywhere.
    fn even(&self) -> DVector<f64> {
        let mut even = DVector::from_element(self.shares.len(), 1.0);
        even.rows_mut(self.shares.len() - self.lamps, self.lamps).fill(0.0);
        even
    }
}

/// What each unknown of a light gives some points of a hand.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Parts {
    /// Row by point, column by unknown.
    pub direct: DMatrix<f64>,
    /// Of even light, the part that does not reach each point past the hand.
    pub closed: DVector<f64>,
    /// The mean of each unknown over the hand.
    pub mean: RowDVector<f64>,
}

impl Parts {
    /// Those of even light for all of `count` points.
    pub fn constant(count: usize) -> Parts {
        let direct = DMatrix::from_element(count, 1, 1.0);
        Parts { direct, closed: DVector::zeros(count), mean: RowDVector::from_element(1, 1.0) }
    }

    /// Those of some of the points.
    pub fn select(&self, points: &[usize]) -> Parts {
        let closed = DVector::from_iterator(points.len(), points.iter().map(|t| self.closed[*t]));
        Parts { direct: self.direct.select_rows(points), closed, mean: self.mean.clone() }
    }

    /// What each unknown gives each point, with what skin throws on skin, times the point's factor; then `last`.
    fn scaled(&self, interreflection: f64, factors: &DVector<f64>, last: &DVector<f64>) -> DMatrix<f64> {
        let unknowns = self.direct.ncols();
        let mut rows = self.direct.clone().resize_horizontally(unknowns + 1, 0.0);
        rows.set_column(unknowns, last);
        for (mut column, mean) in rows.column_iter_mut().zip(self.mean.iter()) {
            if interreflection > 0.0 {
                column.axpy(interreflection * mean, &self.closed, 1.0);
            }
            column.component_mul_assign(factors);
        }
        rows
    }

    /// The irradiances of the points.
    fn irradiances(&self, light: &DVector<f64>, interreflection: f64) -> DVector<f64> {
        let thrown = interreflection * self.mean.transpose().dot(light);
        &self.direct * light + &self.closed * thrown
    }
}

/// What a frame shows of some texels.
pub(super) struct FrameColors {
    /// Which texels.
    pub texels: Vec<usize>,
    /// Their colours, linear.
    pub colors: Vec<[f64; 3]>,
    /// What the light gives each of them.
    pub parts: Parts,
}

impl FrameColors {
    /// Those of some texels, in order.
    pub fn of_texels(&self, texels: &[usize]) -> FrameColors {
        let shown: Vec<usize> =
            (0..self.texels.len()).filter(|i| texels.binary_search(&self.texels[*i]).is_ok()).collect();
        FrameColors {
            texels: shown.iter().map(|i| self.texels[*i]).collect(),
            colors: shown.iter().map(|i| self.colors[*i]).collect(),
            parts: self.parts.select(&shown),
        }
    }
}

/// Light and albedos of one channel.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct ChannelFit {
    pub light: DVector<f64>,
    pub albedo: DVector<f64>,
    /// See `ghand_avatar::AvatarLight::interreflection`.
    pub interreflection: f64,
}

impl ChannelFit {
    /// The irradiances of a frame's texels.
    fn irradiances(&self, frame: &FrameColors) -> DVector<f64> {
        frame.parts.irradiances(&self.light, self.interreflection)
    }
}

/// What some frames show in one channel.
struct Channel<'a> {
    frames: &'a [&'a FrameColors],
    /// The colours, linear, by frame.
    values: Vec<DVector<f64>>,
    /// The [`steepness`] there.
    steepness: Vec<DVector<f64>>,
}

/// Light and albedos of the three channels, linear, where skin throws this part of its light on skin.
pub(super) fn fit(
    unknowns: &Unknowns,
    frames: &[&FrameColors],
    texels: usize,
    interreflection: [f64; 3],
) -> Vec<ChannelFit> {
    let fits: Vec<ChannelFit> = (0..3usize)
        .into_par_iter()
        .map(|channel| fit_channel(unknowns, frames, texels, channel, interreflection[channel]))
        .collect();
    if unknowns.model == LightModel::Constant {
        return fits;
    }
    // Each channel for itself, light from where images hardly tell has any colour, which shadows then take.
    let gray = fits.iter().map(|fit| &fit.light).sum::<DVector<f64>>() / 3.0;
    let less_colored = |(number, fit): (usize, ChannelFit)| {
        let channel = Channel::new(frames, number);
        let weights = channel.robust_weights(&fit, &channel.irradiances(&fit));
        let light = channel.light(unknowns, &weights, &fit, &Pull { to: &gray, ridge: COLOR_RIDGE });
        let fit = ChannelFit { light, ..fit };
        ChannelFit { albedo: channel.albedo(&channel.irradiances(&fit), &weights, texels), ..fit }
    };
    fits.into_par_iter().enumerate().map(less_colored).collect()
}

/// What a light is drawn to.
struct Pull<'a> {
    to: &'a DVector<f64>,
    /// As a fraction of the mean diagonal.
    ridge: f64,
}

/// Light and albedos of one channel, linear.
pub(super) fn fit_channel(
    unknowns: &Unknowns,
    frames: &[&FrameColors],
    texels: usize,
    channel: usize,
    interreflection: f64,
) -> ChannelFit {
    let even = unknowns.even();
    if unknowns.model == LightModel::Constant {
        return ChannelFit { light: even, albedo: mean_colors(frames, texels, channel), interreflection: 0.0 };
    }
    let channel = Channel::new(frames, channel);
    // Directions that nothing shows are not dark: they are drawn to even light.
    let pull = Pull { to: &even, ridge: LIGHT_RIDGE };
    // All skin alike: what light explains is light.
    let mut fit = ChannelFit { light: even.clone(), albedo: DVector::from_element(texels, 1.0), interreflection };
    let mut weights: Vec<DVector<f64>> = channel.steepness.iter().map(|of| of.component_mul(of)).collect();
    for _ in 0..ROUNDS {
        let light = channel.light(unknowns, &weights, &fit, &pull);
        let change = (&light - &fit.light).norm();
        fit.light = light;
        let irradiances = channel.irradiances(&fit);
        fit.albedo = channel.albedo(&irradiances, &weights, texels);
        weights = channel.robust_weights(&fit, &irradiances);
        if change < SMALL_CHANGE * fit.light.norm() {
            break;
        }
    }
    fit
}

/// The texels' mean colours, taken over display values.
fn mean_colors(frames: &[&FrameColors], texels: usize, channel: usize) -> DVector<f64> {
    let mut sums = vec![[0.0; 2]; texels];
    for frame in frames {
        for (t, color) in frame.texels.iter().zip(&frame.colors) {
            sums[*t][0] += shade(color[channel]);
            sums[*t][1] += 1.0;
        }
    }
    let mean = sums.iter().map(|sum| sum[0]).sum::<f64>() / sums.iter().map(|sum| sum[1]).sum::<f64>().max(1.0);
    let of_texel = |[sum, count]: &[f64; 2]| linear(if *count > 0.0 { sum / count } else { mean });
    DVector::from_iterator(texels, sums.iter().map(of_texel))
}

impl<'a> Channel<'a> {
    fn new(frames: &'a [&'a FrameColors], channel: usize) -> Channel<'a> {
        let of_frame = |frame: &&FrameColors| {
            DVector::from_iterator(frame.colors.len(), frame.colors.iter().map(|color| color[channel]))
        };
        let values: Vec<DVector<f64>> = frames.iter().map(of_frame).collect();
        let steepness = values.iter().map(|values| values.map(steepness)).collect();
        Channel { frames, values, steepness }
    }

    fn irradiances(&self, fit: &ChannelFit) -> Vec<DVector<f64>> {
        self.frames.par_iter().map(|frame| fit.irradiances(frame)).collect()
    }

    /// The light under which the albedos of a fit look as they do, with a mean over the directions of 1: albedo carries the
    /// scale.
    fn light(&self, unknowns: &Unknowns, weights: &[DVector<f64>], fit: &ChannelFit, pull: &Pull) -> DVector<f64> {
        let count = fit.light.len();
        // The normal equations of a frame; their right side is the last column.
        let of_frame = |((frame, values), weights): ((&&FrameColors, &DVector<f64>), &DVector<f64>)| {
            let roots = weights.map(f64::sqrt);
            let albedo = frame.texels.iter().map(|t| fit.albedo[*t]);
            let factors = DVector::from_iterator(albedo.len(), albedo.zip(&roots).map(|(albedo, root)| albedo * root));
            let rows = frame.parts.scaled(fit.interreflection, &factors, &roots.component_mul(values));
            rows.transpose() * rows
        };
        let frames = self.frames.par_iter().zip(&self.values).zip(weights);
        let by_frame: Vec<DMatrix<f64>> = frames.map(of_frame).collect();
        let all = by_frame.iter().fold(DMatrix::zeros(count + 1, count + 1), |sum, of_frame| sum + of_frame);
        let mut matrix = all.view((0, 0), (count, count)).into_owned();
        let mut vector: DVector<f64> = all.view((0, count), (count, 1)).column(0).into_owned();
        // A lamp is found because it stands out: nothing needs to hold it.
        let directions = count - unknowns.lamps;
        let ridge = pull.ridge * matrix.diagonal().rows(0, directions).mean();
        for k in 0..directions {
            matrix[(k, k)] += ridge;
            vector[k] += ridge * pull.to[k];
        }
        let before = fit.light.clone();
        let mut light = match unknowns.model {
            LightModel::Directions => non_negative(&matrix, &vector, before),
            LightModel::Lamps => lamps_in_a_sky(&matrix, &vector, &before, unknowns.lamps),
            LightModel::Constant => before,
        };
        let scale = light.dot(&unknowns.shares) / DIRECTION_COUNT as f64;
        if scale > 0.0 {
            light /= scale;
        }
        light
    }

    /// The albedos of all texels under the light of a fit, drawn to their mean.
    fn albedo(&self, irradiances: &[DVector<f64>], weights: &[DVector<f64>], texels: usize) -> DVector<f64> {
        // Of each texel: sums of irradiance * colour and of irradiance^2.
        let mut sums = vec![[0.0; 2]; texels];
        for (k, frame) in self.frames.iter().enumerate() {
            for (i, t) in frame.texels.iter().enumerate() {
                let weighted = weights[k][i] * irradiances[k][i];
                sums[*t][0] += weighted * self.values[k][i];
                sums[*t][1] += weighted * irradiances[k][i];
            }
        }
        let total = |k: usize| sums.iter().map(|sum| sum[k]).sum::<f64>();
        let mean = total(0) / total(1).max(f64::MIN_POSITIVE);
        DVector::from_iterator(texels, sums.iter().map(|sum| (sum[0] + ALBEDO_RIDGE * mean) / (sum[1] + ALBEDO_RIDGE)))
    }

    /// The weights of squared linear errors at a fit with these irradiances.
    fn robust_weights(&self, fit: &ChannelFit, irradiances: &[DVector<f64>]) -> Vec<DVector<f64>> {
        let errors: Vec<DVector<f64>> = (0..self.frames.len())
            .map(|k| {
                let texels = &self.frames[k].texels;
                let fitted = texels.iter().zip(&irradiances[k]).map(|(t, irradiance)| fit.albedo[*t] * irradiance);
                (&self.values[k] - DVector::from_iterator(texels.len(), fitted)).component_mul(&self.steepness[k])
            })
            .collect();
        let typical = median(errors.iter().flatten().map(|error| error.abs()));
        let large = (3.0 * typical).max(LEAST_LARGE_ERROR);
        let weight = |steepness: f64, error: f64| steepness.powi(2) / (1.0 + (error / large).powi(2));
        self.steepness.iter().zip(&errors).map(|(steepness, errors)| steepness.zip_map(errors, weight)).collect()
    }
}

/// How much a display value changes with a linear one.
pub(super) fn steepness(linear: f64) -> f64 {
    DISPLAY_EXPONENT * linear.max(DARKEST).powf(DISPLAY_EXPONENT - 1.0)
}

/// Mean squared error of display values in some frames.
pub(super) fn squared_error(frames: &[&FrameColors], fits: &[ChannelFit]) -> f64 {
    let errors = fits.iter().enumerate().map(|(channel, fit)| squared_error_of(frames, fit, channel));
    errors.sum::<f64>() / fits.len().max(1) as f64
}

/// As [`squared_error`], of one channel.
pub(super) fn squared_error_of(frames: &[&FrameColors], fit: &ChannelFit, channel: usize) -> f64 {
    let (mut sum, mut count) = (0.0, 0usize);
    for frame in frames {
        let irradiance = fit.irradiances(frame);
        for (i, t) in frame.texels.iter().enumerate() {
            let display = shade(irradiance[i] * fit.albedo[*t]).min(1.0);
            sum += (display - shade(frame.colors[i][channel])).powi(2);
            count += 1;
        }
    }
    sum / count.max(1) as f64
}

/// The irradiance of each texel in each frame, RGB.
pub(super) fn irradiances(frames: &[FrameColors], fits: &[ChannelFit]) -> Vec<[f64; 3]> {
    let of_frame = |frame: &FrameColors| {
        let channels: Vec<DVector<f64>> = fits.iter().map(|fit| fit.irradiances(frame)).collect();
        (0..frame.texels.len()).map(|i| [0, 1, 2].map(|c| channels[c][i])).collect::<Vec<_>>()
    };
    frames.iter().flat_map(of_frame).collect()
}

/// How much brighter each frame is than a fit: the median ratio of its display values, over a mean logarithm of 0.
pub(super) fn frame_factors(frames: &[FrameColors], fits: &[ChannelFit]) -> Vec<f64> {
    let logarithm = |frame: &FrameColors| {
        let mut ratios = Vec::new();
        for (channel, fit) in fits.iter().enumerate() {
            let irradiance = fit.irradiances(frame);
            for (i, t) in frame.texels.iter().enumerate() {
                let seen = frame.colors[i][channel];
                let fitted = irradiance[i] * fit.albedo[*t];
                if seen.min(fitted) > DARKEST {
                    ratios.push(DISPLAY_EXPONENT * (seen / fitted).ln());
                }
            }
        }
        median(ratios)
    };
    let logarithms: Vec<f64> = frames.iter().map(logarithm).collect();
    let mean = logarithms.iter().sum::<f64>() / logarithms.len().max(1) as f64;
    logarithms.iter().map(|logarithm| (logarithm - mean).exp()).collect()
}

/// The light of least error, of which what is not the same from everywhere is sparse: directions are charged for their
/// radiance above the sky's, those that are bright already hardly at all. The last `lamps` unknowns are no directions:
/// they are no part of the sky, and charged for nothing.
fn lamps_in_a_sky(matrix: &DMatrix<f64>, vector: &DVector<f64>, before: &DVector<f64>, lamps: usize) -> DVector<f64> {
    let count = before.len();
    let directions = count - lamps;
    let even: DVector<f64> = matrix.columns(0, directions).column_sum();
    // The last unknown is the sky.
    let mut all = matrix.clone().resize(count + 1, count + 1, 0.0);
    all.view_mut((count, 0), (1, count)).tr_copy_from(&even);
    all.view_mut((0, count), (count, 1)).copy_from(&even);
    all[(count, count)] = even.rows(0, directions).sum();
    let before_directions = before.rows(0, directions);
    let sky = before_directions.min();
    let charge = SPARSITY * vector.rows(0, directions).mean();
    let mut values = vector.clone().resize_vertically(count + 1, vector.rows(0, directions).sum());
    let mut start = before.clone().resize_vertically(count + 1, sky);
    for k in 0..directions {
        start[k] -= sky;
        values[k] -= charge / (1.0 + start[k] / before_directions.mean());
    }
    let found = non_negative(&all, &values, start);
    let mut light = found.rows(0, count).into_owned();
    light.rows_mut(0, directions).add_scalar_mut(found[count]);
    light
}

/// The minimum of `x^T A x / 2 - b^T x` without negative `x`, by coordinate descent from `x`.
pub(super) fn non_negative(matrix: &DMatrix<f64>, vector: &DVector<f64>, mut x: DVector<f64>) -> DVector<f64> {
    for _ in 0..SWEEPS {
        let mut change = 0.0f64;
        for k in 0..x.len() {
            let gradient = matrix.column(k).dot(&x) - vector[k];
            if matrix[(k, k)] > 0.0 {
                let next = (x[k] - gradient / matrix[(k, k)]).max(0.0);
                change = change.max((next - x[k]).abs());
                x[k] = next;
            }
        }
        if change < 1e-9 * x.max() {
            break;
        }
    }
    x
}

#[cfg(test)]
mod tests {
    use ghand_core::light::{cosine_transfer, directions};
    use glam::DQuat;

    use super::*;

    #[test]
    fn the_non_negative_minimum_meets_its_conditions() {
        let rows = DMatrix::from_fn(30, 6, |i, k| (1.7 * (i * (k + 1)) as f64 + k as f64).sin());
        let values = DVector::from_fn(30, |i, _| (0.9 * i as f64).cos());
        let matrix = rows.tr_mul(&rows);
        let vector = rows.tr_mul(&values);
        let x = non_negative(&matrix, &vector, DVector::from_element(6, 1.0));
        let gradient = &matrix * &x - &vector;
        assert!(x.iter().any(|x| *x == 0.0) && x.iter().any(|x| *x > 0.0), "{x}");
        for (x, g) in x.iter().zip(&gradient) {
            assert!(if *x > 0.0 { g.abs() < 1e-8 } else { *g > -1e-8 }, "{x}: {g}");
        }
    }

    /// Parts of points that nothing hides.
    fn open_parts(direct: DMatrix<f64>) -> Parts {
        Parts { closed: DVector::zeros(direct.nrows()), mean: RowDVector::zeros(direct.ncols()), direct }
    }

    /// A lamp in a sky on balls of random skin, each turned otherwise in each frame.
    fn planted(lamp: usize, sky: f64) -> (Vec<FrameColors>, Vec<f64>) {
        let towards = directions();
        let albedo: Vec<f64> = (0..200).map(|t| 0.4 + 0.2 * (7.3 * t as f64).sin()).collect();
        let frame = |f: usize| {
            let turn = DQuat::from_euler(glam::EulerRot::XYZ, 0.1 * f as f64, -0.07 * f as f64, 0.05 * f as f64);
            let normal = |t: usize| turn * towards[(t * 13) % 64];
            let parts = DMatrix::from_fn(albedo.len(), 64, |t, k| cosine_transfer(normal(t), towards[k]));
            let color = |t: usize| {
                let irradiance: f64 = (0..64).map(|k| parts[(t, k)] * if k == lamp { 16.0 } else { sky }).sum();
                [irradiance * albedo[t]; 3]
            };
            let colors = (0..albedo.len()).map(color).collect();
            let parts = open_parts(parts.clone());
            FrameColors { texels: (0..albedo.len()).collect(), colors, parts }
        };
        ((0..10).map(frame).collect(), albedo)
    }

    #[test]
    fn a_lamp_in_a_sky_and_the_skin_under_them_are_found() {
        let lamps = Unknowns::directions(LightModel::Lamps, 0);
        for (lamp, sky) in [(5, 0.3), (40, 0.1)] {
            let (frames, albedo) = planted(lamp, sky);
            let found = &fit(&lamps, &frames.iter().collect::<Vec<_>>(), albedo.len(), [0.0; 3])[0];
            assert_eq!(found.light.imax(), lamp);
            let skies = found.light.iter().filter(|radiance| **radiance == found.light.min()).count();
            assert!(skies >= 60, "{skies} of 64 directions are the sky");
            let ratio = found.light.min() / found.light[lamp] / (sky / 16.0);
            assert!((0.8..1.25).contains(&ratio), "the sky has {ratio} of its strength");
            let mut ratios: Vec<f64> =
                found.albedo.iter().zip(&albedo).map(|(found, planted)| found / planted).collect();
            ratios.sort_by(f64::total_cmp);
            let middle = ratios[ratios.len() / 2];
            let mut errors: Vec<f64> = ratios.iter().map(|ratio| (ratio / middle - 1.0).abs()).collect();
            errors.sort_by(f64::total_cmp);
            assert!(errors[errors.len() / 2] < 0.05, "{}", errors[errors.len() / 2]);
        }
    }

    #[test]
    fn frames_that_are_brighter_than_the_light_explains_are_found() {
        let lamps = Unknowns::directions(LightModel::Lamps, 0);
        let (mut frames, albedo) = planted(5, 0.3);
        for frame in frames.iter_mut().step_by(2) {
            frame.colors.iter_mut().flatten().for_each(|value| *value *= linear(1.1));
        }
        let fits = fit(&lamps, &frames.iter().collect::<Vec<_>>(), albedo.len(), [0.0; 3]);
        for (f, factor) in frame_factors(&frames, &fits).iter().enumerate() {
            let expected = if f % 2 == 0 { 1.1f64.sqrt() } else { 1.0 / 1.1f64.sqrt() };
            assert!((factor / expected - 1.0).abs() < 0.02, "frame {f}: {factor} for {expected}");
        }
    }
}

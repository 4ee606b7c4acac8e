//! The light of a capture, from its images, before any splatting.
//!
//! A texel's mean colour in a frame, in linear light, is its albedo times its irradiance, which is linear in the light's
//! coefficients: albedo and light are fitted in turns ([`least_squares`]). Which kind of light a capture needs is decided
//! on frames that the fit has not seen. Gloss is found from the images of one frame ([`gloss`]). How far the light may be
//! trusted follows from the normals that the images show ([`coverage`]).

mod coverage;
mod gloss;
mod least_squares;
mod observations;

use std::time::Instant;

use ghand_avatar::light::{Gloss, IrradianceParts, Trust};
use ghand_avatar::{Light, LightKind};
use ghand_capture::{Capture, Split};
use ghand_core::light::{DIRECTION_COUNT, directions};
use ghand_core::{HandModel, InvalidHandModel, Pose};
use ghand_hand_model::SurfaceSamples;
use ghand_render::Gpu;
use glam::{DQuat, DVec3};
use nalgebra::DMatrix;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::texels::TexelError;
use crate::texels::frames::TexelFrames;
use coverage::Coverage;
use least_squares::{ChannelFit, FrameColors, LightModel, fit, frame_factors, irradiances, squared_error};
use observations::Observations;

pub use gloss::GlossFit;

/// How light is taken apart from skin.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum LightChoice {
    /// As frames that the fit has not seen require: [`crate::light_fit`].
    #[default]
    Auto,
    /// Light from directions, with shadows.
    Transfer,
    /// Not at all: colours are as the images show them.
    Off,
}

/// Whether the skin's gloss is modelled.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum GlossChoice {
    /// If it explains how the images of frames left out differ: [`crate::light_fit`].
    #[default]
    Auto,
    /// Wherever light comes from directions.
    Always,
    /// Never.
    Off,
}

/// Every this many frames, one is held out.
const HOLD_OUT: usize = 3;
/// Light must reduce the held-out error of none to less than this fraction.
const WORTHWHILE: f64 = 0.9;
/// Light from all directions must reduce that of few lamps to less than this fraction.
const BETTER_THAN_LAMPS: f64 = 0.95;
/// How often gloss is found and then taken from the images for the light.
const GLOSS_ROUNDS: usize = 2;
/// How often the directions are turned so that one of them is the brightest.
const TURNS: usize = 2;
/// Directions within this cosine of the brightest one belong to the same lamp: its neighbours, some 30 degrees away.
const SAME_LAMP: f64 = 0.8;

/// How well each kind of light explains frames that its fit has not seen: mean squared error of the display values.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct LightFigures {
    /// Each texel has one colour in all frames.
    pub none: f64,
    /// Directions with shadows: few lamps in an even sky.
    pub lamps: f64,
    /// Directions with shadows, each with a radiance of its own.
    pub transfer: f64,
}

/// The light found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LightFit {
    /// The light; `None` if none is apart from the colours.
    pub light: Option<Light>,
    /// What the skin mirrors of it, if that explains enough.
    pub gloss: Option<GlossFit>,
    /// The kinds compared.
    pub figures: LightFigures,
    /// Number of frames and texels that they come from.
    pub frames: usize,
    /// See `frames`.
    pub texels: usize,
    /// How much brighter than the fit each of these frames is: factors on display values with a mean logarithm of 0.
    pub frame_factors: Vec<f64>,
    /// Wall-clock time, seconds.
    pub seconds: f64,
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
    /// How much frames differ in brightness from what the light explains: standard deviation of the logarithm of display
    /// values.
    pub frames_differ: f64,
    /// Wall-clock time, seconds.
    pub seconds: f64,
    /// Unit vector towards the brightest part of the light, world axes: the mean of the directions by radiance above the
    /// mean; `null` without directions.
    pub towards: Option<[f64; 3]>,
    /// Mean trust in the light over all normals: the part of them for which images tell how much light falls on them.
    pub trusted: f64,
    /// What the skin mirrors; `null` without gloss.
    pub gloss: Option<GlossReport>,
}

/// A gloss in `metrics.json`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GlossReport {
    /// Roughness of the surface, 0 to 1.
    pub roughness: f64,
    /// Mean strength over joints and channels.
    pub mean_strength: f64,
    /// The part of the squared differences between the images of a frame left out that it leaves.
    pub squared_difference_left: f64,
}

impl LightFit {
    /// The fit as it is reported.
    pub fn report(&self) -> LightReport {
        LightReport {
            kind: self.light.as_ref().map(|light| light.kind),
            squared_error_left_out: self.figures,
            frames: self.frames,
            texels: self.texels,
            frames_differ: self.frames_differ(),
            seconds: self.seconds,
            towards: self.light.as_ref().and_then(towards),
            trusted: self.light.as_ref().and_then(|light| light.trust.as_ref()).map_or(1.0, Trust::mean),
            gloss: self.gloss.as_ref().map(GlossFit::report),
        }
    }
}

impl GlossFit {
    /// The fit as it is reported.
    fn report(&self) -> GlossReport {
        let Gloss { roughness, strengths } = &self.gloss;
        let all = strengths.as_flattened();
        let mean_strength = all.iter().map(|s| f64::from(*s)).sum::<f64>() / all.len().max(1) as f64;
        GlossReport { roughness: *roughness, mean_strength, squared_difference_left: self.left }
    }
}

impl LightFit {
    /// See [`LightReport::frames_differ`].
    pub fn frames_differ(&self) -> f64 {
        let squares = self.frame_factors.iter().map(|factor| factor.ln().powi(2)).sum::<f64>();
        (squares / self.frame_factors.len().max(1) as f64).sqrt()
    }
}

/// Unit vector towards the brightest part of a light from directions.
fn towards(light: &Light) -> Option<[f64; 3]> {
    let brightness = |c: &[f32; 3]| f64::from(c.iter().sum::<f32>()) / 3.0;
    let above = light.coefficients.iter().map(|c| (brightness(c) - 1.0).max(0.0));
    let sum: DVec3 = above.zip(light.directions()).map(|(weight, d)| d * weight).sum();
    (light.kind == LightKind::Transfer).then(|| sum.try_normalize()).flatten().map(|d| d.to_array())
}

/// Fits the light of a split. `poses` holds the poses of its frames; they are fitted already.
///
/// # Errors
/// [`TexelError`] if an image or the model is unusable.
pub fn fit_light(
    gpu: &Gpu,
    capture: &Capture,
    split: &Split,
    poses: &[Pose],
    choice: LightChoice,
    gloss: GlossChoice,
) -> Result<LightFit, TexelError> {
    let seen = TexelFrames::new(gpu, capture, split, poses)?;
    Ok(fit_light_to(&seen, &capture.template, poses, choice, gloss)?)
}

/// Whether a frame is left out of a fit that is judged by it, of `frames` in all.
fn held_out(frame: usize, frames: usize) -> bool {
    frame % HOLD_OUT == HOLD_OUT - 1 && frames >= 2 * HOLD_OUT
}

/// As [`fit_light`], from what is seen already.
///
/// # Errors
/// [`InvalidHandModel`] if a pose does not fit the template.
pub fn fit_light_to(
    texel_frames: &TexelFrames,
    template: &HandModel,
    poses: &[Pose],
    choice: LightChoice,
    gloss_choice: GlossChoice,
) -> Result<LightFit, InvalidHandModel> {
    let start = Instant::now();
    let seen = Observations::new(texel_frames, None);
    let model = template.without_blend_shapes();
    let texels = seen.samples.len();
    let held_out = |frame: usize| held_out(frame, seen.frames.len());
    let error = |unknowns: LightModel, columns: &[FrameColors]| {
        let (others, chosen): (Vec<_>, Vec<_>) = columns.iter().enumerate().partition(|(frame, _)| !held_out(*frame));
        let [others, chosen] = [others, chosen].map(|frames| frames.into_iter().map(|(_, f)| f).collect::<Vec<_>>());
        squared_error(&chosen, &fit(unknowns, &others, texels))
    };
    let all =
        |columns: &[FrameColors], unknowns: LightModel| fit(unknowns, &columns.iter().collect::<Vec<_>>(), texels);

    let constant = seen.frames.iter().enumerate().map(|(f, _)| seen.colors(f, DMatrix::from_element(texels, 1, 1.0)));
    let constant: Vec<FrameColors> = constant.collect();
    let mut turn = DQuat::IDENTITY;
    let mut transfer = columns(&seen, &model, poses, turn)?;
    for _ in 0..TURNS {
        let Some(further) = towards_peak(&all(&transfer, LightModel::Directions)) else { break };
        turn *= further;
        transfer = columns(&seen, &model, poses, turn)?;
    }
    let figures = LightFigures {
        none: error(LightModel::Constant, &constant),
        lamps: error(LightModel::Lamps, &transfer),
        transfer: error(LightModel::Directions, &transfer),
    };
    let unknowns = match choice {
        LightChoice::Off => LightModel::Constant,
        LightChoice::Transfer => directions_needed(&figures).0,
        LightChoice::Auto => needed(&figures),
    };
    let is_lit = unknowns != LightModel::Constant;
    let (turn, mut columns) = if is_lit { (turn, transfer) } else { (DQuat::IDENTITY, constant) };
    let coverage = Coverage::new(&seen, &model, poses, turn)?;
    let light = |columns: &[FrameColors], fits: &[ChannelFit]| {
        is_lit.then(|| {
            let coefficients = (0..DIRECTION_COUNT).map(|k| [0, 1, 2].map(|c| fits[c].light[k] as f32)).collect();
            let light = Light { kind: LightKind::Transfer, turn, coefficients, trust: None };
            Light { trust: coverage.trust(&light, &irradiances(columns, fits)), ..light }
        })
    };
    let mut fits = all(&columns, unknowns);
    let mut gloss: Option<GlossFit> = None;
    if gloss_choice != GlossChoice::Off && is_lit {
        for _ in 0..GLOSS_ROUNDS {
            let Some(light) = light(&columns, &fits) else { break };
            let first = gloss.as_ref().map(|found| found.gloss.roughness);
            let roughnesses = first.map_or(gloss::ROUGHNESSES.to_vec(), |roughness| vec![roughness]);
            let always = first.is_some() || gloss_choice == GlossChoice::Always;
            gloss = gloss::find(texel_frames, &model, poses, &light, &roughnesses, always)?;
            let Some(found) = &gloss else { break };
            // Skin and light are what is left without it.
            let mirrored = gloss::in_images(texel_frames, &model, poses, &light, &found.gloss)?;
            let matte = Observations::new(texel_frames, Some(&mirrored));
            columns.iter_mut().enumerate().for_each(|(frame, colors)| matte.recolor(frame, colors));
            fits = all(&columns, unknowns);
        }
    }
    let frame_factors = frame_factors(&columns, &fits);
    let frames = seen.frames.len();
    let texels = seen.used();
    let seconds = start.elapsed().as_secs_f64();
    let light = light(&columns, &fits);
    Ok(LightFit { light, gloss, figures, frames, texels, frame_factors, seconds })
}

/// What each coefficient of a light gives the texels in each frame.
fn columns(
    seen: &Observations,
    model: &HandModel,
    poses: &[Pose],
    turn: DQuat,
) -> Result<Vec<FrameColors>, InvalidHandModel> {
    let of_frame = |(f, frame): (usize, &usize)| {
        let parts = IrradianceParts::new(LightKind::Transfer, turn, model, &poses[*frame], &|_| true)?;
        Ok(seen.colors(f, at_texels(&parts, &model.faces, &seen.samples)))
    };
    seen.frames.par_iter().enumerate().map(of_frame).collect()
}

/// The parts of vertices, interpolated at a surface's texels: a row for each.
fn at_texels(parts: &IrradianceParts, faces: &[[u32; 3]], samples: &SurfaceSamples) -> DMatrix<f64> {
    DMatrix::from_fn(samples.len(), parts.columns.len(), |t, k| {
        let corners = faces[samples.faces[t] as usize].iter().zip(samples.barycentric[t]);
        corners.map(|(vertex, weight)| f64::from(parts.columns[k][*vertex as usize]) * weight).sum()
    })
}

/// The turn, in the light's own axes, from its brightest direction to the middle of the lamp around it; `None` if no
/// direction stands out.
fn towards_peak(fits: &[ChannelFit]) -> Option<DQuat> {
    let all = directions();
    let radiance = |k: usize| fits.iter().map(|fit| fit.light[k]).sum::<f64>() / fits.len() as f64;
    let brightest = (0..all.len()).max_by(|a, b| radiance(*a).total_cmp(&radiance(*b)))?;
    let lamp = (0..all.len()).filter(|k| all[*k].dot(all[brightest]) > SAME_LAMP);
    let middle: DVec3 = lamp.map(|k| all[k] * (radiance(k) - 1.0).max(0.0)).sum();
    Some(DQuat::from_rotation_arc(all[brightest], middle.try_normalize()?))
}

/// Directions, unless they are hardly better than no light.
fn needed(figures: &LightFigures) -> LightModel {
    let (directions, error) = directions_needed(figures);
    if error < WORTHWHILE * figures.none { directions } else { LightModel::Constant }
}

/// The simpler of the two kinds of directions, unless it is worse, and its error.
fn directions_needed(figures: &LightFigures) -> (LightModel, f64) {
    let LightFigures { lamps, transfer, .. } = *figures;
    if transfer < BETTER_THAN_LAMPS * lamps { (LightModel::Directions, transfer) } else { (LightModel::Lamps, lamps) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_simplest_light_that_explains_the_frames_is_taken() {
        let figures = |none, lamps, transfer| LightFigures { none, lamps, transfer };
        assert_eq!(needed(&figures(1.0, 0.93, 0.93)), LightModel::Constant);
        assert_eq!(needed(&figures(1.0, 0.3, 0.29)), LightModel::Lamps);
        assert_eq!(needed(&figures(1.0, 0.4, 0.3)), LightModel::Directions);
        assert_eq!(needed(&figures(1.0, f64::NAN, f64::NAN)), LightModel::Constant);
    }
}

//! The light of a capture, from its images, before any splatting.
//!
//! A texel's mean colour in a frame, in linear light, is its albedo times its irradiance, which is linear in the light's
//! coefficients: albedo and light are fitted in turns ([`least_squares`]). Which kind of light a capture needs is decided
//! on frames that the fit has not seen; so it is with lamps near the hand ([`lamps`]) and light that skin throws on skin
//! ([`interreflection`]). Gloss is found from the images of one frame ([`gloss`]). How far the light may be
//! trusted follows from the normals that the images show ([`coverage`]).

mod coverage;
mod gloss;
mod interreflection;
mod lamps;
mod least_squares;
mod observations;
mod report;
mod terms;

use std::time::Instant;

use ghand_avatar::Light;
use ghand_core::{HandModel, InvalidHandModel, Pose};
use serde::{Deserialize, Serialize};

use crate::texels::frames::TexelFrames;
use coverage::Coverage;
use least_squares::frame_factors;
use observations::Observations;
use terms::Terms;

pub use gloss::GlossFit;
pub use report::{GlossReport, LampReport, LightReport};

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

/// How often gloss is found and then taken from the images for the light.
const GLOSS_ROUNDS: usize = 2;

/// How well each kind of light explains frames that its fit has not seen: mean squared error of the display values.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct LightFigures {
    /// Each texel has one colour in all frames.
    pub none: f64,
    /// Directions with shadows: few lamps in an even sky.
    pub lamps: f64,
    /// Directions with shadows, each with a radiance of its own.
    pub transfer: f64,
    /// The better of the two, with the lamps near the hand that are kept, or with the one that is not; `None` if none was
    /// tried.
    #[serde(default)]
    pub near: Option<f64>,
    /// The best of these with light that skin throws on skin; `None` if that was not tried.
    #[serde(default)]
    pub interreflection: Option<f64>,
}

/// The light found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LightFit {
    /// The light; `None` if none is apart from the colours.
    pub light: Option<Light>,
    /// What the skin mirrors of it, if that explains enough.
    pub gloss: Option<GlossFit>,
    /// Light that skin throws on skin: see `ghand_avatar::AvatarLight`.
    #[serde(default)]
    pub interreflection: [f32; 3],
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

/// Fits the light of a split. `poses` holds the poses of its frames; they are fitted already.
///
/// # Errors
/// [`InvalidHandModel`] if a pose does not fit the template.
pub fn fit_light(
    texel_frames: &TexelFrames,
    template: &HandModel,
    poses: &[Pose],
    choice: LightChoice,
    gloss_choice: GlossChoice,
) -> Result<LightFit, InvalidHandModel> {
    fit_light_and_try(texel_frames, template, poses, choice, gloss_choice, None).map(|(fit, _)| fit)
}

/// What light and gloss leave unexplained in frames left out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unexplained {
    /// Mean squared error of the texels' colours, display values.
    pub of_frames: f64,
    /// The part of the squared differences between the images of a frame.
    pub of_differences: f64,
}

/// As [`fit_light`]; and what lamps and other terms that were found leave unexplained of the same images in other colours,
/// once their strengths are those of these colours. Where no light was found, it is searched for in these colours.
///
/// # Errors
/// [`InvalidHandModel`] if a pose does not fit the template.
pub fn fit_light_and_try(
    texel_frames: &TexelFrames,
    template: &HandModel,
    poses: &[Pose],
    choice: LightChoice,
    gloss_choice: GlossChoice,
    recolored: Option<&TexelFrames>,
) -> Result<(LightFit, Option<Unexplained>), InvalidHandModel> {
    let start = Instant::now();
    let seen = Observations::new(texel_frames, None);
    let model = template.without_blend_shapes();
    let mut terms = Terms::new(&seen, &model, poses, choice)?;
    if terms.is_lit() {
        terms.add_lamps();
        terms.add_interreflection();
    }
    let coverage = Coverage::new(&seen, &model, poses, terms.turn)?;
    let mut fits = terms.fits();
    let mut gloss: Option<GlossFit> = None;
    if gloss_choice != GlossChoice::Off {
        for _ in 0..GLOSS_ROUNDS {
            let Some(light) = terms.light(&coverage, &fits) else { break };
            let first = gloss.as_ref().map(|found| found.gloss.roughness);
            let roughnesses = first.map_or(gloss::ROUGHNESSES.to_vec(), |roughness| vec![roughness]);
            let always = first.is_some() || gloss_choice == GlossChoice::Always;
            gloss = gloss::find(texel_frames, &model, poses, &light, &roughnesses, always)?;
            let Some(found) = &gloss else { break };
            // Skin and light are what is left without it.
            let mirrored = gloss::in_images(texel_frames, &model, poses, &light, &found.gloss)?;
            terms.recolor(&Observations::new(texel_frames, Some(&mirrored)));
            fits = terms.fits();
        }
    }
    let fit = LightFit {
        light: terms.light(&coverage, &fits),
        gloss,
        interreflection: terms.interreflection.map(|part| part as f32),
        figures: terms.figures,
        frames: seen.frames.len(),
        texels: seen.used(),
        frame_factors: frame_factors(&terms.columns, &fits),
        seconds: start.elapsed().as_secs_f64(),
    };
    let Some(recolored) = recolored else { return Ok((fit, None)) };
    if fit.light.is_none() {
        let other = fit_light(recolored, template, poses, choice, gloss_choice)?;
        return Ok((fit, Some(other.unexplained())));
    }
    terms.recolor(&Observations::new(recolored, None));
    let of_frames = terms.squared_error();
    let mut of_differences = 1.0;
    if let Some(light) = terms.light(&coverage, &terms.fits()).filter(|_| gloss_choice != GlossChoice::Off) {
        let found = fit.gloss.as_ref().map(|found| found.gloss.roughness);
        let roughnesses = found.map_or(gloss::ROUGHNESSES.to_vec(), |roughness| vec![roughness]);
        let gloss = gloss::find(recolored, &model, poses, &light, &roughnesses, found.is_some())?;
        of_differences = gloss.map_or(1.0, |gloss| gloss.left);
    }
    Ok((fit, Some(Unexplained { of_frames, of_differences })))
}

#[cfg(test)]
mod tests {
    use ghand_avatar::AvatarLight;
    use ghand_avatar::light::{Lamp, Lamps};
    use ghand_core::Side;
    use ghand_core::light::DIRECTION_COUNT;
    use ghand_hand_model::builtin::builtin_hand;
    use ghand_hand_model::surface::sample_surface;
    use glam::DVec3;

    use super::*;
    use crate::texels::frames::TexelImage;
    use crate::texels::views::TexelView;

    /// What cameras all around see of a hand that turns, moves and bends in a light, and its poses. The skin is speckled,
    /// and pictures are noisy.
    fn planted(light: Light, interreflection: [f32; 3]) -> (TexelFrames, HandModel, Vec<Pose>) {
        let model = builtin_hand(Side::Right).unwrap().without_blend_shapes();
        let pose = |f: usize| {
            let mut pose = Pose::rest(model.joint_count());
            let wave = |rate: f64| (rate * f as f64).sin();
            pose.rotations.iter_mut().skip(1).for_each(|r| r.x = 0.7 * (0.5 + 0.5 * wave(0.9)));
            pose.rotations[0] = DVec3::new(1.4 * wave(0.7), 1.1 * wave(1.3), 0.5 * wave(2.1));
            pose.translation = 0.08 * DVec3::new(wave(1.1), wave(1.7), wave(2.3));
            pose
        };
        let poses: Vec<Pose> = (0..24).map(pose).collect();
        let samples = sample_surface(&model, 40).unwrap();
        let skin = |t: usize| [0.35, 0.22, 0.16].map(|c: f64| c * (1.0 + 0.3 * (12.9 * t as f64).sin()));
        let lit = AvatarLight { interreflection, ..AvatarLight::new(light, None, &samples) };
        let image = |(f, pose): (usize, &Pose)| {
            let eye = DVec3::Z;
            let shades = lit.of_gaussians(&model, pose, eye).unwrap().shades;
            let texel = |(t, shade): (usize, &[f32; 3])| {
                let noise = 0.01 * (78.2 * (t + 31 * f) as f64).sin();
                let lit = skin(t).map(ghand_core::light::shade);
                let color = [0, 1, 2].map(|c| (lit[c] * f64::from(shade[c]) + noise).clamp(0.0, 1.0));
                (!(t + f).is_multiple_of(3)).then_some(TexelView { color, weight: 0.8, edge: 1.0 })
            };
            vec![TexelImage { camera: 0, eye, texels: shades.iter().enumerate().map(texel).collect() }]
        };
        let images = poses.iter().enumerate().map(image).collect();
        (TexelFrames::of_images(samples, (0..poses.len()).collect(), images), model, poses)
    }

    /// A dim sky.
    fn sky() -> Light {
        Light { coefficients: vec![[0.15; 3]; DIRECTION_COUNT], ..Light::studio() }
    }

    fn found(light: Light, interreflection: [f32; 3]) -> LightFit {
        let (seen, model, poses) = planted(light, interreflection);
        let fit = fit_light(&seen, &model, &poses, LightChoice::Auto, GlossChoice::Off).unwrap();
        println!("{:?}", fit.report());
        fit
    }

    #[test]
    fn a_lamp_near_the_hand_is_found_where_it_stands() {
        let model = builtin_hand(Side::Right).unwrap();
        let place = Lamps::middle(&model.vertices);
        for (offset, radius) in [([-0.3, -0.25, 0.35], 0.05), ([0.5, -0.4, -0.2], 0.12)] {
            let lamp = Lamp { offset: DVec3::from(offset), radius, radiance: [50.0, 46.0, 40.0] };
            let fit = found(Light { lamps: Some(Lamps { place, reach: 1.0, lamps: vec![lamp] }), ..sky() }, [0.0; 3]);
            let lamps = fit.report().lamps;
            assert_eq!(lamps.len(), 1, "{:?}", fit.figures);
            let off = DVec3::from(lamps[0].position).distance(place + lamp.offset);
            assert!(off < 0.15 * lamp.offset.length(), "off by {off} m");
            assert!(fit.figures.near.unwrap() < 0.8 * fit.figures.lamps.min(fit.figures.transfer), "{:?}", fit.figures);
        }
    }

    #[test]
    fn distant_light_needs_no_lamp_and_dark_skin_throws_none_back() {
        let mut distant = sky();
        distant.coefficients[11] = [55.0, 50.0, 44.0];
        let fit = found(distant, [0.0; 3]);
        let near = fit.report().lamps.iter().filter(|lamp| lamp.distance < 2.0).count();
        assert!(fit.light.is_some() && near == 0, "{:?}", fit.report());
        assert!(fit.interreflection.iter().all(|part| *part < 0.1), "{:?}", fit.interreflection);
    }

    #[test]
    fn light_that_skin_throws_on_skin_is_found() {
        let mut light = sky();
        light.coefficients[11] = [55.0, 50.0, 44.0];
        let planted = [0.5, 0.3, 0.15];
        let fit = found(light, planted);
        for (found, planted) in fit.interreflection.iter().zip(planted) {
            assert!((found - planted).abs() < 0.1, "{:?}", fit.interreflection);
        }
    }
}

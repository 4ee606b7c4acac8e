//! What is reported of a light.

use ghand_avatar::light::{Gloss, Lamp, Trust};
use ghand_avatar::{Light, LightKind};
use glam::DVec3;
use serde::Serialize;

use super::{GlossFit, LightFigures, LightFit, Unexplained};

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
    /// Lamps near the hand.
    pub lamps: Vec<LampReport>,
    /// Light that skin throws on skin, as parts of the hand's mean irradiance, RGB.
    pub interreflection: [f32; 3],
}

/// A lamp in `metrics.json`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LampReport {
    /// Where it stands, metres, world axes.
    pub position: [f64; 3],
    /// Metres from the middle of the hand in the capture.
    pub distance: f64,
    /// Metres.
    pub radius: f64,
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
            lamps: self.light.as_ref().map(lamp_reports).unwrap_or_default(),
            interreflection: self.interreflection,
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
    /// What light and gloss leave unexplained: with the term that explains most.
    pub fn unexplained(&self) -> Unexplained {
        let LightFigures { none, lamps, transfer, near, interreflection } = self.figures;
        let of_light =
            [none, lamps, transfer].into_iter().chain(near).chain(interreflection).fold(f64::INFINITY, f64::min);
        Unexplained { of_frames: of_light, of_differences: self.gloss.as_ref().map_or(1.0, |gloss| gloss.left) }
    }

    /// See [`LightReport::frames_differ`].
    pub fn frames_differ(&self) -> f64 {
        let squares = self.frame_factors.iter().map(|factor| factor.ln().powi(2)).sum::<f64>();
        (squares / self.frame_factors.len().max(1) as f64).sqrt()
    }
}

fn lamp_reports(light: &Light) -> Vec<LampReport> {
    let Some(lamps) = &light.lamps else { return vec![] };
    let report = |lamp: &Lamp| LampReport {
        position: (lamps.place + light.turn * lamp.offset).to_array(),
        distance: lamp.offset.length(),
        radius: lamp.radius,
    };
    lamps.lamps.iter().map(report).collect()
}

/// Unit vector towards the brightest part of a light from directions.
fn towards(light: &Light) -> Option<[f64; 3]> {
    let brightness = |c: &[f32; 3]| f64::from(c.iter().sum::<f32>()) / 3.0;
    let above = light.coefficients.iter().map(|c| (brightness(c) - 1.0).max(0.0));
    let mut sum: DVec3 = above.zip(light.directions()).map(|(weight, d)| d * weight).sum();
    for lamp in light.lamps.iter().flat_map(|lamps| &lamps.lamps) {
        sum += light.turn * lamp.offset.normalize_or_zero() * brightness(&lamp.radiance);
    }
    (light.kind == LightKind::Transfer).then(|| sum.try_normalize()).flatten().map(|d| d.to_array())
}

//! Skinning weights as vertex colours: a heat map of one joint, and all joints at once.

use std::f64::consts::TAU;

use ghand_core::mesh::Texture;
use glam::{DVec2, DVec3};

use super::MeshError;
use crate::viridis::viridis;

/// The colour of [`weight_color`] at weight 0: a grey that does not occur in the ramp.
pub const NO_WEIGHT: DVec3 = DVec3::splat(0.72);
/// Weights below this fade to grey. A model's weights end at the edges of its triangles; without a fade the border of a
/// joint's region would be as jagged as these.
pub const FADED_WEIGHT: f64 = 0.1;
/// Number of texels of [`heat_texture`]: two neighbours differ by less than one 8-bit step.
const HEAT_TEXELS: u32 = 1024;

/// The colour of a weight, display values: [`NO_WEIGHT`] at 0, fading until [`FADED_WEIGHT`] into the ramp from dark
/// violet to yellow, which is for 1 and above. NaN is black.
pub fn weight_color(weight: f64) -> DVec3 {
    if weight.is_nan() {
        return DVec3::ZERO;
    }
    let weight = weight.clamp(0.0, 1.0);
    // A smooth step, without a kink at either end.
    let t = (weight / FADED_WEIGHT).min(1.0);
    NO_WEIGHT.lerp(viridis(weight), t * t * (3.0 - 2.0 * t))
}

/// [`weight_color`] as a texture one texel high, for [`joint_heat_uvs`]. With it, every pixel has the colour of its
/// interpolated weight, which interpolated vertex colours do not give.
pub fn heat_texture() -> Texture {
    let color = |texel: u32| weight_color(f64::from(texel) / f64::from(HEAT_TEXELS - 1));
    let rgb = (0..HEAT_TEXELS).map(|texel| color(texel).to_array().map(|v| (v * 255.0).round() as u8)).collect();
    Texture { width: HEAT_TEXELS, height: 1, rgb }
}

/// UVs of the colours of one joint's weights in [`heat_texture`], for row-major weights `[V][joint_count]`.
///
/// # Errors
/// [`MeshError::Invalid`] if the table's length does not match, the joint does not exist, or a weight is not finite.
pub fn joint_heat_uvs(weights: &[f64], joint_count: usize, joint: usize) -> Result<Vec<DVec2>, MeshError> {
    let texels = f64::from(HEAT_TEXELS);
    // From the centre of the first texel to the centre of the last.
    let uv = |weight: f64| DVec2::new((weight.clamp(0.0, 1.0) * (texels - 1.0) + 0.5) / texels, 0.5);
    let rows = rows(weights, joint_count)?;
    if joint >= joint_count {
        return MeshError::invalid("joint", format!("{joint} does not exist; there are {joint_count}, counted from 0"));
    }
    Ok(rows.map(|row| uv(row[joint])).collect())
}

/// Lightness of the joints' colours in OKLab, in rotation, so that neighbours along a finger also differ in lightness.
const LIGHTNESSES: [f64; 4] = [0.5, 0.74, 0.62, 0.86];
/// Their chroma: saturated, but mostly within the gamut of displays.
const CHROMA: f64 = 0.15;
/// Hue of the first joint, turns.
const FIRST_HUE: f64 = 0.05;
/// Change of hue from joint to joint, turns. Among whole degrees, this one keeps the colours of 25 joints (as in WebXR)
/// at least 0.087 apart in OKLab, and of any five consecutive joints 0.16.
const HUE_STEP: f64 = 141.0 / 360.0;

/// A distinct colour for each joint, display values.
pub fn joint_color(joint: usize) -> DVec3 {
    let hue = TAU * (FIRST_HUE + HUE_STEP * joint as f64);
    display_from_oklab(LIGHTNESSES[joint % LIGHTNESSES.len()], CHROMA * hue.cos(), CHROMA * hue.sin())
}

/// Display values (sRGB) of a colour in OKLab (Ottosson 2020), clamped to the gamut.
fn display_from_oklab(lightness: f64, a: f64, b: f64) -> DVec3 {
    let long = (lightness + 0.3963377774 * a + 0.2158037573 * b).powi(3);
    let medium = (lightness - 0.1055613458 * a - 0.0638541728 * b).powi(3);
    let short = (lightness - 0.0894841775 * a - 1.2914855480 * b).powi(3);
    let linear = DVec3::new(
        4.0767416621 * long - 3.3077115913 * medium + 0.2309699292 * short,
        -1.2684380046 * long + 2.6097574011 * medium - 0.3413193965 * short,
        -0.0041960863 * long - 0.7034186147 * medium + 1.7076147010 * short,
    );
    let encode = |v: f64| if v <= 0.0031308 { 12.92 * v } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 };
    DVec3::from(linear.clamp(DVec3::ZERO, DVec3::ONE).to_array().map(encode)).clamp(DVec3::ZERO, DVec3::ONE)
}

/// Colours of the vertices by all weights at once: the joints' colours ([`joint_color`]) mixed by weight, for
/// row-major weights `[V][joint_count]`.
///
/// # Errors
/// [`MeshError::Invalid`] if the table's length does not match, or a weight is not finite.
pub fn joint_mix(weights: &[f64], joint_count: usize) -> Result<Vec<DVec3>, MeshError> {
    let colors: Vec<DVec3> = (0..joint_count).map(joint_color).collect();
    let mix = |row: &[f64]| {
        let sum: DVec3 = row.iter().zip(&colors).map(|(weight, color)| *weight * *color).sum();
        sum.clamp(DVec3::ZERO, DVec3::ONE)
    };
    Ok(rows(weights, joint_count)?.map(mix).collect())
}

fn rows(weights: &[f64], joint_count: usize) -> Result<std::slice::ChunksExact<'_, f64>, MeshError> {
    if joint_count == 0 || !weights.len().is_multiple_of(joint_count) {
        let problem = format!("{} numbers are not rows of {joint_count} joints", weights.len());
        return MeshError::invalid("weights", problem);
    }
    if let Some(i) = weights.iter().position(|w| !w.is_finite()) {
        let vertex = i / joint_count;
        let joint = i % joint_count;
        return MeshError::invalid("weights", format!("vertex {vertex} has {} for joint {joint}", weights[i]));
    }
    Ok(weights.chunks_exact(joint_count))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// OKLab of display values.
    fn oklab(color: DVec3) -> DVec3 {
        let decode = |v: f64| if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) };
        let c = DVec3::from(color.to_array().map(decode));
        let cone = |r, g, b| c.dot(DVec3::new(r, g, b)).cbrt();
        let long = cone(0.4122214708, 0.5363325363, 0.0514459929);
        let medium = cone(0.2119034982, 0.6806995451, 0.1073969566);
        let short = cone(0.0883024619, 0.2817188376, 0.6299787005);
        DVec3::new(
            0.2104542553 * long + 0.7936177850 * medium - 0.0040720468 * short,
            1.9779984951 * long - 2.4285922050 * medium + 0.4505937099 * short,
            0.0259040371 * long + 0.7827717662 * medium - 0.8086757660 * short,
        )
    }

    #[test]
    fn heat_fades_from_grey_without_a_border_and_gets_lighter_with_the_weight() {
        let colors: Vec<DVec3> = (0..=1000).map(|i| oklab(weight_color(f64::from(i) / 1000.0))).collect();
        let faded = (1000.0 * FADED_WEIGHT) as usize;
        assert!(colors[faded..].windows(2).all(|pair| pair[1].x > pair[0].x));
        // Neighbouring patches can be distinguished from 0.02 on: no step is visible.
        assert!(colors.windows(2).all(|pair| pair[0].distance(pair[1]) < 0.01));
        // Halfway through the fade the colour is clearly visible, and beyond it no colour of the ramp is the grey.
        assert!(colors[faded / 2..].iter().all(|color| color.distance(oklab(NO_WEIGHT)) > 0.1));
        assert_eq!(weight_color(0.0), NO_WEIGHT);
        assert_eq!((weight_color(1.5), weight_color(-1.0)), (weight_color(1.0), NO_WEIGHT));
        assert_eq!(weight_color(f64::NAN), DVec3::ZERO);
    }

    #[test]
    fn the_heat_texture_has_the_colour_of_each_weight() {
        let texture = heat_texture();
        assert_eq!((texture.width, texture.height, texture.rgb.len()), (HEAT_TEXELS, 1, HEAT_TEXELS as usize));
        let weights: Vec<f64> = (0..=50).map(|i| f64::from(i) / 50.0).collect();
        for (uv, weight) in joint_heat_uvs(&weights, 1, 0).unwrap().iter().zip(&weights) {
            // As computed by a bilinear sampler.
            let at = uv.x * f64::from(HEAT_TEXELS) - 0.5;
            let texel = |i: f64| DVec3::from(texture.rgb[i as usize].map(|v| f64::from(v) / 255.0));
            let last = f64::from(HEAT_TEXELS - 1);
            let sampled = texel(at.floor()).lerp(texel((at.floor() + 1.0).min(last)), at - at.floor());
            // Texels are rounded to 8 bits.
            assert!(sampled.distance(weight_color(*weight)) < 0.004, "{weight}: {sampled} {}", weight_color(*weight));
        }
        assert!(joint_heat_uvs(&weights, 1, 1).is_err());
    }

    #[test]
    fn joints_have_distinct_colours() {
        let colors: Vec<DVec3> = (0..25).map(|k| oklab(joint_color(k))).collect();
        for i in 0..25 {
            for j in 0..i {
                let bound = if i - j < 5 { 0.14 } else { 0.08 };
                let apart = (colors[i] - colors[j]).length();
                assert!(apart > bound, "joints {j} and {i} are {apart} apart");
            }
        }
    }

    #[test]
    fn vertices_get_the_colours_of_their_rows() {
        let weights = [1.0, 0.0, 0.0, 0.25, 0.75, 0.0];
        let at = |weight: f64| DVec2::new((1023.0 * weight + 0.5) / 1024.0, 0.5);
        assert_eq!(joint_heat_uvs(&weights, 3, 1).unwrap(), [at(0.0), at(0.75)]);
        let mixed = 0.25 * joint_color(0) + 0.75 * joint_color(1);
        assert_eq!(joint_mix(&weights, 3).unwrap(), [joint_color(0), mixed]);
        assert!(joint_heat_uvs(&[], 3, 0).unwrap().is_empty());
    }

    #[test]
    fn unusable_weights_are_named() {
        let says = |error: MeshError, text: &str| assert!(error.to_string().contains(text), "{error}");
        says(joint_heat_uvs(&[1.0; 5], 3, 0).unwrap_err(), "5 numbers");
        says(joint_mix(&[1.0; 5], 0).unwrap_err(), "weights");
        says(joint_heat_uvs(&[1.0; 6], 3, 3).unwrap_err(), "joint: 3 does not exist; there are 3");
        says(joint_mix(&[0.5, 0.5, 0.0, f64::NAN], 2).unwrap_err(), "vertex 1 has NaN for joint 1");
    }
}

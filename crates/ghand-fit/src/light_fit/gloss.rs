//! What skin mirrors, from how a texel differs between the images of a frame: whatever does not depend on the eye cancels.

use ghand_avatar::Light;
use ghand_avatar::light::gloss::of_vertices;
use ghand_avatar::light::{Gloss, IrradianceParts};
use ghand_core::light::linear;
use ghand_core::{HandModel, InvalidHandModel, Pose};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::least_squares::{non_negative, steepness};
use super::terms::held_out;
use crate::texels::frames::TexelFrames;

/// The roughnesses compared. A smoother surface would show each of the light's directions as a lamp of its own.
pub(super) const ROUGHNESSES: [f64; 3] = [0.45, 0.55, 0.7];
/// Gloss must reduce the squared differences between images left out to less than this fraction.
const WORTHWHILE: f64 = 0.98;
/// Ridge on the joints' strengths, towards the hand's, as a fraction of the mean diagonal.
const RIDGE: f64 = 0.1;
/// Display values; differences of this size count half.
const LARGE_DIFFERENCE: f64 = 0.06;
/// A display value this bright may be brighter.
const BURNT: f64 = 0.98;
/// Rounds of robust least squares.
const ROUNDS: usize = 4;

/// The gloss of strength 1 that each image of each frame would show of each texel, linear RGB.
pub(super) type ImageGloss = Vec<Vec<Vec<[f32; 3]>>>;

/// The gloss found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct GlossFit {
    /// The gloss.
    pub gloss: Gloss,
    /// The part of the squared differences between the images of a frame that it leaves, in frames that its fit has not
    /// seen.
    pub left: f64,
}

/// Finds the gloss of a hand in a light from directions, of one of some roughnesses; `None` if it explains too little.
/// With `always` it is kept anyway.
pub(super) fn find(
    seen: &TexelFrames,
    model: &HandModel,
    poses: &[Pose],
    light: &Light,
    roughnesses: &[f64],
    always: bool,
) -> Result<Option<GlossFit>, InvalidHandModel> {
    let parts: Vec<IrradianceParts> =
        seen.frames.par_iter().map(|frame| light.parts(model, &poses[*frame])).collect::<Result<_, _>>()?;
    let mut best: Option<GlossFit> = None;
    for roughness in roughnesses {
        let shown = shown(seen, model, light, &parts, *roughness);
        let tried = |frame: &usize| !held_out(*frame, seen.frames.len());
        let all: Vec<usize> = (0..seen.frames.len()).collect();
        let (others, left_out): (Vec<usize>, Vec<usize>) = all.iter().partition(|frame| tried(frame));
        let differences = |frames: &[usize]| [0, 1, 2].map(|c| Differences::new(seen, &shown, frames, c));
        let [train, test] = [&others, &left_out].map(|frames| differences(frames));
        let strengths = [0, 1, 2].map(|c| train[c].strengths());
        let [error, whole] = [true, false].map(|with| {
            let none = DVector::zeros(seen.samples.joint_count);
            (0..3).map(|c| test[c].error(if with { &strengths[c] } else { &none })).sum::<f64>()
        });
        let left = if whole > 0.0 { error / whole } else { 1.0 };
        if best.as_ref().is_none_or(|best| left < best.left) {
            let all = differences(&all).map(|differences| differences.strengths());
            let strengths = (0..seen.samples.joint_count).map(|k| [0, 1, 2].map(|c| all[c][k] as f32)).collect();
            best = Some(GlossFit { gloss: Gloss { roughness: *roughness, strengths }, left });
        }
    }
    Ok(best.filter(|best| always || best.left < WORTHWHILE))
}

/// The gloss that images show of the texels, if it has a strength of 1.
fn shown(
    seen: &TexelFrames,
    model: &HandModel,
    light: &Light,
    parts: &[IrradianceParts],
    roughness: f64,
) -> ImageGloss {
    let images = seen.images.par_iter().zip(parts).map(|(images, parts)| {
        let image = |image: &crate::texels::frames::TexelImage| {
            let vertices = of_vertices(light, parts, roughness, image.eye);
            let texel = |t: usize| {
                let corners = model.faces[seen.samples.faces[t] as usize].iter().zip(seen.samples.barycentric[t]);
                corners.fold([0.0; 3], |sum, (v, weight)| {
                    [0, 1, 2].map(|c| sum[c] + weight as f32 * vertices[*v as usize][c])
                })
            };
            (0..seen.samples.len()).map(texel).collect()
        };
        images.iter().map(image).collect()
    });
    images.collect()
}

/// What gloss gives the images of the texels, linear RGB.
pub(super) fn in_images(
    seen: &TexelFrames,
    model: &HandModel,
    poses: &[Pose],
    light: &Light,
    gloss: &Gloss,
) -> Result<ImageGloss, InvalidHandModel> {
    let parts: Vec<IrradianceParts> =
        seen.frames.par_iter().map(|frame| light.parts(model, &poses[*frame])).collect::<Result<_, _>>()?;
    let mut images = shown(seen, model, light, &parts, gloss.roughness);
    let count = seen.samples.len();
    let strength = |t: usize| {
        let joints = gloss.strengths.iter().enumerate();
        joints
            .fold([0.0; 3], |sum, (k, s)| [0, 1, 2].map(|c| sum[c] + seen.samples.weights[k * count + t] as f32 * s[c]))
    };
    let strengths: Vec<[f32; 3]> = (0..count).map(strength).collect();
    for texels in images.iter_mut().flatten() {
        texels.iter_mut().zip(&strengths).for_each(|(value, s)| *value = [0, 1, 2].map(|c| value[c] * s[c]));
    }
    Ok(images)
}

/// How the images of a frame differ in one channel: each row says that gloss makes it so.
struct Differences {
    joints: usize,
    rows: Vec<Row>,
}

struct Row {
    /// The texel's colour in an image, less its mean over the frame's images, linear.
    color: f64,
    /// The same of the gloss of strength 1.
    gloss: f64,
    /// The joints that carry the texel, with their weights.
    joints: Vec<(usize, f64)>,
    /// From linear to display values, times the square root of how well the texel is seen.
    scale: f64,
}

impl Differences {
    fn new(seen: &TexelFrames, shown: &ImageGloss, frames: &[usize], channel: usize) -> Differences {
        let count = seen.samples.len();
        let joints = seen.samples.joint_count;
        let carriers: Vec<Vec<(usize, f64)>> = (0..count)
            .map(|t| (0..joints).map(|k| (k, seen.samples.weights[k * count + t])).filter(|(_, w)| *w > 0.01).collect())
            .collect();
        let mut rows = Vec::new();
        for frame in frames {
            for (t, joints) in carriers.iter().enumerate() {
                let views = seen.images[*frame].iter().zip(&shown[*frame]).filter_map(|(image, gloss)| {
                    let view = image.texels[t]?;
                    let value = view.color[channel];
                    (value < BURNT).then(|| (linear(value), f64::from(gloss[t][channel]), view.weight))
                });
                let views: Vec<(f64, f64, f64)> = views.collect();
                if views.len() < 2 {
                    continue;
                }
                let sum = |part: &dyn Fn(&(f64, f64, f64)) -> f64| views.iter().map(part).sum::<f64>();
                let whole = sum(&|view| view.2);
                let [color, gloss] = [sum(&|view| view.0 * view.2), sum(&|view| view.1 * view.2)].map(|s| s / whole);
                rows.extend(views.iter().map(|view| Row {
                    color: view.0 - color,
                    gloss: view.1 - gloss,
                    joints: joints.clone(),
                    scale: steepness(color) * view.2.sqrt(),
                }));
            }
        }
        Differences { joints, rows }
    }

    /// The weight of a row's squared linear difference from what gloss explains.
    fn weight(row: &Row, left: f64) -> f64 {
        let large = row.scale * left / LARGE_DIFFERENCE;
        row.scale * row.scale / (1.0 + large * large)
    }

    /// What a row's difference is beyond its gloss.
    fn left(row: &Row, strengths: &DVector<f64>) -> f64 {
        row.color - row.gloss * row.joints.iter().map(|(k, weight)| weight * strengths[*k]).sum::<f64>()
    }

    /// The robust squared error of some strengths.
    fn error(&self, strengths: &DVector<f64>) -> f64 {
        let error = |row: &Row| {
            let seen = row.scale * Self::left(row, strengths) / LARGE_DIFFERENCE;
            (1.0 + seen * seen).ln()
        };
        self.rows.iter().map(error).sum()
    }

    /// The strength of each joint, at least 0.
    fn strengths(&self) -> DVector<f64> {
        let mut strengths = DVector::zeros(self.joints);
        for _ in 0..ROUNDS {
            let mut matrix = DMatrix::<f64>::zeros(self.joints, self.joints);
            let mut vector = DVector::<f64>::zeros(self.joints);
            for row in &self.rows {
                let weight = Self::weight(row, Self::left(row, &strengths));
                for (j, a) in &row.joints {
                    vector[*j] += weight * row.gloss * a * row.color;
                    for (k, b) in &row.joints {
                        matrix[(*j, *k)] += weight * (row.gloss * a) * (row.gloss * b);
                    }
                }
            }
            let whole: f64 = matrix.sum();
            let hand = if whole > 0.0 { (vector.sum() / whole).max(0.0) } else { 0.0 };
            let ridge = RIDGE * matrix.trace() / self.joints as f64;
            for k in 0..self.joints {
                matrix[(k, k)] += ridge;
                vector[k] += ridge * hand;
            }
            let before = strengths;
            strengths = non_negative(&matrix, &vector, DVector::from_element(self.joints, hand));
            if (&strengths - before).norm() < 1e-3 * strengths.norm() {
                break;
            }
        }
        strengths
    }
}

#[cfg(test)]
mod tests {
    use ghand_core::Side;
    use ghand_core::light::shade;
    use ghand_hand_model::builtin::builtin_hand;
    use ghand_hand_model::surface::sample_surface;
    use glam::DVec3;

    use super::*;
    use crate::texels::frames::TexelImage;
    use crate::texels::views::TexelView;

    /// A hand that turns under a lamp, seen from all sides, and its gloss.
    fn planted(gloss: &Gloss) -> (TexelFrames, HandModel, Vec<Pose>, Light) {
        let model = builtin_hand(Side::Right).unwrap().without_blend_shapes();
        let mut coefficients = vec![[0.3; 3]; 64];
        coefficients[20] = [30.0, 28.0, 24.0];
        let light = Light { coefficients, ..Light::studio() };
        let poses: Vec<Pose> = (0..8)
            .map(|f| {
                let mut pose = Pose::rest(model.joint_count());
                pose.rotations[0] = DVec3::new(0.7 * f as f64, 0.3 * f as f64, 0.0);
                pose
            })
            .collect();
        let eyes: Vec<DVec3> =
            (0..5).map(|i| DVec3::new((1.3 * i as f64).sin(), 0.4, (1.3 * i as f64).cos())).collect();
        let samples = sample_surface(&model, 20).unwrap();
        let count = samples.len();
        let image = |eye: &DVec3| TexelImage { camera: 0, eye: *eye, texels: vec![None; count] };
        let images = poses.iter().map(|_| eyes.iter().map(image).collect()).collect();
        let mut seen = TexelFrames::of_images(samples, (0..poses.len()).collect(), images);
        let mirrored = in_images(&seen, &model, &poses, &light, gloss).unwrap();
        for (f, images) in seen.images.iter_mut().enumerate() {
            for (i, image) in images.iter_mut().enumerate() {
                for (t, texel) in image.texels.iter_mut().enumerate() {
                    // Skin in any light, the same in all images of the frame, and some noise.
                    let matte = 0.2 + 0.1 * (1.7 * (t + 31 * f) as f64).sin();
                    let noise = 0.01 * (12.9 * (t + 7 * i + 3 * f) as f64).sin();
                    let color = [0, 1, 2].map(|c| shade(matte + f64::from(mirrored[f][i][t][c])) + noise);
                    let seen = (t + 2 * i + f) % 3 != 0;
                    *texel = seen.then_some(TexelView { color: color.map(|v| v.min(1.0)), weight: 0.8, edge: 1.0 });
                }
            }
        }
        (seen, model, poses, light)
    }

    #[test]
    fn a_planted_gloss_is_found() {
        let strengths = (0..25).map(|k| [0.4 + 0.02 * k as f32; 3]).collect();
        let planted_gloss = Gloss { roughness: 0.45, strengths };
        let (seen, model, poses, light) = planted(&planted_gloss);
        let found = find(&seen, &model, &poses, &light, &ROUGHNESSES, false).unwrap().unwrap();
        assert_eq!(found.gloss.roughness, 0.45);
        assert!(found.left < 0.8, "{}", found.left);
        let [found, planted] = [&found.gloss, &planted_gloss].map(|gloss| gloss.vertex_strengths(&model));
        let mut errors: Vec<f32> = found.iter().zip(&planted).map(|(f, p)| (f[1] / p[1] - 1.0).abs()).collect();
        errors.sort_by(f32::total_cmp);
        assert!(errors[errors.len() / 2] < 0.1, "{}", errors[errors.len() / 2]);
    }

    #[test]
    fn matte_skin_has_no_gloss() {
        let matte = Gloss { roughness: 0.5, strengths: vec![[0.0; 3]; 25] };
        let (seen, model, poses, light) = planted(&matte);
        assert_eq!(find(&seen, &model, &poses, &light, &ROUGHNESSES, false).unwrap(), None);
        let forced = find(&seen, &model, &poses, &light, &ROUGHNESSES, true).unwrap().unwrap();
        assert!(forced.gloss.strengths.as_flattened().iter().all(|s| *s < 0.1), "{:?}", forced.gloss);
    }
}

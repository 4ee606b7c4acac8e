//! Position maps, the inputs of the encoders, and how features are taken from maps at the Gaussians' texels.

use burn_tensor::{Device, Int, Tensor, TensorData};
use ghand_core::HandModel;
use ghand_core::skeleton::pose_skeleton;
use ghand_hand_model::{HandModelError, SurfaceSamples, surface};
use glam::{DVec2, DVec3};

/// Positions are given to the networks in multiples of this, metres, from the root joint: about from -1 to 1.
const UNIT: f64 = 0.1;

/// The hand's surface as an image over its UV atlas.
#[derive(Debug, Clone)]
pub(crate) struct PositionMap {
    samples: SurfaceSamples,
    parents: Vec<Option<usize>>,
    /// The model's root joint, metres.
    root: DVec3,
}

impl PositionMap {
    /// A map of `side` x `side` texels.
    ///
    /// # Errors
    /// [`HandModelError`] if the model has no usable UV atlas at this resolution.
    pub fn new(model: &HandModel, side: usize) -> Result<PositionMap, HandModelError> {
        let samples = surface::sample_surface(model, side as u32)?;
        let root = model.joints.first().copied().unwrap_or_default();
        Ok(PositionMap { samples, parents: model.parents.clone(), root })
    }

    /// The rest hand, `[3][side][side]`, in units of 0.1 m from the root joint; 0 where the atlas is empty.
    pub fn rest(&self) -> Vec<f64> {
        self.image(|point| self.samples.positions[point])
    }

    /// The hand posed by plain skinning, without its global rotation and translation: how a hand looks must not depend
    /// on where it is. `joints` are the rest joints, metres, `rotations` axis-angles, one per joint; the first, the
    /// root's, is ignored.
    pub fn posed(&self, joints: &[DVec3], rotations: &[DVec3]) -> Vec<f64> {
        let mut rotations = rotations.to_vec();
        rotations.iter_mut().take(1).for_each(|root| *root = DVec3::ZERO);
        let bones = pose_skeleton(&self.parents, joints, &rotations).posed_from_rest;
        let count = self.samples.len();
        self.image(|point| {
            let rest = self.samples.positions[point];
            let weight = |joint: usize| self.samples.weights[joint * count + point];
            bones.iter().enumerate().map(|(joint, bone)| weight(joint) * bone.apply(rest)).sum()
        })
    }

    fn image(&self, position: impl Fn(usize) -> DVec3) -> Vec<f64> {
        let texels = (self.samples.resolution * self.samples.resolution) as usize;
        let mut image = vec![0.0; 3 * texels];
        for (point, texel) in self.samples.texels.iter().enumerate() {
            let value = (position(point) - self.root) / UNIT;
            (0..3).for_each(|c| image[c * texels + *texel as usize] = value[c]);
        }
        image
    }

    /// Rows and columns.
    pub fn side(&self) -> usize {
        self.samples.resolution as usize
    }
}

/// The UV of each Gaussian: the centres of the texels that an avatar of this resolution consists of.
///
/// # Errors
/// [`HandModelError`] if the model has no usable UV atlas at this resolution.
pub(crate) fn gaussian_uvs(model: &HandModel, uv_resolution: u32) -> Result<Vec<DVec2>, HandModelError> {
    let samples = surface::sample_surface(model, uv_resolution)?;
    let center = |index: u32| (f64::from(index) + 0.5) / f64::from(uv_resolution);
    let uv = |texel: &u32| DVec2::new(center(texel % uv_resolution), center(texel / uv_resolution));
    Ok(samples.texels.iter().map(uv).collect())
}

/// Corners between which a bilinear sample lies, as texels of a map of `side` x `side`, and how much each counts.
pub(super) fn bilinear(uv: DVec2, side: usize) -> [(usize, f64); 4] {
    // Texel centres are at whole numbers; beyond the outermost the map continues with its last value.
    let at = (uv * side as f64 - 0.5).clamp(DVec2::ZERO, DVec2::splat((side - 1) as f64));
    let low = at.floor().min(DVec2::splat(side.saturating_sub(2) as f64));
    let part = at - low;
    let first = low.y as usize * side + low.x as usize;
    let [right, below] = [usize::from(side > 1), if side > 1 { side } else { 0 }];
    [
        (first, (1.0 - part.x) * (1.0 - part.y)),
        (first + right, part.x * (1.0 - part.y)),
        (first + below, (1.0 - part.x) * part.y),
        (first + right + below, part.x * part.y),
    ]
}

/// Takes features from maps, bilinearly, at the Gaussians' texels.
#[derive(Debug)]
pub(super) struct FeatureSampler {
    /// UV of each Gaussian, `[N][2]`.
    pub uv: Tensor<2>,
    /// Texels, `[4 N]`: the first corner of all Gaussians, then the second, ...
    texels: Tensor<1, Int>,
    /// How much they count, `[4][N][1]`.
    weights: Tensor<3>,
}

impl FeatureSampler {
    /// At these places of maps of `side` x `side` texels.
    pub fn new(uvs: &[DVec2], side: usize, device: &Device) -> FeatureSampler {
        let count = uvs.len();
        let corners: Vec<_> = uvs.iter().map(|uv| bilinear(*uv, side)).collect();
        let by_corner = || (0..4).flat_map(|k| corners.iter().map(move |of_point| of_point[k]));
        let texels: Vec<i64> = by_corner().map(|(texel, _)| texel as i64).collect();
        let weights: Vec<f32> = by_corner().map(|(_, weight)| weight as f32).collect();
        let uv: Vec<f32> = uvs.iter().flat_map(|uv| uv.as_vec2().to_array()).collect();
        FeatureSampler {
            uv: Tensor::from_data(TensorData::new(uv, [count, 2]), device),
            texels: Tensor::from_data(TensorData::new(texels, [4 * count]), device),
            weights: Tensor::from_data(TensorData::new(weights, [4, count, 1]), device),
        }
    }

    /// `[1][features][side][side]` to `[N][features]`.
    pub fn sample(&self, map: Tensor<4>) -> Tensor<2> {
        let [_, features, rows, columns] = map.dims();
        let count = self.uv.dims()[0];
        let by_texel = map.reshape([features, rows * columns]).transpose();
        let corners = by_texel.select(0, self.texels.clone()).reshape([4, count, features]);
        (corners * self.weights.clone()).sum_dim(0).reshape([count, features])
    }
}

#[cfg(test)]
mod tests {
    use ghand_test_support::procedural_hand::ProceduralHand;

    use super::*;

    #[test]
    fn a_sample_is_bilinear_between_texel_centres_and_constant_beyond() {
        let side = 8;
        // Value of a map that is linear in u and v, at a texel.
        let value = |texel: usize| {
            let center = |i: usize| (i as f64 + 0.5) / side as f64;
            3.0 * center(texel % side) - 2.0 * center(texel / side)
        };
        let sampled = |uv| bilinear(uv, side).iter().map(|(texel, weight)| weight * value(*texel)).sum::<f64>();
        for uv in [DVec2::new(0.3, 0.77), DVec2::new(0.0625, 0.0625), DVec2::new(0.9375, 0.5), DVec2::new(0.5, 0.9)] {
            assert!((sampled(uv) - (3.0 * uv.x - 2.0 * uv.y)).abs() < 1e-12, "{uv}");
        }
        assert_eq!(sampled(DVec2::ZERO), value(0));
        assert_eq!(sampled(DVec2::ONE), value(side * side - 1));
    }

    #[test]
    fn where_the_hand_is_and_how_it_is_turned_does_not_change_its_map() {
        let model = ProceduralHand { detail: 1, ..Default::default() }.build().unwrap();
        let map = PositionMap::new(&model, 32).unwrap();
        let mut rotations = vec![DVec3::ZERO; model.joint_count()];
        let close = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-6);
        assert!(close(&map.posed(&model.joints, &rotations), &map.rest()));
        rotations[0] = DVec3::new(0.3, -1.0, 0.4);
        assert!(close(&map.posed(&model.joints, &rotations), &map.rest()));
        rotations[2] = DVec3::new(0.0, 0.0, 0.8);
        assert!(!close(&map.posed(&model.joints, &rotations), &map.rest()));
        assert!(map.rest().iter().all(|x| x.abs() < 3.0), "units of a decimetre");
    }
}

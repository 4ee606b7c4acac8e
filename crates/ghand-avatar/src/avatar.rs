//! What an avatar is: a sampled template, its switches, and the learned tables.

use ghand_core::blend_shapes::CoefficientLayout;
use ghand_core::mesh::RenderMesh;
use ghand_core::residual_skeleton::ResidualSkeleton;
use ghand_core::skinning::ResidualWeights;
use ghand_core::{HandModel, Side};
use ghand_hand_model::{HandModelError, SurfaceSamples, surface};
use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::local_thickness::local_thickness;
use crate::properties::PropertyTables;
use crate::properties::direct::{DirectTables, START_SCALE};

/// Choices that fix the shape of an avatar's tables and what they mean.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct AvatarConfig {
    /// Resolution of the UV raster whose texels are the Gaussians: the level of detail.
    pub uv_resolution: u32,
    /// Number of shape bases, n.
    pub shape_bases: usize,
    /// Whether a blend coefficient is one number or, as in the paper, three.
    #[serde(skip_serializing_if = "is_default")]
    pub coefficients: CoefficientLayout,
    /// Number of pose-dependent colour components of a Gaussian.
    pub color_components: usize,
    /// What the residual skinning weights mean.
    pub residual_weights: ResidualWeights,
    /// Where the residual skeleton stands.
    pub residual_skeleton: ResidualSkeleton,
}

impl Default for AvatarConfig {
    fn default() -> Self {
        AvatarConfig {
            uv_resolution: 128,
            shape_bases: 8,
            coefficients: CoefficientLayout::default(),
            color_components: 4,
            residual_weights: ResidualWeights::default(),
            residual_skeleton: ResidualSkeleton::default(),
        }
    }
}

/// Left out of files: they stay as they were before there was a choice.
fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

impl AvatarConfig {
    /// Rows of the blend coefficients.
    pub fn coefficient_rows(&self) -> usize {
        self.coefficients.rows() * self.shape_bases
    }

    /// Channels of the `direct` model's pose response: coefficient rows, then colour components.
    pub fn channels(&self) -> usize {
        self.coefficient_rows() + self.color_components
    }
}

/// The hand model as an avatar needs it: its skeleton and its N sampled surface points.
#[derive(Debug, Clone, PartialEq)]
pub struct Template {
    /// Name of the hand model.
    pub name: String,
    /// Which hand it is.
    pub side: Side,
    /// Names of the `n_b` joints.
    pub joint_names: Vec<String>,
    /// Parent of each joint.
    pub parents: Vec<Option<usize>>,
    /// Rest joints, metres.
    pub joints: Vec<DVec3>,
    /// Rest positions `[3][N]`, metres.
    pub rest: Vec<f32>,
    /// Skinning weights `[n_b][N]`.
    pub weights: Vec<f32>,
    /// Size of the surface that each Gaussian stands for, N, metres.
    pub spacings: Vec<f32>,
}

impl Template {
    /// Samples a hand model.
    ///
    /// # Errors
    /// [`HandModelError`] if the model has no usable UV atlas at that resolution.
    pub fn sample(model: &HandModel, uv_resolution: u32) -> Result<Template, HandModelError> {
        Ok(Template::from_samples(model, &surface::sample_surface(model, uv_resolution)?))
    }

    fn from_samples(model: &HandModel, samples: &SurfaceSamples) -> Template {
        let rest = (0..3).flat_map(|c| samples.positions.iter().map(move |p| p[c] as f32)).collect();
        Template {
            name: model.name.clone(),
            side: model.side,
            joint_names: model.joint_names.clone(),
            parents: model.parents.clone(),
            joints: model.joints.clone(),
            rest,
            weights: samples.weights.iter().map(|w| *w as f32).collect(),
            spacings: samples.spacings.iter().map(|s| *s as f32).collect(),
        }
    }

    /// Number of Gaussians, N.
    pub fn len(&self) -> usize {
        self.spacings.len()
    }

    /// Whether there are no Gaussians.
    pub fn is_empty(&self) -> bool {
        self.spacings.is_empty()
    }

    /// Number of joints, `n_b`.
    pub fn joint_count(&self) -> usize {
        self.joints.len()
    }

    /// Mean size of the surface of one Gaussian, metres.
    pub fn mean_spacing(&self) -> f32 {
        self.spacings.iter().sum::<f32>() / self.len().max(1) as f32
    }
}

/// Where an avatar comes from.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Provenance {
    /// Name of the capture.
    pub capture: String,
    /// Split that it was trained on.
    pub split: String,
    /// Training iterations.
    pub iterations: u64,
    /// Seed.
    pub seed: u64,
    /// Version of ghand.
    pub version: String,
}

/// A hand avatar.
#[derive(Debug, Clone, PartialEq)]
pub struct Avatar {
    /// The sampled hand model.
    pub template: Template,
    /// The hand model's mesh, for overlays and for picking named poses.
    pub model: HandModel,
    /// Shape and meaning of the tables.
    pub config: AvatarConfig,
    /// What the property model has learned.
    pub tables: PropertyTables,
    /// Where it comes from.
    pub provenance: Provenance,
}

/// How far inside of the surface Gaussians start, in standard deviations. At the silhouette a line of sight grazes about
/// ten Gaussians in a row, and ten of them together cover half where each covers 7 %: at 2.3 standard deviations.
pub const DEFAULT_INSET: f64 = 2.0;
/// How deep Gaussians may start, as a part of the hand's thickness there: the bone's axis is at a half, and beyond it a
/// Gaussian would lie nearer to the other side.
const DEEPEST_INSET: f64 = 1.0 / 3.0;
/// Largest standard deviation of a Gaussian in multiples of the mean spacing.
const MAX_SCALE: f32 = 4.0;

impl Avatar {
    /// An untrained avatar: the template's plain surface in one colour (display values 0..1). `seed` fixes the small
    /// random numbers from which training breaks symmetry; the Gaussians start [`DEFAULT_INSET`] inside of the surface.
    ///
    /// # Errors
    /// [`HandModelError`] if the model cannot be sampled.
    pub fn untrained(
        model: &HandModel,
        config: &AvatarConfig,
        color: [f64; 3],
        seed: u64,
    ) -> Result<Avatar, HandModelError> {
        Avatar::untrained_inset(model, config, color, DEFAULT_INSET, seed)
    }

    /// As [`Avatar::untrained`], with the Gaussians `inset` times their size inside of the surface, but no deeper than a third
    /// of the hand's thickness.
    ///
    /// # Errors
    /// [`HandModelError`] if the model cannot be sampled.
    pub fn untrained_inset(
        model: &HandModel,
        config: &AvatarConfig,
        color: [f64; 3],
        inset: f64,
        seed: u64,
    ) -> Result<Avatar, HandModelError> {
        let samples = surface::sample_surface(model, config.uv_resolution)?;
        let template = Template::from_samples(model, &samples);
        let thickness = local_thickness(model, &samples);
        let insets: Vec<f64> = (template.spacings.iter().zip(&thickness))
            .map(|(spacing, thickness)| (inset * f64::from(START_SCALE * spacing)).min(DEEPEST_INSET * thickness))
            .collect();
        let tables = DirectTables::untrained(&template, &samples.normals, &insets, config, color, seed);
        Ok(Avatar {
            template,
            model: model.without_blend_shapes(),
            config: config.clone(),
            tables: PropertyTables::Direct(tables),
            provenance: Provenance::default(),
        })
    }

    /// Largest standard deviation of a Gaussian, metres.
    pub fn max_scale(&self) -> f32 {
        MAX_SCALE * self.template.mean_spacing()
    }

    /// The template's mesh with one UV a vertex.
    pub fn render_mesh(&self) -> RenderMesh {
        RenderMesh::from_model(&self.model)
    }
}

/// See [`Avatar::max_scale`].
pub(crate) fn max_scale(template: &Template) -> f32 {
    MAX_SCALE * template.mean_spacing()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

    use ghand_hand_model::procedural::ProceduralHand;

    use super::*;

    /// Depth of each Gaussian of an untrained avatar, metres.
    fn depths(avatar: &Avatar) -> Vec<f64> {
        let PropertyTables::Direct(tables) = &avatar.tables;
        let n = avatar.template.len();
        let at = |c: usize, p: usize| f64::from(tables.shape_basis[c * n + p]);
        (0..n).map(|p| DVec3::new(at(0, p), at(1, p), at(2, p)).length()).collect()
    }

    #[test]
    fn gaussians_start_no_deeper_than_a_third_of_the_hand() {
        let model = ProceduralHand::default().build().unwrap();
        let config = AvatarConfig { uv_resolution: 96, ..Default::default() };
        let samples = surface::sample_surface(&model, 96).unwrap();
        let thickness = local_thickness(&model, &samples);
        let avatar = Avatar::untrained_inset(&model, &config, [0.5; 3], 3.0, 0).unwrap();
        let (mut bounded, mut free) = (0, 0);
        for ((depth, thickness), spacing) in depths(&avatar).iter().zip(&thickness).zip(&avatar.template.spacings) {
            assert!(*depth <= thickness / 3.0 + 1e-7, "{depth} m of {thickness} m");
            let wanted = 3.0 * f64::from(START_SCALE * spacing);
            if (depth - wanted).abs() < 1e-7 { free += 1 } else { bounded += 1 }
        }
        // Fingers are thin for such large Gaussians, palm and wrist are not.
        assert!(bounded > 100 && free > 100, "{bounded} bounded, {free} free");
    }
}

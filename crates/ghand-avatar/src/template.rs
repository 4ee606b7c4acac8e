//! The sampled hand model of an avatar, and the configuration that fixes the shape of its tables.

use ghand_core::blend_shapes::CoefficientLayout;
use ghand_core::residual_skeleton::ResidualSkeleton;
use ghand_core::skinning::ResidualWeights;
use ghand_core::{HandModel, Side};
use ghand_hand_model::{HandModelError, SurfaceSamples, surface};
use ghand_render::reference::project::Filter;
use ghand_render::splat::SplatModel;
use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::properties::network::NetworkSizes;

/// Largest standard deviation of a Gaussian in multiples of the mean spacing.
const MAX_SCALE: f32 = 4.0;

/// The shape of an avatar's Gaussians.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum GaussianShape {
    /// Balls.
    #[default]
    Round,
    /// Discs that lie along the surface, [`ghand_render::splat::FLATNESS`] times as thick as wide.
    Flat,
}

/// What gives the Gaussians their offsets in a pose.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Offsets {
    /// Learned shape bases, with coefficients that depend on the pose.
    #[default]
    Bases,
    /// The pose alone: without learned bases, each Gaussian has its own offset. The first basis is the start. Of networks
    /// the second is constant, so that its coefficients are the offset; of free tables the others belong to the entries of
    /// `vec(R_k - I)`, see [`crate::DirectTables`].
    Free,
}

impl Offsets {
    /// The number and the layout of coefficients that free offsets need, of networks or of free tables.
    pub fn free_layout(network: bool) -> (usize, CoefficientLayout) {
        if network { (2, CoefficientLayout::PerComponent) } else { (1 + FEATURES, CoefficientLayout::PerBasis) }
    }
}

/// Entries of `vec(R_k - I)`.
pub(crate) const FEATURES: usize = 9;

/// Configuration that fixes the shape and interpretation of an avatar's tables.
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
    /// How the residual skinning weights are interpreted.
    pub residual_weights: ResidualWeights,
    /// Position of the residual skeleton.
    pub residual_skeleton: ResidualSkeleton,
    /// The shape of the Gaussians.
    #[serde(skip_serializing_if = "is_default")]
    pub gaussians: GaussianShape,
    /// Whether the projection was antialiased in training, so that it must be wherever the avatar is shown.
    #[serde(skip_serializing_if = "is_default")]
    pub antialias: bool,
    /// Whether its blur is 0.1 square pixels then; of older avatars it is 0.3.
    #[serde(skip_serializing_if = "is_default")]
    pub narrow_blur: bool,
    /// Whether skinning is plain linear blend skinning: the avatar has no residual weights and no residual skeleton. Only of
    /// `direct` avatars.
    #[serde(skip_serializing_if = "is_default")]
    pub plain_skinning: bool,
    /// What gives the Gaussians their offsets.
    #[serde(skip_serializing_if = "is_default")]
    pub offsets: Offsets,
    /// Sizes of the networks that give the Gaussians their properties; without, the avatar is a `direct` one.
    #[serde(skip_serializing_if = "is_default")]
    pub network: Option<NetworkSizes>,
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
            gaussians: GaussianShape::default(),
            antialias: false,
            narrow_blur: false,
            plain_skinning: false,
            offsets: Offsets::default(),
            network: None,
        }
    }
}

/// Whether a value is the default, which files omit: they stay as before the field existed.
fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

impl AvatarConfig {
    /// How the Gaussians are kept from being smaller than a pixel.
    pub fn filter(&self) -> Filter {
        SplatModel { antialias: self.antialias, narrow: self.antialias && self.narrow_blur, ..SplatModel::HAND }
            .filter()
    }

    /// Rows of the blend coefficients.
    pub fn coefficient_rows(&self) -> usize {
        self.coefficients.rows() * self.shape_bases
    }

    /// Channels of the `direct` model's pose response: coefficient rows, then colour components.
    pub fn channels(&self) -> usize {
        self.coefficient_rows() + self.color_components
    }
}

/// The parts of a hand model that an avatar needs: its skeleton and N sampled surface points.
#[derive(Debug, Clone, PartialEq)]
pub struct Template {
    /// Name of the hand model.
    pub name: String,
    /// Left or right hand.
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
    /// Size of the surface patch of each Gaussian, N, metres.
    pub spacings: Vec<f32>,
    /// Rest normals `[3][N]`, unit length, if the Gaussians are flat.
    pub normals: Option<Vec<f32>>,
}

impl Template {
    /// Samples a hand model, for round Gaussians.
    ///
    /// # Errors
    /// [`HandModelError`] if the model has no usable UV atlas at this resolution.
    pub fn sample(model: &HandModel, uv_resolution: u32) -> Result<Template, HandModelError> {
        Ok(Template::from_samples(model, &surface::sample_surface(model, uv_resolution)?, GaussianShape::Round))
    }

    pub(crate) fn from_samples(model: &HandModel, samples: &SurfaceSamples, shape: GaussianShape) -> Template {
        let rows = |points: &[DVec3]| (0..3).flat_map(|c| points.iter().map(move |p| p[c] as f32)).collect();
        Template {
            name: model.name.clone(),
            side: model.side,
            joint_names: model.joint_names.clone(),
            parents: model.parents.clone(),
            joints: model.joints.clone(),
            rest: rows(&samples.positions),
            weights: samples.weights.iter().map(|w| *w as f32).collect(),
            spacings: samples.spacings.iter().map(|s| *s as f32).collect(),
            normals: (shape == GaussianShape::Flat).then(|| rows(&samples.normals)),
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

    /// Mean size of a Gaussian's surface patch, metres.
    pub fn mean_spacing(&self) -> f32 {
        self.spacings.iter().sum::<f32>() / self.len().max(1) as f32
    }

    /// Largest standard deviation of a Gaussian, metres.
    pub fn max_scale(&self) -> f32 {
        MAX_SCALE * self.mean_spacing()
    }
}

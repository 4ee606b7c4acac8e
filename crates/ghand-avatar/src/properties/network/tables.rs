//! The learned parameters of a `network` avatar, and what the networks add to.

use crate::deform::PropertySizes;
use rand::SeedableRng;

use super::networks::{Networks, OFFSET_GAIN};
use super::parameters::ParameterList;
use super::sizes::{NetworkSizes, Normalization};
use crate::properties::PropertyStart;
use crate::properties::direct::{DirectTables, set_color_logits};
use crate::template::{AvatarConfig, Offsets, Template};

/// The learned parameters of a network avatar, in the order of the networks' list; row-major.
#[derive(Debug, Clone, PartialEq)]
pub struct NetworkTables {
    /// Sizes of the networks.
    pub sizes: NetworkSizes,
    /// Sizes of what they give.
    pub properties: PropertySizes,
    /// The parameters, flat.
    pub parameters: Vec<Vec<f32>>,
    /// Running mean and variance of each normalisation, with [`Normalization::Batch`]; otherwise empty.
    pub running_norms: Vec<[Vec<f32>; 2]>,
    /// Shape bases to which the networks add, `[n * 3][N]`, metres. Not learned.
    pub base_shape_basis: Vec<f32>,
    /// Logits of size and colour to which the networks add, `[4][N]`. Not learned.
    pub base_logits: Vec<f32>,
}

/// Rows of the base logits: size and colour.
pub(super) const LOGIT_ROWS: usize = 4;
/// The parameters' numbers start from another seed than the base's.
const SEED_OF_PARAMETERS: u64 = 0x6e65_7477;

/// Sizes of the properties of an avatar.
pub(super) fn property_sizes(template: &Template, config: &AvatarConfig) -> PropertySizes {
    PropertySizes {
        gaussians: template.len(),
        joints: template.joint_count(),
        bases: config.shape_bases,
        coefficients: config.coefficients,
        plain_skinning: false,
    }
}

/// Bytes per Gaussian of the tables, and of what a training step keeps for its backward pass: about three numbers for
/// each channel of each of the decoders' 22 hidden layers.
pub(in crate::properties) fn bytes_per_gaussian(config: &AvatarConfig, sizes: &NetworkSizes) -> usize {
    size_of::<f32>() * (3 * config.shape_bases + LOGIT_ROWS + 3 * 22 * sizes.hidden)
}

impl NetworkTables {
    /// Networks whose avatar looks exactly like an untrained `direct` one.
    pub fn untrained(
        template: &Template,
        config: &AvatarConfig,
        sizes: &NetworkSizes,
        start: &PropertyStart<'_>,
    ) -> NetworkTables {
        let DirectTables { mut shape_basis, mut appearance, .. } = DirectTables::untrained(template, config, start);
        if config.offsets == Offsets::Free {
            // The coefficients of the second basis are the offset.
            shape_basis[3 * template.len()..].fill(OFFSET_GAIN as f32);
        }
        appearance.truncate(LOGIT_ROWS * template.len());
        let properties = property_sizes(template, config);
        let (_, list) = Networks::new(sizes, properties);
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(start.seed ^ SEED_OF_PARAMETERS);
        NetworkTables {
            sizes: sizes.clone(),
            properties,
            parameters: list.parameters.iter().map(|p| p.start.values(p.len(), &mut rng)).collect(),
            running_norms: running_norms(sizes, &list),
            base_shape_basis: shape_basis,
            base_logits: appearance,
        }
    }

    /// Names of the parameters, in their order.
    pub fn parameter_names(&self) -> Vec<String> {
        let (_, list) = Networks::new(&self.sizes, self.properties);
        list.parameters.into_iter().map(|parameter| parameter.name).collect()
    }

    /// Sets the colour of each Gaussian (display values 0..1) to which the networks add.
    pub fn set_base_colors(&mut self, colors: &[[f64; 3]]) {
        set_color_logits(&mut self.base_logits, colors);
    }

    /// As [`NetworkTables::set_base_colors`], and no pose changes the colours.
    pub fn set_constant_colors(&mut self, colors: &[[f64; 3]]) {
        self.set_base_colors(colors);
        let (networks, _) = Networks::new(&self.sizes, self.properties);
        for index in networks.color_outputs() {
            self.parameters[index].fill(0.0);
        }
    }
}

/// Mean 0 and variance 1 for each normalisation, if they are kept.
fn running_norms(sizes: &NetworkSizes, list: &ParameterList) -> Vec<[Vec<f32>; 2]> {
    match sizes.normalization {
        Normalization::Instance => Vec::new(),
        Normalization::Batch => list.norms.iter().map(|n| [vec![0.0; *n], vec![1.0; *n]]).collect(),
    }
}

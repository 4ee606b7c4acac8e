//! The networks of an avatar: encoders, feature tensor and decoders, and the properties from their outputs.

use crate::deform::PropertySizes;
use burn_tensor::{Tensor, activation};

use super::layers::{Conv, Mlp, Pass};
use super::parameters::{ParameterList, Part, Slot, Start};
use super::position_map::FeatureSampler;
use super::sizes::NetworkSizes;
use super::unet::UNet;

/// An output of 1 of the shape decoder is this offset, metres.
pub(crate) const OFFSET_GAIN: f64 = 0.01;
/// Standard deviation of the feature tensor at the start.
const TENSOR_NOISE: f32 = 0.01;
/// Kernel of the convolutions that smooth the feature tensor, and their number.
const SMOOTHING_KERNEL: usize = 5;
const SMOOTHING_LAYERS: usize = 3;

/// All networks. They hold the places of their parameters, not the parameters.
#[derive(Debug)]
pub(super) struct Networks {
    outputs: PropertySizes,
    canonical_encoder: UNet,
    pose_encoder: UNet,
    feature_tensor: Slot<4>,
    smoothing: Vec<Conv>,
    shape_basis: Mlp,
    residual_weights: Mlp,
    trunk: Mlp,
    coefficients: Mlp,
    regressor: Mlp,
    scale: Mlp,
    color: Mlp,
    /// Logits, `[3][N]`.
    own_colors: Option<Slot<2>>,
}

/// What does not depend on the pose.
#[derive(Debug, Clone)]
pub(super) struct Canonical {
    /// f_c and uv of each Gaussian, `[N][features + 2]`.
    pub features: Tensor<2>,
    /// S, `[n * 3][N]`, metres.
    pub shape_basis: Tensor<2>,
    /// W^, `[n_b][N]`.
    pub residual_weights: Tensor<2>,
}

/// What the networks add to.
#[derive(Debug, Clone)]
pub(super) struct Base {
    /// `[n * 3][N]`, metres.
    pub shape_basis: Tensor<2>,
    /// Logits of size and colour, `[4][N]`.
    pub logits: Tensor<2>,
    /// Largest standard deviation of a Gaussian, metres.
    pub max_scale: f32,
}

/// What depends on the pose.
#[derive(Debug, Clone)]
pub(super) struct Posed {
    /// C, `[n][N]` or `[n * 3][N]`.
    pub coefficients: Tensor<2>,
    /// R, `[n_b][N]`.
    pub regressor: Tensor<2>,
    /// Standard deviations, `[1][N]`, metres.
    pub scale: Tensor<2>,
    /// Colours, `[3][N]`, display values.
    pub color: Tensor<2>,
}

impl Networks {
    /// Networks of these sizes, and the list of their parameters.
    pub fn new(sizes: &NetworkSizes, outputs: PropertySizes) -> (Networks, ParameterList) {
        let list = &mut ParameterList::default();
        let NetworkSizes { map_side, encoder_channels, feature_channels, tensor_channels, hidden, .. } = *sizes;
        let encoder = |list: &mut _, name, part| UNet::new(list, (name, part), encoder_channels, feature_channels);
        let canonical_encoder = encoder(list, "canonical_encoder", Part::CanonicalEncoder);
        let pose_encoder = encoder(list, "pose_encoder", Part::PoseEncoder);
        let tensor_shape = [1, tensor_channels, map_side, map_side];
        let start = Start::Normal(TENSOR_NOISE);
        let feature_tensor = list.add("feature_tensor".into(), Part::FeatureTensor, tensor_shape, start);
        let smoothing = (0..SMOOTHING_LAYERS).map(|k| {
            let outputs = if k + 1 == SMOOTHING_LAYERS { feature_channels } else { tensor_channels };
            let name = (format!("smoothing.{k}"), Part::Smoothing);
            Conv::new(list, name, [tensor_channels, outputs], SMOOTHING_KERNEL, 1)
        });
        let smoothing = smoothing.collect();
        let mut mlp = |name, part, widths: &[usize], last| Mlp::new(list, (name, part), widths, sizes.activation, last);
        let canonical_inputs = feature_channels + 2;
        let mut canonical =
            |name, part, count| mlp(name, part, &[canonical_inputs, hidden, hidden, hidden, count], Some(Start::Zero));
        let shape_basis = canonical("shape_basis", Part::ShapeBasis, 3 * outputs.bases);
        let residual_weights = canonical("residual_weights", Part::ResidualWeights, outputs.joints);
        let inputs = canonical_inputs + feature_channels;
        let trunk = mlp("trunk", Part::Trunk, &[inputs, hidden, hidden, hidden, hidden], None);
        let mut head = |name, part, count, last| mlp(name, part, &[hidden, hidden, hidden, count], Some(last));
        let rows = outputs.coefficients.rows();
        // The first basis is there from the start.
        let coefficients = head("coefficients", Part::Coefficients, rows * outputs.bases, Start::Ones(rows));
        let regressor = head("regressor", Part::Regressor, outputs.joints, Start::Zero);
        let scale = head("scale", Part::Scale, 1, Start::Zero);
        let color = head("color", Part::Color, 3, Start::Zero);
        let own_colors = sizes
            .own_colors
            .then(|| list.add("own_colors".into(), Part::OwnColors, [3, outputs.gaussians], Start::Zero));
        let networks = Networks {
            outputs,
            canonical_encoder,
            pose_encoder,
            feature_tensor,
            smoothing,
            shape_basis,
            residual_weights,
            trunk,
            coefficients,
            regressor,
            scale,
            color,
            own_colors,
        };
        (networks, std::mem::take(list))
    }

    /// The parameters without which the colours are those of the base.
    pub fn color_outputs(&self) -> Vec<usize> {
        let last = self.color.last().into_iter().flat_map(|(weight, bias)| [weight.index(), bias.index()]);
        last.chain(self.own_colors.as_ref().map(Slot::index)).collect()
    }

    /// What does not depend on the pose, from the map of the rest hand, `[1][3][side][side]`.
    pub fn canonical(&self, pass: &mut Pass, map: Tensor<4>, sampler: &FeatureSampler, base: &Base) -> Canonical {
        let encoded = self.canonical_encoder.forward(pass, map);
        let tensor = self.feature_tensor.of(pass.parameters);
        let smoothed = self.smoothing.iter().fold(tensor, |x, conv| conv.forward(pass, x));
        let features = Tensor::cat(vec![sampler.sample(encoded + smoothed), sampler.uv.clone()], 1);
        let offsets = self.shape_basis.forward(pass, features.clone()).transpose();
        Canonical {
            shape_basis: offsets * OFFSET_GAIN + base.shape_basis.clone(),
            residual_weights: self.residual_weights.forward(pass, features.clone()).transpose(),
            features,
        }
    }

    /// What depends on the pose, from the map of the posed hand.
    pub fn posed(
        &self,
        pass: &mut Pass,
        map: Tensor<4>,
        sampler: &FeatureSampler,
        canonical: &Canonical,
        base: &Base,
    ) -> Posed {
        let encoded = self.pose_encoder.forward(pass, map);
        let features = Tensor::cat(vec![canonical.features.clone(), sampler.sample(encoded)], 1);
        let shared = self.trunk.activate(self.trunk.forward(pass, features));
        let head = |mlp: &Mlp| mlp.forward(pass, shared.clone()).transpose();
        let logits = |row: usize, count: usize| base.logits.clone().narrow(0, row, count);
        let colors = head(&self.color) + logits(1, 3);
        let colors = match &self.own_colors {
            Some(own) => colors + own.of(pass.parameters),
            None => colors,
        };
        Posed {
            coefficients: head(&self.coefficients),
            // A residual joint is then a mean over the Gaussians, however many there are.
            regressor: head(&self.regressor) / self.outputs.gaussians as f64,
            scale: activation::sigmoid(head(&self.scale) + logits(0, 1)) * f64::from(base.max_scale),
            color: activation::sigmoid(colors),
        }
    }
}

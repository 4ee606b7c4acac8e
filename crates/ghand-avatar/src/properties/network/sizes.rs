//! Sizes of the networks.

use serde::{Deserialize, Serialize};

/// Number of times that the side of the map is halved.
pub(super) const LEVELS: usize = 5;

/// How the encoders normalise their channels, each over the texels of its map.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Normalization {
    /// By the map's own mean and variance.
    Instance,
    /// In training by the map's own, since a batch is one pose; at play by their running means over training.
    Batch,
}

/// Activation of the decoders.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Activation {
    /// `max(0, x)`.
    Relu,
    /// `ln(1 + exp x)`.
    Softplus,
}

/// Sizes of the networks of an avatar.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NetworkSizes {
    /// Rows and columns of the position maps and of the feature tensor; a multiple of 32.
    pub map_side: usize,
    /// Channels of the encoders' first layer; the deepest has eight times as many.
    pub encoder_channels: usize,
    /// Channels of the features, of the rest hand and of the pose each.
    pub feature_channels: usize,
    /// Channels of the optimisable feature tensor.
    pub tensor_channels: usize,
    /// Width of the decoders' layers.
    pub hidden: usize,
    /// How the encoders normalise.
    pub normalization: Normalization,
    /// Activation of the decoders.
    pub activation: Activation,
    /// Whether each Gaussian also has a colour of its own, for which the features would be too coarse.
    #[serde(default)]
    pub own_colors: bool,
}

impl NetworkSizes {
    /// For minutes on a processor.
    pub fn quick() -> NetworkSizes {
        NetworkSizes {
            map_side: 128,
            encoder_channels: 8,
            feature_channels: 16,
            tensor_channels: 8,
            hidden: 64,
            normalization: Normalization::Instance,
            activation: Activation::Relu,
            own_colors: true,
        }
    }

    /// As in the paper, and for what it leaves open as in the method that it builds on (Hu et al., GaussianAvatar). With
    /// `coefficients=per_component`, 8 bases and 87,779 Gaussians this is the paper's model.
    pub fn paper() -> NetworkSizes {
        NetworkSizes {
            map_side: 128,
            encoder_channels: 32,
            feature_channels: 64,
            tensor_channels: 64,
            hidden: 256,
            normalization: Normalization::Batch,
            activation: Activation::Softplus,
            own_colors: false,
        }
    }

    /// Whether networks of these sizes can be made; if not, what is wrong and what is allowed.
    ///
    /// # Errors
    /// One sentence about the first size out of range.
    pub fn check(&self) -> Result<(), String> {
        if cfg!(not(feature = "networks")) {
            return Err("this program was built without networks; build it with `--features networks`".into());
        }
        let step = 1 << LEVELS;
        if self.map_side == 0 || self.map_side > 256 || !self.map_side.is_multiple_of(step) {
            return Err(format!("map_side is {}; it must be a multiple of {step} up to 256", self.map_side));
        }
        let ranges = [
            ("encoder_channels", self.encoder_channels, 64),
            ("feature_channels", self.feature_channels, 256),
            ("tensor_channels", self.tensor_channels, 256),
            ("hidden", self.hidden, 1024),
        ];
        match ranges.into_iter().find(|(_, size, most)| !(1..=*most).contains(size)) {
            Some((name, size, most)) => Err(format!("{name} is {size}; it must be from 1 to {most}")),
            None => Ok(()),
        }
    }
}

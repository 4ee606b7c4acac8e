//! The `network` property model of a program that was built without the feature `networks`: there are sizes, but no tables.

#[path = "network/sizes.rs"]
mod sizes;

use std::convert::Infallible;

use crate::deform::{Deformation, PropertySizes};
use ghand_core::HandModel;
use ghand_render::{Gpu, RenderError};

use super::{PropertyStart, TrainableModel};
use crate::file::{AvatarFileError, Reader, Tensors};
use crate::template::{AvatarConfig, Template};

pub use sizes::{Activation, NetworkSizes, Normalization};

/// Why there are none, after the name of what has networks.
const WITHOUT: &str = "has networks, which this program was built without; build it with `--features networks`";

/// The learned parameters of a network avatar. There are none.
#[derive(Debug, Clone, PartialEq)]
pub struct NetworkTables {
    never: Infallible,
    /// Sizes of the networks.
    pub sizes: NetworkSizes,
    /// Sizes of what they give.
    pub properties: PropertySizes,
    /// The parameters, flat.
    pub parameters: Vec<Vec<f32>>,
    /// Running mean and variance of each normalisation.
    pub running_norms: Vec<[Vec<f32>; 2]>,
    /// Shape bases to which the networks add, `[n * 3][N]`, metres.
    pub base_shape_basis: Vec<f32>,
    /// Logits of size and colour to which the networks add, `[4][N]`.
    pub base_logits: Vec<f32>,
}

impl NetworkTables {
    /// Sizes of networks are refused before ([`NetworkSizes::check`]).
    pub(super) fn untrained(_: &Template, _: &AvatarConfig, _: &NetworkSizes, _: &PropertyStart<'_>) -> NetworkTables {
        unreachable!("an avatar that {WITHOUT}")
    }

    pub(crate) fn read(
        reader: &Reader<'_>,
        _: &Template,
        _: &AvatarConfig,
        _: &NetworkSizes,
    ) -> Result<NetworkTables, AvatarFileError> {
        Err(reader.invalid("property_model", WITHOUT))
    }

    pub(crate) fn write(&self, _: &mut Tensors) {
        match self.never {}
    }

    /// Names of the parameters, in their order.
    pub fn parameter_names(&self) -> Vec<String> {
        match self.never {}
    }

    /// Sets the colour of each Gaussian to which the networks add.
    pub fn set_base_colors(&mut self, _: &[[f64; 3]]) {
        match self.never {}
    }

    /// As [`NetworkTables::set_base_colors`], and no pose changes the colours.
    pub fn set_constant_colors(&mut self, _: &[[f64; 3]]) {
        match self.never {}
    }

    /// The twin's answer for an avatar that there is not.
    pub(crate) fn never<T>(&self) -> T {
        match self.never {}
    }
}

pub(super) fn bytes_per_gaussian(_: &AvatarConfig, _: &NetworkSizes) -> usize {
    0
}

pub(super) fn on_device(
    _: &Gpu,
    _: &HandModel,
    _: &Template,
    _: &AvatarConfig,
    tables: &NetworkTables,
    _: &Deformation,
) -> Result<Box<dyn TrainableModel>, RenderError> {
    tables.never()
}

//! The `network` property model, which is the paper's: convolutional encoders of position maps in UV space, and decoders
//! that give each Gaussian its properties from the features at its texel (paper III and IV-A).
//!
//! ```text
//! rest map ─► E_c ─┬─► f_c ─► d_c ─► S, W^                       once per avatar
//! feature tensor ──┘    └────┐
//! pose map ─► E_p ───► f_p ──┴─► d_p ─► C, R, scale, colour       once per pose
//! ```
//!
//! The networks run in Burn, on a device that is chosen at run time. They give the property buffers and take their
//! gradients; everything between, from blend shapes to the image, is the same as for other models. No gradient goes
//! through the networks to the pose.

mod adam;
mod clip;
mod device;
mod layers;
mod network_device;
mod networks;
mod parameters;
mod position_map;
mod sizes;
mod tables;
mod tensors;
#[cfg(test)]
mod tests;
mod unet;

pub use device::NetworkModel;
pub(crate) use layers::NORM_EPSILON;
pub(crate) use networks::OFFSET_GAIN;
pub(crate) use position_map::{PositionMap, gaussian_uvs};
pub use sizes::{Activation, NetworkSizes, Normalization};
pub use tables::NetworkTables;
pub(super) use tables::bytes_per_gaussian;

use crate::deform::Deformation;
use ghand_core::HandModel;
use ghand_render::{Gpu, RenderError};

use super::TrainableModel;
use crate::template::{AvatarConfig, Template};

/// Puts the networks on the device.
pub(super) fn on_device(
    gpu: &Gpu,
    model: &HandModel,
    template: &Template,
    config: &AvatarConfig,
    tables: &NetworkTables,
    deformation: &Deformation,
) -> Result<Box<dyn TrainableModel>, RenderError> {
    Ok(Box::new(NetworkModel::new(gpu, model, template, config, tables, deformation)?))
}

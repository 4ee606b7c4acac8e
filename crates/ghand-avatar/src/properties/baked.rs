//! The `baked` model: what another model computes, as means and few local components. It plays, and is not trained.
//!
//! The tables and the stage that poses them are [`crate::deform::baked`]'s; [`crate::bake`] makes them.

pub(crate) mod template;
pub(crate) mod tensors;

pub use crate::deform::baked::{BakedTables, Precision};

use crate::deform::Deformation;
use ghand_render::{Gpu, RenderError};

use crate::properties::PropertyModel;

/// A `baked` model on the device, where the deformation does all of its work.
pub struct BakedModel;

impl PropertyModel for BakedModel {
    fn forward(&mut self, _: &Gpu, _: &mut wgpu::CommandEncoder, _: &Deformation) -> Result<(), RenderError> {
        Ok(())
    }
}

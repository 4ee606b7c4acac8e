//! The `baked` model: what another model computes, as means and few local components. It plays, and is not trained.
//!
//! The tables and the stage that poses them are [`crate::deform::baked`]'s; [`crate::bake`] makes them.

mod device;
pub(crate) mod template;
pub(crate) mod tensors;

pub use crate::deform::baked::{BakedTables, Precision};
pub use device::BakedModel;
pub(crate) use device::not_trained;

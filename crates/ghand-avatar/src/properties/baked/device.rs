//! The `baked` model on the device, where the deformation does all of its work.

use crate::deform::baked::BakedTables;
use crate::deform::{Deformation, DeformationBackward};
use ghand_render::{Gpu, RenderError};

use crate::properties::{PropertyModel, PropertyRates, PropertyTables, TrainingState};

/// A `baked` model.
pub struct BakedModel {
    tables: BakedTables,
}

impl BakedModel {
    /// With the tables from which the deformation was made.
    pub fn new(tables: &BakedTables) -> BakedModel {
        BakedModel { tables: tables.clone() }
    }
}

impl PropertyModel for BakedModel {
    fn prepare_training(&mut self, _: &Gpu, _: &Deformation, _: &DeformationBackward) -> Result<(), RenderError> {
        Err(not_trained())
    }

    fn forward(&mut self, _: &Gpu, _: &mut wgpu::CommandEncoder, _: &Deformation) -> Result<(), RenderError> {
        Ok(())
    }

    fn backward(&mut self, _: &Gpu, _: &mut wgpu::CommandEncoder) -> Result<(), RenderError> {
        Err(not_trained())
    }

    fn update(&mut self, _: &Gpu, _: &mut wgpu::CommandEncoder, _: &PropertyRates) -> Result<bool, RenderError> {
        Err(not_trained())
    }

    fn tables(&self, _: &Gpu) -> Result<PropertyTables, RenderError> {
        Ok(PropertyTables::Baked(self.tables.clone()))
    }

    fn pose_parameters(&self, _: &Gpu) -> Result<Vec<f32>, RenderError> {
        Ok(self.tables.components.iter().flat_map(|component| component.gains).collect())
    }

    fn training_state(&self, _: &Gpu) -> Result<TrainingState, RenderError> {
        Err(not_trained())
    }

    fn set_training_state(&mut self, _: &Gpu, _: &TrainingState) -> Result<(), RenderError> {
        Err(not_trained())
    }

    fn parameter_gradients(&mut self, _: &Gpu) -> Result<Vec<(String, Vec<f32>)>, RenderError> {
        Err(not_trained())
    }
}

pub(crate) fn not_trained() -> RenderError {
    RenderError::Invalid("a baked avatar cannot be trained; train the avatar that it was baked from".into())
}

//! Property models, which compute the properties of every Gaussian in a pose.
//!
//! This is the interface between what an avatar has learned and how it is deformed and drawn. On disk a model is a
//! variant of [`PropertyTables`]; on the device it is a [`PropertyModel`], and a [`TrainableModel`] if it can be trained, which fills the [`Properties`] of a
//! [`Deformation`]. The stages before it (files, poses) and after it (deformation, splatting, loss) do not depend on
//! the kind of model. A new model needs a folder here with its tables, device part and tensors, a variant and its match
//! arms in this file, and a tag in `file.rs`.
//!
//! [`Properties`]: crate::deform::Properties

pub mod baked;
pub mod direct;
#[cfg(feature = "networks")]
pub mod network;
#[cfg(not(feature = "networks"))]
#[path = "properties/no_network.rs"]
pub mod network;

use crate::deform::{Deformation, DeformationBackward};
use ghand_core::HandModel;
use ghand_render::{Gpu, RenderError};
use glam::DVec3;

use crate::template::{AvatarConfig, Template};
use baked::{BakedModel, BakedTables};
use direct::{DirectModel, DirectTables};
use network::NetworkTables;

/// The learned tables of a property model.
#[derive(Debug, Clone, PartialEq)]
pub enum PropertyTables {
    /// Free tables with a local, linear dependence on the pose.
    Direct(DirectTables),
    /// The paper's networks.
    Network(NetworkTables),
    /// What one of the others computes, as means and few components, for playing.
    Baked(BakedTables),
}

/// Learning rates of a step, after the schedule. A rate of 0 leaves its parameters unchanged.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PropertyRates {
    /// Number of the step, from 1.
    pub step: u64,
    /// Of shape bases, metres.
    pub shape_basis: f64,
    /// Of residual skinning weights.
    pub residual_weights: f64,
    /// Of the skeleton regressor.
    pub regressor: f64,
    /// Of the Gaussians' sizes, logits.
    pub scale: f64,
    /// Of the pose-independent base colours, logits.
    pub color: f64,
    /// Of the pose-dependent colour components.
    pub color_components: f64,
    /// Of the pose response of coefficients and colours.
    pub response: f64,
    /// Of the weights of networks. Where a property's own rate is 0, the part that gives it does not learn.
    pub networks: f64,
    /// Of the networks' feature tensor.
    pub feature_tensor: f64,
}

/// A property model on the device that plays: pose in, properties out.
///
/// A frame runs [`PropertyModel::forward`] after the skeleton and before the rest of the deformation. It can encode into
/// the given encoder, which is submitted after it returns, or submit its own work and wait for it, as a network on the
/// host does. Outside browsers it can be sent to another thread, and so can a [`Scene`](crate::Scene).
pub trait PropertyModel: wgpu::WasmNotSend {
    /// Fills the properties for the pose of the deformation's frame. The commands that compute the posed joint chain come
    /// before this in the encoder. A model that works on the host reads the pose back with [`Deformation::read_pose`]:
    /// training may have changed it on the device.
    ///
    /// # Errors
    /// [`RenderError`] if the device failed or was lost.
    fn forward(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        deformation: &Deformation,
    ) -> Result<(), RenderError>;
}

/// A property model that can also be trained: gradients of the properties in, gradients of its parameters and of the pose
/// out.
///
/// A training step runs splatting, loss and their backward passes in one submission and, once the host knows that the
/// frame was complete, [`TrainableModel::backward`] and [`TrainableModel::update`], which encode or submit as
/// [`PropertyModel::forward`] does.
pub trait TrainableModel: PropertyModel {
    /// Makes the buffers and pipelines that only training needs, such as gradients and moments.
    ///
    /// # Errors
    /// [`RenderError`] if the device has too little memory or was lost.
    fn prepare_training(
        &mut self,
        gpu: &Gpu,
        deformation: &Deformation,
        backward: &DeformationBackward,
    ) -> Result<(), RenderError>;

    /// Says whether forward passes from now on have a backward pass, as they have once training is prepared. Others can
    /// omit what only that needs.
    fn expect_backward(&mut self, _expected: bool) {}

    /// Propagates the gradients of the properties to the parameters, and adds the pose's gradient through the model to
    /// [`DeformationBackward::d_local`]. Called only after a complete frame. Before an update it may be called for several
    /// frames, each after its forward pass, if the model adds their gradients up; `network` does.
    ///
    /// # Errors
    /// [`RenderError`] if the device failed or was lost, or the model is not prepared for training.
    fn backward(&mut self, gpu: &Gpu, encoder: &mut wgpu::CommandEncoder) -> Result<(), RenderError>;

    /// Updates the parameters from their gradients. `false` if one of those is not finite; then nothing is updated. The
    /// caller has seen that those of the Gaussians are finite.
    ///
    /// # Errors
    /// As [`TrainableModel::backward`].
    fn update(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        rates: &PropertyRates,
    ) -> Result<bool, RenderError>;

    /// Forgets gradients that were added up for the next update.
    fn discard_gradients(&mut self) {}

    /// Reads back the learned tables.
    ///
    /// # Errors
    /// [`RenderError`] if the device failed or was lost.
    fn tables(&self, gpu: &Gpu) -> Result<PropertyTables, RenderError>;

    /// Reads back the few parameters that map the pose to all Gaussians: if one of them is not finite, training has
    /// failed.
    ///
    /// # Errors
    /// As [`TrainableModel::tables`].
    fn pose_parameters(&self, gpu: &Gpu) -> Result<Vec<f32>, RenderError>;

    /// Seconds that the model's parts have taken on the host since it was made, by name; for benchmarks.
    fn host_seconds(&self) -> Vec<(&'static str, f64)> {
        vec![]
    }

    /// Reads back all that training changes, parameters and moments, by names of the model's own.
    ///
    /// # Errors
    /// As [`TrainableModel::backward`].
    fn training_state(&self, gpu: &Gpu) -> Result<TrainingState, RenderError>;

    /// Goes on from a state that [`TrainableModel::training_state`] gave: the following steps are the same, bit for bit.
    ///
    /// # Errors
    /// [`RenderError::Invalid`] if the state is that of another model.
    fn set_training_state(&mut self, gpu: &Gpu, state: &TrainingState) -> Result<(), RenderError>;

    /// Reads back the gradients of the parameters by their names in the avatar file, for tests and plots.
    ///
    /// # Errors
    /// As [`TrainableModel::backward`].
    fn parameter_gradients(&mut self, gpu: &Gpu) -> Result<Vec<(String, Vec<f32>)>, RenderError>;
}

/// A property model on the device.
pub enum DeviceModel {
    /// It only plays.
    Plays(Box<dyn PropertyModel>),
    /// It plays, and can be trained.
    Trains(Box<dyn TrainableModel>),
}

impl DeviceModel {
    /// As [`PropertyModel::forward`].
    ///
    /// # Errors
    /// As there.
    pub fn forward(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        deformation: &Deformation,
    ) -> Result<(), RenderError> {
        match self {
            DeviceModel::Plays(model) => model.forward(gpu, encoder, deformation),
            DeviceModel::Trains(model) => model.forward(gpu, encoder, deformation),
        }
    }

    /// The model, to be trained.
    ///
    /// # Errors
    /// [`RenderError::Invalid`] if it only plays.
    pub fn trainable(&self) -> Result<&dyn TrainableModel, RenderError> {
        match self {
            DeviceModel::Plays(_) => Err(not_trained()),
            DeviceModel::Trains(model) => Ok(model.as_ref()),
        }
    }

    /// As [`DeviceModel::trainable`], mutable.
    ///
    /// # Errors
    /// As there.
    pub fn trainable_mut(&mut self) -> Result<&mut dyn TrainableModel, RenderError> {
        match self {
            DeviceModel::Plays(_) => Err(not_trained()),
            DeviceModel::Trains(model) => Ok(model.as_mut()),
        }
    }
}

fn not_trained() -> RenderError {
    RenderError::Invalid("a baked avatar cannot be trained; train the avatar that it was baked from".into())
}

/// Numbers by name.
pub type TrainingState = Vec<(String, Vec<f32>)>;

/// The `length` numbers of that name in a state.
///
/// # Errors
/// [`RenderError::Invalid`] if they are missing, or are more or fewer.
pub fn state_part<'a>(state: &'a TrainingState, name: &str, length: usize) -> Result<&'a [f32], RenderError> {
    let part = state.iter().find(|(other, _)| other == name).map(|(_, values)| values.as_slice());
    let invalid = |problem: String| RenderError::Invalid(format!("the state of the training: {name} {problem}"));
    match part {
        Some(values) if values.len() == length => Ok(values),
        Some(values) => Err(invalid(format!("has {} numbers, not {length}", values.len()))),
        None => Err(invalid("is missing".into())),
    }
}

/// Where an untrained avatar starts.
#[derive(Debug, Clone, Copy)]
pub struct PropertyStart<'a> {
    /// Outward normals of the Gaussians at rest, N.
    pub normals: &'a [DVec3],
    /// Distances of the Gaussians from the surface, inwards, N, metres.
    pub insets: &'a [f64],
    /// Colour of all, display values 0..1.
    pub color: [f64; 3],
    /// Seed of the small random numbers from which training breaks symmetry.
    pub seed: u64,
}

impl PropertyTables {
    /// Standard deviation of an untrained Gaussian, in multiples of its spacing: neighbours just close the surface.
    pub const START_SCALE: f32 = 0.7;

    /// Tables under which the avatar is the template's plain surface in one colour.
    pub fn untrained(template: &Template, config: &AvatarConfig, start: &PropertyStart<'_>) -> PropertyTables {
        match &config.network {
            None => PropertyTables::Direct(DirectTables::untrained(template, config, start)),
            Some(sizes) => PropertyTables::Network(NetworkTables::untrained(template, config, sizes, start)),
        }
    }

    /// Bytes of host memory per Gaussian that the model needs: of its tables, and of what it keeps in a training step.
    pub fn bytes_per_gaussian(joints: usize, config: &AvatarConfig) -> usize {
        match &config.network {
            None => direct::bytes_per_gaussian(joints, config),
            Some(sizes) => network::bytes_per_gaussian(config, sizes),
        }
    }

    /// Sets the pose-independent base colours (display values 0..1), one per Gaussian. Those of a baked avatar stay.
    pub fn set_base_colors(&mut self, colors: &[[f64; 3]]) {
        match self {
            PropertyTables::Direct(tables) => tables.set_base_colors(colors),
            PropertyTables::Network(tables) => tables.set_base_colors(colors),
            PropertyTables::Baked(_) => {}
        }
    }

    /// As [`PropertyTables::set_base_colors`], and no pose changes the colours.
    pub fn set_constant_colors(&mut self, colors: &[[f64; 3]]) {
        match self {
            PropertyTables::Direct(tables) => tables.set_constant_colors(colors),
            PropertyTables::Network(tables) => tables.set_constant_colors(colors),
            PropertyTables::Baked(tables) => tables.set_constant_colors(colors),
        }
    }

    /// Lets Gaussians that training hardly saw take their values from their neighbours. `seen` is how much it saw each
    /// of them, N; `neighbors` is [`crate::neighbors::neighbors`], `cameras` the number of cameras that it saw them with.
    /// Networks do already: their weights are the same for all Gaussians, and what differs, the features, is smooth over the
    /// surface.
    pub fn fill_unseen(&mut self, seen: &[f32], neighbors: &[u32], cameras: usize) {
        match self {
            PropertyTables::Direct(tables) => tables.fill_unseen(seen, neighbors, cameras),
            PropertyTables::Network(_) | PropertyTables::Baked(_) => {}
        }
    }

    /// All learned tables, with their names in messages.
    pub fn parts(&self) -> Vec<(&'static str, &[f32])> {
        match self {
            PropertyTables::Direct(tables) => vec![
                ("the shape bases", &tables.shape_basis),
                ("the residual skinning weights", &tables.residual_weights),
                ("the skeleton regressor", &tables.regressor),
                ("colours or scales", &tables.appearance),
                ("the pose response", &tables.response),
            ],
            PropertyTables::Network(tables) => {
                let parameters = tables.parameters.iter().map(|p| ("a weight of the networks", p.as_slice()));
                let norms = tables.running_norms.iter().flatten().map(|n| ("a mean of the networks", n.as_slice()));
                parameters.chain(norms).collect()
            }
            PropertyTables::Baked(tables) => {
                tables.components.iter().map(|component| ("a component", &component.gains[..])).collect()
            }
        }
    }

    /// Puts the model on the device; it fills the properties of `deformation`. `model` is the hand model of `template`.
    ///
    /// # Errors
    /// [`RenderError::Invalid`] if networks need Gaussians on the hand model's UV atlas, and they are elsewhere.
    pub fn on_device(
        &self,
        gpu: &Gpu,
        model: &HandModel,
        template: &Template,
        config: &AvatarConfig,
        deformation: &Deformation,
    ) -> Result<DeviceModel, RenderError> {
        Ok(match self {
            PropertyTables::Direct(tables) => {
                DeviceModel::Trains(Box::new(DirectModel::new(gpu, template, config, tables, deformation)))
            }
            PropertyTables::Network(tables) => {
                DeviceModel::Trains(network::on_device(gpu, model, template, config, tables, deformation)?)
            }
            PropertyTables::Baked(_) => DeviceModel::Plays(Box::new(BakedModel)),
        })
    }
}

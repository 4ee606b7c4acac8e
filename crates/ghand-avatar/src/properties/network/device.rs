//! The `network` model on the device: the networks run in Burn, where [`NetworkDevice`] says.

use std::time::Instant;

use crate::deform::{Deformation, DeformationBackward, Properties};
use burn_tensor::{Device, Tensor, TensorData};
use ghand_core::HandModel;
use ghand_render::{Gpu, RenderError, buffers};
use glam::DVec3;

use super::adam::NetworkAdam;
use super::clip::GradientClip;
use super::layers::Pass;
use super::network_device::{NetworkDevice, NetworkPlacement, values};
use super::networks::{Base, Canonical, Networks, Posed};
use super::parameters::{Parameter, Part};
use super::position_map::{FeatureSampler, PositionMap, gaussian_uvs};
use super::sizes::Normalization;
use super::tables::{LOGIT_ROWS, NetworkTables};
use crate::properties::{PropertyModel, PropertyRates, PropertyTables, TrainableModel, TrainingState, state_part};
use crate::template::{AvatarConfig, Template};

/// How fast the running means of batch normalisation follow the poses.
const NORM_MOMENTUM: f64 = 0.1;

/// A `network` model. What depends on no pose is computed once, and what depends on the pose only when it has changed;
/// while it is trained both are computed again after each update.
pub struct NetworkModel {
    networks: Networks,
    list: Vec<Parameter>,
    tables: NetworkTables,
    burn: NetworkDevice,
    parameters: Vec<Tensor<1>>,
    running_norms: Vec<[Tensor<1>; 2]>,
    map: PositionMap,
    sampler: FeatureSampler,
    base: Base,
    properties: Properties,
    joint_count: usize,
    /// What depends on no pose, with the present parameters; without gradients.
    canonical: Option<Canonical>,
    /// The pose and joints whose properties the device has, with the present parameters.
    current: Option<[Vec<f32>; 2]>,
    /// Seconds of forward passes, and while training of backward passes and updates.
    seconds: [f64; PARTS.len()],
    training: Option<Training>,
}

/// What only training needs.
struct Training {
    /// Whether a backward pass follows the next forward pass.
    records: bool,
    gradients: Properties,
    /// The last forward pass, whose backward pass is still to come.
    tape: Option<Tape>,
    /// Gradients of the properties in the tape's pose, added up over the views of it.
    property_gradients: Option<[Tensor<2>; PROPERTIES]>,
    /// Gradients of the parameters, added up over poses.
    parameter_gradients: Vec<Option<Tensor<1>>>,
    clip: GradientClip,
    adam: NetworkAdam,
}

/// The parts of a training state, after a parameter's name or a normalisation's.
const MOMENTS: [&str; 2] = ["first_moment", "second_moment"];
const NORMS: [&str; 2] = ["mean", "variance"];
const CLIP: &str = "usual_gradient_norm";

/// What is timed.
const PARTS: [&str; 3] = ["networks forward", "networks backward", "networks Adam"];

/// Number of properties.
const PROPERTIES: usize = 6;

/// A forward pass with its graph.
struct Tape {
    parameters: Vec<Tensor<1>>,
    outputs: [Tensor<2>; PROPERTIES],
    /// Mean and variance of the maps that were normalised, by normalisation.
    seen_norms: Vec<(usize, [Tensor<1>; 2])>,
}

/// The buffers of the properties, in the order of a tape's outputs.
fn property_buffers(p: &Properties) -> [&wgpu::Buffer; PROPERTIES] {
    [&p.shape_basis, &p.residual_weights, &p.coefficients, &p.regressor, &p.scale, &p.color]
}

/// Properties in the order of a tape's outputs.
fn outputs_of(canonical: Canonical, posed: Posed) -> [Tensor<2>; PROPERTIES] {
    let Canonical { shape_basis, residual_weights, .. } = canonical;
    [shape_basis, residual_weights, posed.coefficients, posed.regressor, posed.scale, posed.color]
}

fn flat(values: &[f32], device: &Device) -> Tensor<1> {
    Tensor::from_data(TensorData::new(values.to_vec(), [values.len()]), device)
}

fn table(values: &[f32], rows: usize, device: &Device) -> Tensor<2> {
    Tensor::from_data(TensorData::new(values.to_vec(), [rows, values.len() / rows.max(1)]), device)
}

impl NetworkModel {
    /// Puts tables on the device; they fill the properties of `deformation`. `model` is the hand model that was sampled.
    ///
    /// # Errors
    /// [`RenderError::Invalid`] if the hand model's UV atlas does not give the template's Gaussians;
    /// [`RenderError::Device`] if Burn cannot use the device.
    pub fn new(
        gpu: &Gpu,
        model: &HandModel,
        template: &Template,
        config: &AvatarConfig,
        tables: &NetworkTables,
        deformation: &Deformation,
    ) -> Result<NetworkModel, RenderError> {
        let invalid = |e: &dyn std::fmt::Display| RenderError::Invalid(e.to_string());
        let burn = NetworkDevice::new(gpu, NetworkPlacement::from_env(gpu)?)?;
        let device = burn.device.clone();
        let (networks, list) = Networks::new(&tables.sizes, tables.properties);
        let map = PositionMap::new(model, tables.sizes.map_side).map_err(|e| invalid(&e))?;
        let uvs = gaussian_uvs(model, config.uv_resolution).map_err(|e| invalid(&e))?;
        if uvs.len() != template.len() {
            let [expected, found] = [template.len(), uvs.len()];
            return Err(invalid(&format!("the UV atlas has {found} texels for {expected} Gaussians")));
        }
        let base = Base {
            shape_basis: table(&tables.base_shape_basis, 3 * tables.properties.bases, &device),
            logits: table(&tables.base_logits, LOGIT_ROWS, &device),
            max_scale: template.max_scale(),
        };
        Ok(NetworkModel {
            networks,
            list: list.parameters,
            parameters: tables.parameters.iter().map(|values| flat(values, &device)).collect(),
            running_norms: tables.running_norms.iter().map(|of| of.each_ref().map(|v| flat(v, &device))).collect(),
            sampler: FeatureSampler::new(&uvs, map.side(), &device),
            map,
            base,
            properties: deformation.properties().clone(),
            joint_count: template.joint_count(),
            canonical: None,
            current: None,
            seconds: [0.0; PARTS.len()],
            training: None,
            tables: tables.clone(),
            burn,
        })
    }

    /// A position map as a tensor.
    fn map_tensor(&self, image: Vec<f64>) -> Tensor<4> {
        let side = self.map.side();
        let image: Vec<f32> = image.into_iter().map(|v| v as f32).collect();
        Tensor::from_data(TensorData::new(image, [1, 3, side, side]), &self.burn.device)
    }

    /// Fills the properties for the pose of a map, without a graph.
    fn play(&mut self, gpu: &Gpu, map: Tensor<4>) -> Result<(), RenderError> {
        let fixed = (!self.running_norms.is_empty()).then_some(self.running_norms.as_slice());
        let mut pass = Pass::new(&self.parameters, fixed);
        let (canonical, first) = match self.canonical.take() {
            // The first two properties are on the device already.
            Some(canonical) => (canonical, 2),
            None => {
                let rest = self.map_tensor(self.map.rest());
                (self.networks.canonical(&mut pass, rest, &self.sampler, &self.base), 0)
            }
        };
        let posed = self.networks.posed(&mut pass, map, &self.sampler, &canonical, &self.base);
        for (k, output) in outputs_of(canonical.clone(), posed).into_iter().enumerate().skip(first) {
            self.burn.write(gpu, output, property_buffers(&self.properties)[k])?;
        }
        self.canonical = Some(canonical);
        Ok(())
    }

    /// Fills the properties for the pose of a map, and keeps the graph for the backward pass.
    fn record(&self, gpu: &Gpu, map: Tensor<4>) -> Result<Tape, RenderError> {
        let parameters: Vec<_> = self.parameters.iter().map(|p| p.clone().autodiff().require_grad()).collect();
        let mut pass = Pass::new(&parameters, None);
        let rest = self.map_tensor(self.map.rest());
        let canonical = self.networks.canonical(&mut pass, rest, &self.sampler, &self.base);
        let posed = self.networks.posed(&mut pass, map, &self.sampler, &canonical, &self.base);
        let seen_norms = std::mem::take(&mut pass.seen_norms);
        let outputs = outputs_of(canonical, posed);
        for (k, output) in outputs.iter().enumerate() {
            self.burn.write(gpu, output.clone().inner(), property_buffers(&self.properties)[k])?;
        }
        Ok(Tape { parameters, outputs, seen_norms })
    }
}

impl Training {
    /// Takes the gradients of the properties, if there are any, through the networks to the parameters.
    fn propagate(&mut self) {
        let Some(gradients) = self.property_gradients.take() else { return };
        let Some(tape) = self.tape.take() else { return };
        let products = tape.outputs.into_iter().zip(gradients).map(|(output, gradient)| (output * gradient).sum());
        let Some(sum) = products.reduce(|a, b| a + b) else { return };
        let mut all = sum.backward();
        for (parameter, so_far) in tape.parameters.iter().zip(&mut self.parameter_gradients) {
            let Some(gradient) = parameter.grad_remove(&mut all) else { continue };
            *so_far = Some(match so_far.take() {
                Some(sum) => sum + gradient,
                None => gradient,
            });
        }
    }
}

impl PropertyModel for NetworkModel {
    fn forward(
        &mut self,
        gpu: &Gpu,
        _: &mut wgpu::CommandEncoder,
        deformation: &Deformation,
    ) -> Result<(), RenderError> {
        let pose = deformation.read_pose(gpu)?;
        let joints: Vec<f32> = buffers::read(gpu, deformation.joints(), 3 * self.joint_count)?;
        let now = [pose, joints];
        let records = self.training.as_ref().is_some_and(|training| training.records);
        let is_recorded = self.training.as_ref().is_some_and(|training| training.tape.is_some());
        if is_recorded == records && self.current.as_ref() == Some(&now) {
            return Ok(());
        }
        let vectors = |values: &[f32]| -> Vec<DVec3> {
            values.chunks_exact(3).map(|v| DVec3::new(v[0].into(), v[1].into(), v[2].into())).collect()
        };
        let [pose, joints] = now.each_ref().map(|values| vectors(values));
        let start = Instant::now();
        let map = self.map_tensor(self.map.posed(&joints, &pose[..self.joint_count]));
        if records {
            self.current = None;
            // The gradients of another pose's views need that pose's graph.
            if let Some(training) = &mut self.training {
                training.propagate();
                training.tape = None;
            }
            let tape = self.record(gpu, map)?;
            if let Some(training) = &mut self.training {
                training.tape = Some(tape);
            }
        } else {
            self.play(gpu, map)?;
        }
        self.seconds[0] += start.elapsed().as_secs_f64();
        // While training, what the device has must be that of the tape.
        self.current = (records || self.training.is_none()).then_some(now);
        Ok(())
    }
}

impl TrainableModel for NetworkModel {
    fn prepare_training(
        &mut self,
        _: &Gpu,
        _: &Deformation,
        backward: &DeformationBackward,
    ) -> Result<(), RenderError> {
        let count = self.parameters.len();
        self.training = Some(Training {
            records: true,
            gradients: backward.gradients().clone(),
            tape: None,
            property_gradients: None,
            parameter_gradients: vec![None; count],
            clip: GradientClip::default(),
            adam: NetworkAdam::new(count),
        });
        self.current = None;
        Ok(())
    }

    fn expect_backward(&mut self, expected: bool) {
        self.training.iter_mut().for_each(|training| training.records = expected);
    }

    fn backward(&mut self, gpu: &Gpu, _: &mut wgpu::CommandEncoder) -> Result<(), RenderError> {
        let Some(training) = &mut self.training else { return Err(not_prepared()) };
        let Some(tape) = &training.tape else { return Err(not_prepared()) };
        let buffers = property_buffers(&training.gradients);
        let new = |k: usize| self.burn.read(gpu, buffers[k], tape.outputs[k].dims());
        let new = [new(0)?, new(1)?, new(2)?, new(3)?, new(4)?, new(5)?];
        let sums = match training.property_gradients.take() {
            Some(mut sums) => {
                sums.iter_mut().zip(new).for_each(|(sum, new)| *sum = sum.clone() + new);
                sums
            }
            None => new,
        };
        training.property_gradients = Some(sums);
        Ok(())
    }

    fn update(&mut self, _: &Gpu, _: &mut wgpu::CommandEncoder, rates: &PropertyRates) -> Result<bool, RenderError> {
        let Some(training) = &mut self.training else { return Err(not_prepared()) };
        // Each norm's last map is that of the last pose.
        let seen_norms = training.tape.as_mut().map(|tape| std::mem::take(&mut tape.seen_norms)).unwrap_or_default();
        let start = Instant::now();
        training.propagate();
        self.seconds[1] += start.elapsed().as_secs_f64();
        let start = Instant::now();
        let Some(factor) = training.clip.factor(&training.parameter_gradients)? else {
            self.discard_gradients();
            return Ok(false);
        };
        for (index, parameter) in self.parameters.iter_mut().enumerate() {
            let rate = rate_of(self.list[index].part, rates);
            if let Some(gradient) = training.parameter_gradients[index].take().filter(|_| rate > 0.0) {
                let gradient = if factor < 1.0 { gradient * factor } else { gradient };
                *parameter = training.adam.updated(index, parameter.clone(), gradient, rate, rates.step);
            }
        }
        if self.tables.sizes.normalization == Normalization::Batch {
            for (index, seen) in seen_norms {
                for (running, seen) in self.running_norms[index].iter_mut().zip(seen) {
                    *running = running.clone() * (1.0 - NORM_MOMENTUM) + seen.inner() * NORM_MOMENTUM;
                }
            }
        }
        training.tape = None;
        self.canonical = None;
        self.current = None;
        self.seconds[2] += start.elapsed().as_secs_f64();
        Ok(true)
    }

    fn discard_gradients(&mut self) {
        let Some(training) = &mut self.training else { return };
        training.tape = None;
        training.property_gradients = None;
        training.parameter_gradients.fill(None);
        self.current = None;
    }

    fn host_seconds(&self) -> Vec<(&'static str, f64)> {
        PARTS.into_iter().zip(self.seconds).collect()
    }

    fn tables(&self, _: &Gpu) -> Result<PropertyTables, RenderError> {
        let read = |tensor: &Tensor<1>| values(tensor.clone());
        let norms = |of: &[Tensor<1>; 2]| Ok::<_, RenderError>([read(&of[0])?, read(&of[1])?]);
        Ok(PropertyTables::Network(NetworkTables {
            parameters: self.parameters.iter().map(read).collect::<Result<_, _>>()?,
            running_norms: self.running_norms.iter().map(norms).collect::<Result<_, _>>()?,
            ..self.tables.clone()
        }))
    }

    fn pose_parameters(&self, _: &Gpu) -> Result<Vec<f32>, RenderError> {
        // A parameter that is not finite makes all of these so, one step later: they have gradients from every point.
        let biases = self.list.iter().zip(&self.parameters).filter(|(p, _)| p.name.ends_with(".bias"));
        let read: Result<Vec<_>, _> = biases.map(|(_, tensor)| values(tensor.clone())).collect();
        Ok(read?.concat())
    }

    fn training_state(&self, _: &Gpu) -> Result<TrainingState, RenderError> {
        let Some(training) = &self.training else { return Err(not_prepared()) };
        let mut state = vec![];
        for (index, (parameter, of)) in self.list.iter().zip(&self.parameters).enumerate() {
            state.push((parameter.name.clone(), values(of.clone())?));
            for (moment, of) in MOMENTS.into_iter().zip(training.adam.moments(index)) {
                state.push((format!("{}.{moment}", parameter.name), values(of.clone())?));
            }
        }
        state.push((CLIP.into(), training.clip.state()));
        for (index, norms) in self.running_norms.iter().enumerate() {
            for (statistic, of) in NORMS.into_iter().zip(norms) {
                state.push((format!("norm.{index}.{statistic}"), values(of.clone())?));
            }
        }
        Ok(state)
    }

    fn set_training_state(&mut self, _: &Gpu, state: &TrainingState) -> Result<(), RenderError> {
        let Some(training) = &mut self.training else { return Err(not_prepared()) };
        let device = &self.burn.device;
        for (index, (parameter, slot)) in self.list.iter().zip(&mut self.parameters).enumerate() {
            let part = |name: &str| Ok::<_, RenderError>(flat(state_part(state, name, parameter.len())?, device));
            *slot = part(&parameter.name)?;
            let [first, second] = MOMENTS.map(|moment| format!("{}.{moment}", parameter.name));
            // A parameter that has had no gradient has no moments.
            let has_moments = state.iter().any(|(name, _)| *name == first);
            let moments = if has_moments { Some([part(&first)?, part(&second)?]) } else { None };
            training.adam.set_moments(index, moments);
        }
        for (index, norms) in self.running_norms.iter_mut().enumerate() {
            for (statistic, slot) in NORMS.into_iter().zip(norms) {
                *slot = flat(state_part(state, &format!("norm.{index}.{statistic}"), slot.dims()[0])?, device);
            }
        }
        training.clip = GradientClip::from_state(state_part(state, CLIP, 1)?);
        self.canonical = None;
        self.discard_gradients();
        Ok(())
    }

    fn parameter_gradients(&mut self, _: &Gpu) -> Result<Vec<(String, Vec<f32>)>, RenderError> {
        let Some(training) = &mut self.training else { return Err(not_prepared()) };
        training.propagate();
        let gradients = self.list.iter().zip(&training.parameter_gradients);
        gradients
            .map(|(parameter, gradient)| {
                let read = gradient.clone().map_or_else(|| Ok(vec![0.0; parameter.len()]), values)?;
                Ok((parameter.name.clone(), read))
            })
            .collect()
    }
}

/// The rate of a part; 0 keeps it as it is. A property whose own rate is 0 stays as it is, too.
///
/// Residual weights learn at the rate of tables: at the networks' rate, all residual terms together lost 0.35 dB on the hand.
fn rate_of(part: Part, rates: &PropertyRates) -> f64 {
    let unless_fixed = |rate: f64| if rate > 0.0 { rates.networks } else { 0.0 };
    match part {
        Part::FeatureTensor => rates.feature_tensor,
        Part::CanonicalEncoder | Part::PoseEncoder | Part::Smoothing | Part::Trunk => rates.networks,
        Part::ShapeBasis => unless_fixed(rates.shape_basis),
        Part::ResidualWeights => rates.residual_weights,
        Part::Coefficients => unless_fixed(rates.response),
        Part::Regressor => unless_fixed(rates.regressor),
        Part::Scale => unless_fixed(rates.scale),
        Part::Color => unless_fixed(rates.color),
        Part::OwnColors => rates.color,
    }
}

fn not_prepared() -> RenderError {
    RenderError::Invalid("the property model was not prepared for training".into())
}

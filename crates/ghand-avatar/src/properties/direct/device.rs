//! The `direct` model on the device, host part of `pose_response.wgsl`.

use crate::deform::{Deformation, DeformationBackward, JointSums, invocations_of_four};
use bytemuck::{Pod, Zeroable};
use ghand_render::optimizer::{Adam, AdamTable, AdamUniforms, Grouping};
use ghand_render::pipeline::{Bound, Module, compute_pass};
use ghand_render::stages::{
    Respond, RespondBackward, RespondBackwardBindings, RespondBindings, ResponseBackward, ResponseBackwardBindings,
    ResponseTerms, ResponseTermsBindings,
};
use ghand_render::{Gpu, RenderError, buffers};

use super::tables::{APPEARANCE_ROWS, DirectTables, table_lengths};
use crate::properties::{PropertyModel, PropertyRates, PropertyTables, TrainableModel, TrainingState, state_part};
use crate::template::{AvatarConfig, FEATURES, Offsets, Template};

/// See `shaders/pose_response.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct ResponseUniforms {
    /// Rows of the blend coefficients.
    pub coefficient_rows: u32,
    /// m.
    pub color_components: u32,
    /// Largest standard deviation, metres.
    pub max_scale: f32,
    /// Unused.
    pub padding: u32,
}

/// A `direct` model: the pose response and appearance, and the shape bases, residual weights and regressor, which are
/// used as properties unchanged.
pub struct DirectModel {
    config: AvatarConfig,
    count: usize,
    joints: usize,
    sizes: wgpu::Buffer,
    joint_terms: wgpu::Buffer,
    color_channels: wgpu::Buffer,
    /// Learned: shape basis, residual weights, regressor, appearance, response. Not learned: the response's limits.
    tables: [wgpu::Buffer; 6],
    response_terms: Bound,
    respond: Bound,
    training: Option<Training>,
}

/// Buffers and pipelines that only training needs.
struct Training {
    gradients: [wgpu::Buffer; 5],
    respond_backward: Bound,
    coefficient_sums: JointSums,
    color_sums: JointSums,
    response_backward: Bound,
    adam: [AdamTable; 5],
}

/// Parts of the appearance table with separate learning rates: scale, base colour, components.
const APPEARANCE_SLOTS: usize = 3;
/// Parts of the response with separate learning rates: biases and gains of coefficients and of colours.
const RESPONSE_SLOTS: usize = 4;

impl DirectModel {
    /// Puts tables on the device; they fill the properties of `deformation`.
    pub fn new(
        gpu: &Gpu,
        template: &Template,
        config: &AvatarConfig,
        tables: &DirectTables,
        deformation: &Deformation,
    ) -> DirectModel {
        let count = template.len();
        let joints = template.joint_count();
        let p = deformation.properties();
        let as_property = |buffer: &wgpu::Buffer, values: &[f32]| {
            gpu.queue.write_buffer(buffer, 0, bytemuck::cast_slice(values));
            buffer.clone()
        };
        let on_device = [
            as_property(&p.shape_basis, &tables.shape_basis),
            as_property(&p.residual_weights, &tables.residual_weights),
            as_property(&p.regressor, &tables.regressor),
            buffers::filled(gpu, "appearance", &tables.appearance),
            buffers::filled(gpu, "response", &tables.response),
            buffers::filled(gpu, "response limits", &tables.response_limits),
        ];
        let sizes = ResponseUniforms {
            coefficient_rows: config.coefficient_rows() as u32,
            color_components: config.color_components as u32,
            max_scale: template.max_scale(),
            padding: 0,
        };
        let sizes = buffers::uniform(gpu, "response sizes", &sizes);
        let joint_terms = buffers::zeroed(gpu, "joint terms", config.channels() * joints);
        let color_channels = buffers::zeroed(gpu, "color channels", config.color_components * count);
        let [.., appearance, response, response_limits] = &on_device;
        let module = Module::new(gpu, "pose_response");
        DirectModel {
            response_terms: module.stage::<ResponseTerms>(gpu, &[]).bind(
                gpu,
                &ResponseTermsBindings {
                    pose: deformation.uniforms(),
                    response_sizes: &sizes,
                    response,
                    chain: deformation.chain(),
                    joint_terms: &joint_terms,
                    response_limits,
                },
            ),
            respond: module.stage::<Respond>(gpu, &[]).bind(
                gpu,
                &RespondBindings {
                    pose: deformation.uniforms(),
                    response_sizes: &sizes,
                    response,
                    joint_terms: &joint_terms,
                    appearance,
                    coefficients: &p.coefficients,
                    scale: &p.scale,
                    color: &p.color,
                    color_channels: &color_channels,
                    weights: deformation.weights(),
                },
            ),
            config: config.clone(),
            count,
            joints,
            sizes,
            joint_terms,
            color_channels,
            tables: on_device,
            training: None,
        }
    }

    fn lengths(&self) -> [usize; 6] {
        table_lengths(self.count, self.joints, &self.config)
    }
}

impl PropertyModel for DirectModel {
    fn forward(&mut self, _: &Gpu, encoder: &mut wgpu::CommandEncoder, _: &Deformation) -> Result<(), RenderError> {
        let mut pass = compute_pass(encoder, "pose response");
        self.response_terms.dispatch_invocations(&mut pass, (self.config.channels() * self.joints) as u32);
        self.respond.dispatch_invocations(&mut pass, invocations_of_four(self.count));
        Ok(())
    }
}

impl TrainableModel for DirectModel {
    fn prepare_training(
        &mut self,
        gpu: &Gpu,
        deformation: &Deformation,
        backward: &DeformationBackward,
    ) -> Result<(), RenderError> {
        let lengths = self.lengths();
        let what = format!("the gradients of an avatar of {} Gaussians", self.count);
        let (gradients, respond_backward, coefficient_sums, color_sums, response_backward) =
            gpu.scoped(&what, || {
                let d = backward.gradients();
                let gradients = [
                    d.shape_basis.clone(),
                    d.residual_weights.clone(),
                    d.regressor.clone(),
                    buffers::zeroed(gpu, "d appearance", lengths[3]),
                    buffers::zeroed(gpu, "d response", lengths[4]),
                ];
                let d_color_channels =
                    buffers::zeroed(gpu, "d color channels", self.config.color_components * self.count);
                let sums = |right: &wgpu::Buffer, rows: usize| {
                    JointSums::of_weights(gpu, deformation.weights(), self.joints, right, 0, rows, self.count)
                };
                let coefficient_sums = sums(&d.coefficients, self.config.coefficient_rows());
                let color_sums = sums(&d_color_channels, self.config.color_components);
                let module = Module::new(gpu, "pose_response");
                let [.., appearance, response, response_limits] = &self.tables;
                let [.., d_appearance, d_response] = &gradients;
                let respond_backward = module.stage::<RespondBackward>(gpu, &[]).bind(
                    gpu,
                    &RespondBackwardBindings {
                        pose: deformation.uniforms(),
                        response_sizes: &self.sizes,
                        appearance,
                        d_scale: &d.scale,
                        d_appearance,
                        d_color_channels: &d_color_channels,
                        d_color: &d.color,
                        color_channels: &self.color_channels,
                    },
                );
                let response_backward = module.stage::<ResponseBackward>(gpu, &[]).bind(
                    gpu,
                    &ResponseBackwardBindings {
                        pose: deformation.uniforms(),
                        response_sizes: &self.sizes,
                        response,
                        chain: deformation.chain(),
                        joint_terms: &self.joint_terms,
                        d_coefficient_terms: &coefficient_sums.total,
                        d_response,
                        d_local: backward.d_local(),
                        response_limits,
                        d_color_terms: &color_sums.total,
                    },
                );
                (gradients, respond_backward, coefficient_sums, color_sums, response_backward)
            })?;
        let adam = Adam::new(gpu)?;
        let table =
            |i: usize, slots| adam.table(gpu, &self.tables[i], &gradients[i], lengths[i], slots, Grouping::Scalars);
        let adam = [table(0, 1)?, table(1, 1)?, table(2, 1)?, table(3, APPEARANCE_SLOTS)?, table(4, RESPONSE_SLOTS)?];
        self.training =
            Some(Training { gradients, respond_backward, coefficient_sums, color_sums, response_backward, adam });
        Ok(())
    }

    fn backward(&mut self, _: &Gpu, encoder: &mut wgpu::CommandEncoder) -> Result<(), RenderError> {
        let Some(training) = &self.training else { return Err(not_prepared()) };
        let mut pass = compute_pass(encoder, "pose response backward");
        training.respond_backward.dispatch_invocations(&mut pass, self.count as u32);
        training.coefficient_sums.encode(&mut pass);
        training.color_sums.encode(&mut pass);
        let invocations = self.config.channels().max(self.joints) as u32;
        training.response_backward.dispatch_invocations(&mut pass, invocations);
        Ok(())
    }

    fn update(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        rates: &PropertyRates,
    ) -> Result<bool, RenderError> {
        let Some(training) = &self.training else { return Err(not_prepared()) };
        let n = self.count;
        let lengths = self.lengths();
        let mut pass = compute_pass(encoder, "update");
        // Rows of the appearance table: scale, base colour (3), components.
        // Rows of the response: biases, gains; each of coefficients, then of colours.
        let rows = self.config.coefficient_rows();
        let channels = self.config.channels();
        let gains = channels + rows * self.joints * FEATURES;
        // Free offsets are linear in the joints' rotations as these are.
        let of_coefficients = if self.config.offsets == Offsets::Free { 0.0 } else { rates.response };
        let ranges = [
            (0, 0, 0..lengths[0], rates.shape_basis),
            (1, 0, 0..lengths[1], rates.residual_weights),
            (2, 0, 0..lengths[2], rates.regressor),
            (3, 0, 0..n, rates.scale),
            (3, 1, n..APPEARANCE_ROWS * n, rates.color),
            (3, 2, APPEARANCE_ROWS * n..lengths[3], rates.color_components),
            (4, 0, 0..rows, of_coefficients),
            (4, 1, rows..channels, rates.response),
            (4, 2, channels..gains, of_coefficients),
            (4, 3, gains..lengths[4], rates.response),
        ];
        for (table, slot, range, rate) in ranges {
            if rate > 0.0 && !range.is_empty() {
                let start = range.start;
                training.adam[table].encode(gpu, &mut pass, slot, &AdamUniforms::new(range, start, rate, rates.step));
            }
        }
        Ok(true)
    }

    fn tables(&self, gpu: &Gpu) -> Result<PropertyTables, RenderError> {
        let [shape, weights, regressor, appearance, response, limits] = self.lengths();
        Ok(PropertyTables::Direct(DirectTables {
            shape_basis: buffers::read(gpu, &self.tables[0], shape)?,
            residual_weights: buffers::read(gpu, &self.tables[1], weights)?,
            regressor: buffers::read(gpu, &self.tables[2], regressor)?,
            appearance: buffers::read(gpu, &self.tables[3], appearance)?,
            response: buffers::read(gpu, &self.tables[4], response)?,
            response_limits: buffers::read(gpu, &self.tables[5], limits)?,
        }))
    }

    fn pose_parameters(&self, gpu: &Gpu) -> Result<Vec<f32>, RenderError> {
        buffers::read(gpu, &self.tables[4], self.lengths()[4])
    }

    fn training_state(&self, gpu: &Gpu) -> Result<TrainingState, RenderError> {
        let Some(training) = &self.training else { return Err(not_prepared()) };
        let mut state = vec![];
        for (k, name) in NAMES.into_iter().enumerate() {
            state.push((name.to_owned(), buffers::read(gpu, &self.tables[k], self.lengths()[k])?));
            state.push((moments_of(name), training.adam[k].read_moments(gpu)?));
        }
        Ok(state)
    }

    fn set_training_state(&mut self, gpu: &Gpu, state: &TrainingState) -> Result<(), RenderError> {
        let Some(training) = &self.training else { return Err(not_prepared()) };
        for (k, name) in NAMES.into_iter().enumerate() {
            let length = self.lengths()[k];
            let [values, moments] =
                [state_part(state, name, length)?, state_part(state, &moments_of(name), 2 * length)?];
            gpu.queue.write_buffer(&self.tables[k], 0, bytemuck::cast_slice(values));
            gpu.queue.write_buffer(&training.adam[k].moments, 0, bytemuck::cast_slice(moments));
        }
        Ok(())
    }

    fn parameter_gradients(&mut self, gpu: &Gpu) -> Result<Vec<(String, Vec<f32>)>, RenderError> {
        let Some(training) = &self.training else { return Err(not_prepared()) };
        let read = |i: usize| Ok((NAMES[i].to_owned(), buffers::read(gpu, &training.gradients[i], self.lengths()[i])?));
        (0..NAMES.len()).map(read).collect()
    }
}

/// Names of the learned tables in avatar files.
const NAMES: [&str; 5] = ["shape_basis", "residual_weights", "skeleton_regressor", "appearance", "response"];

fn moments_of(name: &str) -> String {
    format!("{name}.moments")
}

fn not_prepared() -> RenderError {
    RenderError::Invalid("the property model was not prepared for training".into())
}

//! The `direct` property model: free tables over the Gaussians, and a local, linear dependence on the pose.

use bytemuck::{Pod, Zeroable};
use ghand_render::pipeline::{Bound, Module, compose};
use ghand_render::pose::{JointSums, PoseBackward, PosePipeline, Properties, PropertyGradients};
use ghand_render::{Gpu, RenderError, buffers};
use glam::DVec3;
use rand::{RngExt, SeedableRng};

use crate::avatar::{AvatarConfig, Template, max_scale};
use crate::response_limits::unlimited;

/// Rows of the appearance table before the colour components: scale logit and base colour.
const APPEARANCE_ROWS: usize = 4;

/// The learned numbers of a direct avatar; all tables are row-major `[rows][N]` unless said otherwise.
#[derive(Debug, Clone, PartialEq)]
pub struct DirectTables {
    /// S, `[n * 3][N]`, metres.
    pub shape_basis: Vec<f32>,
    /// W^, `[n_b][N]`.
    pub residual_weights: Vec<f32>,
    /// R, `[n_b][N]`.
    pub regressor: Vec<f32>,
    /// Scale logit, base colour logits (3), colour components (3 each), `[4 + 3 m][N]`.
    pub appearance: Vec<f32>,
    /// Biases `[n + m]`, then gains `[n + m][n_b][9]`.
    pub response: Vec<f32>,
    /// Smallest and largest term of each joint in each channel of the response, `[n + m][n_b][2]`; not learned.
    pub response_limits: Vec<f32>,
}

/// Lengths of the tables of [`DirectTables`], in the order of its fields.
pub fn table_lengths(count: usize, joints: usize, config: &AvatarConfig) -> [usize; 6] {
    let channels = config.shape_bases + config.color_components;
    [
        3 * config.shape_bases * count,
        joints * count,
        joints * count,
        (APPEARANCE_ROWS + 3 * config.color_components) * count,
        channels + channels * joints * 9,
        channels * joints * 2,
    ]
}

/// Standard deviation of the bases that start without effect: far below what shows, enough to break symmetry.
const BASIS_NOISE: f32 = 1e-4;
/// The same for the colour components, in logits.
const COMPONENT_NOISE: f32 = 0.1;
/// Standard deviation of a fresh Gaussian in multiples of its spacing: neighbours just close the surface.
const START_SCALE: f32 = 0.7;

fn logit(x: f32) -> f32 {
    (x / (1.0 - x)).ln()
}

impl DirectTables {
    /// Tables under which the avatar is the template's plain surface in one colour. The first basis has a constant
    /// coefficient of 1; all others and all colour components start with coefficient 0.
    ///
    /// Against the `normals` (N, outwards) the first basis pushes each Gaussian inwards by `inset` times its size: splats
    /// reach beyond their centres, and the silhouette should start where the surface ends.
    pub fn untrained(
        template: &Template,
        normals: &[DVec3],
        inset: f64,
        config: &AvatarConfig,
        color: [f64; 3],
        seed: u64,
    ) -> DirectTables {
        let (count, joints) = (template.len(), template.joint_count());
        let lengths = table_lengths(count, joints, config);
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        // The sum of four uniform numbers: near enough to a normal one, and the same bits everywhere.
        let mut noise = |size: f32| -> f32 {
            let sum: f32 = (0..4).map(|_| rng.random_range(-1.0f32..1.0)).sum();
            sum * size * (3.0f32 / 4.0).sqrt()
        };
        let mut shape_basis = vec![0.0; lengths[0]];
        shape_basis.iter_mut().skip(3 * count).for_each(|s| *s = noise(BASIS_NOISE));
        for (c, row) in shape_basis.chunks_exact_mut(count.max(1)).take(3).enumerate() {
            for ((slot, normal), spacing) in row.iter_mut().zip(normals).zip(&template.spacings) {
                *slot = -(normal[c] * inset) as f32 * START_SCALE * spacing;
            }
        }
        let largest = max_scale(template);
        let mut appearance: Vec<f32> =
            template.spacings.iter().map(|s| logit((START_SCALE * s / largest).clamp(0.02, 0.9))).collect();
        for channel in color {
            appearance.extend(std::iter::repeat_n(logit((channel as f32).clamp(0.01, 0.99)), count));
        }
        appearance.extend((0..lengths[3] - APPEARANCE_ROWS * count).map(|_| noise(COMPONENT_NOISE)));
        let mut response = vec![0.0; lengths[4]];
        if let Some(first) = response.first_mut() {
            *first = 1.0;
        }
        DirectTables {
            shape_basis,
            residual_weights: vec![0.0; lengths[1]],
            regressor: vec![0.0; lengths[2]],
            appearance,
            response,
            response_limits: unlimited(lengths[5] / 2),
        }
    }
}

impl DirectTables {
    /// Sets the base colour of each Gaussian (display values 0..1), as many as there are.
    pub fn set_base_colors(&mut self, colors: &[[f64; 3]]) {
        let count = colors.len();
        for channel in 0..3 {
            let row = self.appearance.iter_mut().skip((1 + channel) * count);
            row.zip(colors).for_each(|(slot, color)| *slot = logit((color[channel] as f32).clamp(0.01, 0.99)));
        }
    }
}

/// See `shaders/pose_response.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct ResponseUniforms {
    /// m.
    pub color_components: u32,
    /// Largest standard deviation, metres.
    pub max_scale: f32,
    /// Unused.
    pub padding: [u32; 2],
}

/// The tables on the device.
#[derive(Debug, Clone)]
pub struct DirectBuffers {
    /// S.
    pub shape_basis: wgpu::Buffer,
    /// W^.
    pub residual_weights: wgpu::Buffer,
    /// R.
    pub regressor: wgpu::Buffer,
    /// Scale, colour, colour components.
    pub appearance: wgpu::Buffer,
    /// Biases and gains.
    pub response: wgpu::Buffer,
    /// Limits of the joint terms. They get no gradient: among gradients the buffer is not used.
    pub response_limits: wgpu::Buffer,
    /// Channel values `[n + m][N]` of the current pose.
    pub channels: wgpu::Buffer,
}

impl DirectBuffers {
    /// Uploads tables.
    pub fn upload(gpu: &Gpu, tables: &DirectTables, count: usize, config: &AvatarConfig) -> DirectBuffers {
        DirectBuffers {
            shape_basis: buffers::filled(gpu, "shape basis", &tables.shape_basis),
            residual_weights: buffers::filled(gpu, "residual weights", &tables.residual_weights),
            regressor: buffers::filled(gpu, "regressor", &tables.regressor),
            appearance: buffers::filled(gpu, "appearance", &tables.appearance),
            response: buffers::filled(gpu, "response", &tables.response),
            response_limits: buffers::filled(gpu, "response limits", &tables.response_limits),
            channels: buffers::zeroed(gpu, "channels", (config.shape_bases + config.color_components) * count),
        }
    }

    /// Zeroed buffers of the same sizes, for gradients.
    pub fn zeroed(gpu: &Gpu, count: usize, joints: usize, config: &AvatarConfig) -> DirectBuffers {
        let [shape, weights, regressor, appearance, response, limits] = table_lengths(count, joints, config);
        DirectBuffers {
            shape_basis: buffers::zeroed(gpu, "d shape basis", shape),
            residual_weights: buffers::zeroed(gpu, "d residual weights", weights),
            regressor: buffers::zeroed(gpu, "d regressor", regressor),
            appearance: buffers::zeroed(gpu, "d appearance", appearance),
            response: buffers::zeroed(gpu, "d response", response),
            response_limits: buffers::zeroed(gpu, "d response limits", limits),
            channels: buffers::zeroed(gpu, "d channels", (config.shape_bases + config.color_components) * count),
        }
    }

    /// Reads the tables back.
    ///
    /// # Errors
    /// [`RenderError`] if the device failed or was lost.
    pub fn download(
        &self,
        gpu: &Gpu,
        count: usize,
        joints: usize,
        config: &AvatarConfig,
    ) -> Result<DirectTables, RenderError> {
        let [shape, weights, regressor, appearance, response, limits] = table_lengths(count, joints, config);
        Ok(DirectTables {
            shape_basis: buffers::read(gpu, &self.shape_basis, shape)?,
            residual_weights: buffers::read(gpu, &self.residual_weights, weights)?,
            regressor: buffers::read(gpu, &self.regressor, regressor)?,
            appearance: buffers::read(gpu, &self.appearance, appearance)?,
            response: buffers::read(gpu, &self.response, response)?,
            response_limits: buffers::read(gpu, &self.response_limits, limits)?,
        })
    }

    /// What the pose pipeline reads.
    pub fn properties(&self) -> Properties {
        Properties {
            shape_basis: self.shape_basis.clone(),
            coefficients: self.channels.clone(),
            residual_weights: self.residual_weights.clone(),
            regressor: self.regressor.clone(),
        }
    }

    /// The same buffers as gradients.
    pub fn property_gradients(&self) -> PropertyGradients {
        PropertyGradients {
            shape_basis: self.shape_basis.clone(),
            coefficients: self.channels.clone(),
            residual_weights: self.residual_weights.clone(),
            regressor: self.regressor.clone(),
        }
    }
}

/// The WGSL of the model's stages, as the device gets it.
pub fn shader_source() -> String {
    compose(&[
        include_str!("../../../shaders/shared/pose.wgsl"),
        include_str!("../../../shaders/shared/four.wgsl"),
        include_str!("../../../shaders/shared/gaussian_rows.wgsl"),
        include_str!("../../../shaders/pose_response.wgsl"),
    ])
}

fn module(gpu: &Gpu) -> Module {
    Module::new(gpu, "pose_response", &shader_source())
}

/// Forward stages: pose to coefficients, scales and colours.
pub struct DirectForward {
    sizes: wgpu::Buffer,
    joint_terms: wgpu::Buffer,
    response_terms: Bound,
    respond: Bound,
    term_groups: u32,
    point_groups: u32,
}

impl DirectForward {
    /// Stages that fill the channel values and rows 3 to 6 of `gaussians`.
    pub fn new(
        gpu: &Gpu,
        pose: &PosePipeline,
        buffers_in: &DirectBuffers,
        gaussians: &wgpu::Buffer,
        template: &Template,
        config: &AvatarConfig,
    ) -> DirectForward {
        let module = module(gpu);
        let sizes = ResponseUniforms {
            color_components: config.color_components as u32,
            max_scale: max_scale(template),
            padding: [0; 2],
        };
        let sizes = buffers::uniform(gpu, "response sizes", &sizes);
        let channels = config.shape_bases + config.color_components;
        let terms = channels * template.joint_count();
        let joint_terms = buffers::zeroed(gpu, "joint terms", terms);
        DirectForward {
            response_terms: module.stage(gpu, "response_terms", &[]).bind(
                gpu,
                &[
                    (0, pose.uniforms()),
                    (1, &sizes),
                    (2, &buffers_in.response),
                    (3, &pose.chain),
                    (4, &joint_terms),
                    (15, &buffers_in.response_limits),
                ],
            ),
            respond: module.stage(gpu, "respond", &[]).bind(
                gpu,
                &[
                    (0, pose.uniforms()),
                    (1, &sizes),
                    (2, &buffers_in.response),
                    (4, &joint_terms),
                    (5, &pose.weights),
                    (6, &buffers_in.appearance),
                    (7, &buffers_in.channels),
                    (8, gaussians),
                ],
            ),
            sizes,
            joint_terms,
            term_groups: (terms as u32).div_ceil(64),
            point_groups: (template.len() as u32).div_ceil(64),
        }
    }

    /// Encodes the response; the skeleton must have been encoded before.
    pub fn encode(&self, pass: &mut wgpu::ComputePass<'_>) {
        self.response_terms.dispatch(pass, self.term_groups);
        // Four points an invocation.
        self.respond.dispatch(pass, self.point_groups.div_ceil(4));
    }
}

/// Backward stages.
pub struct DirectBackward {
    respond_backward: Bound,
    term_sums: JointSums,
    response_backward: Bound,
    point_groups: u32,
    response_groups: u32,
}

impl DirectBackward {
    /// The backward half of `forward`; `gradients` gets dL/d(tables).
    #[expect(clippy::too_many_arguments, reason = "every argument is a different part of the pipeline it is bound to")]
    pub fn new(
        gpu: &Gpu,
        forward: &DirectForward,
        pose: &PosePipeline,
        pose_backward: &PoseBackward,
        tables: &DirectBuffers,
        gradients: &DirectBuffers,
        gaussians: [&wgpu::Buffer; 2],
        template: &Template,
        config: &AvatarConfig,
    ) -> DirectBackward {
        let module = module(gpu);
        let (count, joints) = (template.len(), template.joint_count());
        let channels = config.shape_bases + config.color_components;
        let [gaussians, d_gaussians] = gaussians;
        let term_sums = JointSums::new(gpu, &pose.weights, joints, &gradients.channels, 0, channels, count);
        DirectBackward {
            respond_backward: module.stage(gpu, "respond_backward", &[]).bind(
                gpu,
                &[
                    (0, pose.uniforms()),
                    (1, &forward.sizes),
                    (6, &tables.appearance),
                    (7, &tables.channels),
                    (8, gaussians),
                    (9, d_gaussians),
                    (10, &gradients.appearance),
                    (11, &gradients.channels),
                ],
            ),
            response_backward: module.stage(gpu, "response_backward", &[]).bind(
                gpu,
                &[
                    (0, pose.uniforms()),
                    (1, &forward.sizes),
                    (2, &tables.response),
                    (3, &pose.chain),
                    (4, &forward.joint_terms),
                    (12, &term_sums.total),
                    (13, &gradients.response),
                    (14, &pose_backward.d_local),
                    (15, &tables.response_limits),
                ],
            ),
            term_sums,
            point_groups: (count as u32).div_ceil(64),
            response_groups: (channels.max(joints) as u32).div_ceil(64),
        }
    }

    /// Encodes the appearance's gradient and that of the colour channels.
    pub fn encode_appearance(&self, pass: &mut wgpu::ComputePass<'_>) {
        self.respond_backward.dispatch(pass, self.point_groups);
    }

    /// Encodes the response's gradient, once all channels have theirs.
    pub fn encode_response(&self, pass: &mut wgpu::ComputePass<'_>) {
        self.term_sums.encode(pass);
        self.response_backward.dispatch(pass, self.response_groups);
    }
}

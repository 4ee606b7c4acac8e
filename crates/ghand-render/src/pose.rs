//! The avatar's pose pipeline: property tables and a pose to posed Gaussians, and the gradient back.
//!
//! skeleton -> blend_shapes -> residual_skeleton -> skin; all tables are joint- or component-major (`[rows][N]`), so that
//! neighbouring invocations touch neighbouring words.

use bytemuck::{Pod, Zeroable};

use crate::pipeline::{Bound, Module};
use crate::{Gpu, buffers, shader_sources};

/// Floats of one joint in a chain, as in `shaders/shared/pose.wgsl`.
const CHAIN_STRIDE: usize = 33;
/// Rows of the table of offsets and points.
const OFFSET_ROWS: usize = 6;
/// Rows of the table of skinning gradients.
const SKIN_GRADIENT_ROWS: usize = 15;
const ROW_MOMENT: u32 = 3;

/// See `shaders/shared/pose.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct PoseUniforms {
    /// N.
    pub gaussian_count: u32,
    /// `n_b`.
    pub joint_count: u32,
    /// n.
    pub basis_count: u32,
    /// Where the frame's pose starts in the poses, floats.
    pub pose_offset: u32,
    /// Whether the residual skeleton stands on the rest joints.
    pub anchored: u32,
    /// Whether the mean over joints is taken off the residual weights.
    pub zero_sum: u32,
    /// d(offset loss)/d(offset) as a multiple of the offset.
    pub offset_weight: f32,
    /// d(scale loss)/d(scale) as a multiple of the scale.
    pub scale_weight: f32,
}

/// What a pose pipeline is made for.
#[derive(Debug, Clone, Copy)]
pub struct Template<'a> {
    /// Rest positions, `[3][N]`, metres.
    pub rest: &'a [f32],
    /// Skinning weights, `[n_b][N]`.
    pub weights: &'a [f32],
    /// Rest joints, `[n_b][3]`, metres.
    pub joints: &'a [f32],
    /// Parent of each joint, -1 for the root.
    pub parents: &'a [i32],
    /// Number of shape bases, n.
    pub basis_count: usize,
    /// How many poses the pose table holds.
    pub frames: usize,
    /// Whether the residual skeleton stands on the rest joints.
    pub anchored: bool,
    /// Whether the mean over joints is taken off the residual weights.
    pub zero_sum: bool,
}

/// Number of floats of a pose of `joint_count` joints: a rotation each, and the translation.
pub fn pose_stride(joint_count: usize) -> usize {
    3 * joint_count + 3
}

/// The learned tables that the pose pipeline reads; made by whatever property model there is.
#[derive(Debug, Clone)]
pub struct Properties {
    /// S, `[n * 3][N]`, metres.
    pub shape_basis: wgpu::Buffer,
    /// C, `[n][N]` (more rows may follow).
    pub coefficients: wgpu::Buffer,
    /// W^, `[n_b][N]`.
    pub residual_weights: wgpu::Buffer,
    /// R, `[n_b][N]`.
    pub regressor: wgpu::Buffer,
}

/// Forward pose pipeline with its buffers.
pub struct PosePipeline {
    uniforms: wgpu::Buffer,
    current: PoseUniforms,
    /// Poses, `[frames][n_b * 3 + 3]`: axis-angles, then the translation.
    pub poses: wgpu::Buffer,
    /// Skinning weights, `[n_b][N]`.
    pub weights: wgpu::Buffer,
    /// The posed chain, see `shaders/shared/pose.wgsl`.
    pub chain: wgpu::Buffer,
    parents: wgpu::Buffer,
    /// Rest joints, `[n_b][3]`, metres.
    pub joints: wgpu::Buffer,
    residual_joints: wgpu::Buffer,
    residual_chain: wgpu::Buffer,
    offsets: wgpu::Buffer,
    skeleton: Bound,
    blend_shapes: Bound,
    regress: JointSums,
    place_residual_joints: Bound,
    residual_skeleton: Bound,
    skin: Bound,
}

/// Workgroups of stages that handle four points an invocation (`shaders/shared/four.wgsl`).
fn groups_of_four(count: u32) -> u32 {
    count.div_ceil(4).div_ceil(64)
}

fn groups(count: u32) -> u32 {
    count.div_ceil(64)
}

impl PosePipeline {
    /// A pipeline that fills rows 0 to 2 of `gaussians` (`[rows][N]`) from the properties and a pose.
    pub fn new(gpu: &Gpu, template: &Template, properties: &Properties, gaussians: &wgpu::Buffer) -> PosePipeline {
        let joint_count = template.parents.len();
        let count = template.rest.len() / 3;
        let current = PoseUniforms {
            gaussian_count: count as u32,
            joint_count: joint_count as u32,
            basis_count: template.basis_count as u32,
            pose_offset: 0,
            anchored: template.anchored.into(),
            zero_sum: template.zero_sum.into(),
            offset_weight: 0.0,
            scale_weight: 0.0,
        };
        let uniforms = buffers::uniform(gpu, "pose", &current);
        let poses = buffers::zeroed(gpu, "poses", template.frames * pose_stride(joint_count));
        let rest = buffers::filled(gpu, "rest", template.rest);
        let weights = buffers::filled(gpu, "weights", template.weights);
        let joints = buffers::filled(gpu, "joints", template.joints);
        let parents = buffers::filled(gpu, "parents", template.parents);
        let residual_joints = buffers::zeroed(gpu, "residual joints", 3 * joint_count);
        let chain = buffers::zeroed(gpu, "chain", CHAIN_STRIDE * joint_count);
        let residual_chain = buffers::zeroed(gpu, "residual chain", CHAIN_STRIDE * joint_count);
        let offsets = buffers::zeroed(gpu, "offsets", OFFSET_ROWS * count);

        let skeletons = Module::new(gpu, "skeleton", &shader_sources::skeleton());
        let skeleton = skeletons.stage(gpu, "skeleton", &[]);
        let residual_skeleton = skeletons.stage(gpu, "residual_skeleton", &[]);
        let blend = Module::new(gpu, "blend_shapes", &shader_sources::blend_shapes()).stage(gpu, "blend_shapes", &[]);
        let residual = Module::new(gpu, "residual_skeleton", &shader_sources::residual_skeleton()).stage(
            gpu,
            "place_residual_joints",
            &[],
        );
        let skin = Module::new(gpu, "skin", &shader_sources::skin()).stage(gpu, "skin", &[]);
        let regress = JointSums::new(gpu, &properties.regressor, joint_count, &offsets, 0, 3, count);
        PosePipeline {
            skeleton: skeleton.bind(gpu, &[(0, &uniforms), (1, &poses), (2, &parents), (3, &joints), (4, &chain)]),
            blend_shapes: blend.bind(
                gpu,
                &[
                    (0, &uniforms),
                    (1, &rest),
                    (2, &properties.shape_basis),
                    (3, &properties.coefficients),
                    (4, &offsets),
                ],
            ),
            place_residual_joints: residual
                .bind(gpu, &[(0, &uniforms), (1, &joints), (2, &regress.total), (3, &residual_joints)]),
            residual_skeleton: residual_skeleton
                .bind(gpu, &[(0, &uniforms), (1, &poses), (2, &parents), (3, &residual_joints), (4, &residual_chain)]),
            skin: skin.bind(
                gpu,
                &[
                    (0, &uniforms),
                    (1, &offsets),
                    (2, &weights),
                    (3, &properties.residual_weights),
                    (4, &chain),
                    (5, &residual_chain),
                    (6, &poses),
                    (7, gaussians),
                ],
            ),
            regress,
            uniforms,
            current,
            poses,
            weights,
            chain,
            parents,
            joints,
            residual_joints,
            residual_chain,
            offsets,
        }
    }

    /// The uniforms, for stages of a property model.
    pub fn uniforms(&self) -> &wgpu::Buffer {
        &self.uniforms
    }

    /// The sizes and switches in force.
    pub fn current(&self) -> &PoseUniforms {
        &self.current
    }

    /// Chooses the frame whose pose is used, and the weights of the offset and scale losses, for what is encoded from
    /// now on.
    pub fn set_frame(&mut self, gpu: &Gpu, frame: usize, offset_weight: f32, scale_weight: f32) {
        self.current.pose_offset = (frame * pose_stride(self.current.joint_count as usize)) as u32;
        self.current.offset_weight = offset_weight;
        self.current.scale_weight = scale_weight;
        gpu.queue.write_buffer(&self.uniforms, 0, bytemuck::bytes_of(&self.current));
    }

    /// Encodes the chain; the coefficients may depend on it.
    pub fn encode_skeleton(&self, pass: &mut wgpu::ComputePass<'_>) {
        self.skeleton.dispatch(pass, 1);
    }

    /// Encodes offsets, residual skeleton and skinning, once the coefficients are there.
    pub fn encode_skin(&self, pass: &mut wgpu::ComputePass<'_>) {
        let n = self.current.gaussian_count;
        self.blend_shapes.dispatch(pass, groups(n));
        self.regress.encode(pass);
        self.place_residual_joints.dispatch(pass, (3 * self.current.joint_count).div_ceil(32));
        self.residual_skeleton.dispatch(pass, 1);
        self.skin.dispatch(pass, groups_of_four(n));
    }
}

/// Gradients of the learned tables, shaped like [`Properties`].
#[derive(Debug, Clone)]
pub struct PropertyGradients {
    /// dL/dS.
    pub shape_basis: wgpu::Buffer,
    /// dL/dC, in the first rows of a buffer shaped like the coefficients.
    pub coefficients: wgpu::Buffer,
    /// dL/dW^.
    pub residual_weights: wgpu::Buffer,
    /// dL/dR.
    pub regressor: wgpu::Buffer,
}

/// Backward pose pipeline.
pub struct PoseBackward {
    /// dL/d(pose), `[n_b * 3 + 3]`, of the frame.
    pub d_pose: wgpu::Buffer,
    /// dL/d(rest joints), `[n_b][3]`.
    pub d_joints: wgpu::Buffer,
    /// dL/d(local rotations), `[n_b][9]`; a property model adds its part between the two halves.
    pub d_local: wgpu::Buffer,
    joint_count: u32,
    gaussian_count: u32,
    skin_backward: Bound,
    residual_bone_sums: JointSums,
    residual_skeleton_backward: Bound,
    residual_joints_backward: Bound,
    blend_shapes_backward: Bound,
    bone_sums: JointSums,
    main_skeleton_backward: Bound,
    rotation_backward: Bound,
}

impl PoseBackward {
    /// The backward half of `forward`; `d_gaussians` holds dL/d(posed mean) in rows 0 to 2. `mobility` is 1 for each
    /// joint whose rotation gets a gradient and 0 for the others.
    pub fn new(
        gpu: &Gpu,
        forward: &PosePipeline,
        properties: &Properties,
        gradients: &PropertyGradients,
        d_gaussians: &wgpu::Buffer,
        mobility: &[f32],
    ) -> PoseBackward {
        let PoseUniforms { gaussian_count, joint_count, .. } = forward.current;
        let (count, joints) = (gaussian_count as usize, joint_count as usize);
        let mobility = buffers::filled(gpu, "mobility", mobility);
        let d_pose = buffers::zeroed(gpu, "d_pose", pose_stride(joints));
        let d_local = buffers::zeroed(gpu, "d_local", 9 * joints);
        let d_skin = buffers::zeroed(gpu, "d_skin", SKIN_GRADIENT_ROWS * count);
        let d_joints = buffers::zeroed(gpu, "d_joints", 3 * joints);
        let d_residual_joints = buffers::zeroed(gpu, "d_residual_joints", 3 * joints);

        let skin = Module::new(gpu, "skin_backward", &shader_sources::skin_backward()).stage(gpu, "skin_backward", &[]);
        let skeleton = Module::new(gpu, "skeleton_backward", &shader_sources::skeleton_backward());
        let residual = Module::new(gpu, "residual_skeleton", &shader_sources::residual_skeleton()).stage(
            gpu,
            "residual_joints_backward",
            &[],
        );
        let blend =
            Module::new(gpu, "blend_shapes", &shader_sources::blend_shapes()).stage(gpu, "blend_shapes_backward", &[]);
        let uniforms = &forward.uniforms;
        let residual_bone_sums =
            JointSums::new(gpu, &properties.residual_weights, joints, &d_skin, ROW_MOMENT, 12, count);
        let bone_sums = JointSums::new(gpu, &forward.weights, joints, &d_skin, ROW_MOMENT, 12, count);
        PoseBackward {
            skin_backward: skin.bind(
                gpu,
                &[
                    (0, uniforms),
                    (1, &forward.offsets),
                    (2, &forward.weights),
                    (3, &properties.residual_weights),
                    (4, &forward.chain),
                    (5, &forward.residual_chain),
                    (6, d_gaussians),
                    (7, &d_skin),
                    (8, &gradients.residual_weights),
                ],
            ),
            residual_skeleton_backward: skeleton.stage(gpu, "residual_skeleton_backward", &[]).bind(
                gpu,
                &[
                    (0, uniforms),
                    (2, &forward.parents),
                    (3, &forward.residual_joints),
                    (4, &forward.residual_chain),
                    (5, &residual_bone_sums.total),
                    (6, &d_local),
                    (7, &d_residual_joints),
                ],
            ),
            residual_joints_backward: residual.bind(
                gpu,
                &[
                    (0, uniforms),
                    (4, &properties.regressor),
                    (5, &forward.offsets),
                    (6, &d_residual_joints),
                    (7, &d_skin),
                    (8, &gradients.regressor),
                ],
            ),
            blend_shapes_backward: blend.bind(
                gpu,
                &[
                    (0, uniforms),
                    (2, &properties.shape_basis),
                    (3, &properties.coefficients),
                    (5, &d_skin),
                    (6, &gradients.shape_basis),
                    (7, &gradients.coefficients),
                ],
            ),
            main_skeleton_backward: skeleton.stage(gpu, "main_skeleton_backward", &[]).bind(
                gpu,
                &[
                    (0, uniforms),
                    (2, &forward.parents),
                    (3, &forward.joints),
                    (4, &forward.chain),
                    (5, &bone_sums.total),
                    (6, &d_local),
                    (7, &d_joints),
                    (8, &d_pose),
                    (10, &d_residual_joints),
                ],
            ),
            rotation_backward: skeleton
                .stage(gpu, "rotation_backward", &[])
                .bind(gpu, &[(0, uniforms), (1, &forward.poses), (6, &d_local), (8, &d_pose), (9, &mobility)]),
            residual_bone_sums,
            bone_sums,
            d_joints,
            d_pose,
            d_local,
            joint_count,
            gaussian_count,
        }
    }

    /// First half: the learned tables and coefficients get their gradients, `d_local` the residual skeleton's part.
    pub fn encode_properties(&self, pass: &mut wgpu::ComputePass<'_>) {
        self.skin_backward.dispatch(pass, groups_of_four(self.gaussian_count));
        self.residual_bone_sums.encode(pass);
        self.residual_skeleton_backward.dispatch(pass, 1);
        self.residual_joints_backward.dispatch(pass, groups_of_four(self.gaussian_count));
        self.blend_shapes_backward.dispatch(pass, groups(self.gaussian_count));
    }

    /// Second half: the pose gets its gradient.
    pub fn encode_pose(&self, pass: &mut wgpu::ComputePass<'_>) {
        self.bone_sums.encode(pass);
        self.main_skeleton_backward.dispatch(pass, 1);
        self.rotation_backward.dispatch(pass, self.joint_count.div_ceil(32));
    }
}

/// See `shaders/joint_sums.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct SumUniforms {
    /// N.
    pub count: u32,
    /// Rows of the left table, all of which take part.
    pub left_rows: u32,
    /// Rows of the right table that take part.
    pub right_rows: u32,
    /// The first of them.
    pub right_offset: u32,
}

/// `total[k][m] = sum_p left[k][p] right[offset + m][p]`, in a fixed order.
pub struct JointSums {
    /// The result, `[left_rows][right_rows]`.
    pub total: wgpu::Buffer,
    strands: Bound,
    finish: Bound,
    groups: u32,
    outputs: u32,
}

impl JointSums {
    /// Strands of the sum, as in the shader.
    const STRANDS: usize = 64;

    /// Sums over the `count` columns of `left` (`left_rows` rows) and of `right_rows` rows of `right` from `offset` on.
    pub fn new(
        gpu: &Gpu,
        left: &wgpu::Buffer,
        left_rows: usize,
        right: &wgpu::Buffer,
        offset: u32,
        right_rows: usize,
        count: usize,
    ) -> JointSums {
        let module = Module::new(gpu, "joint_sums", shader_sources::joint_sums());
        let sizes = SumUniforms {
            count: count as u32,
            left_rows: left_rows as u32,
            right_rows: right_rows as u32,
            right_offset: offset,
        };
        let uniforms = buffers::uniform(gpu, "joint sums", &sizes);
        let outputs = left_rows * right_rows;
        let strands = buffers::zeroed(gpu, "joint sum strands", outputs * Self::STRANDS);
        let total = buffers::zeroed(gpu, "joint sums", outputs);
        JointSums {
            strands: module
                .stage(gpu, "joint_sums_strands", &[])
                .bind(gpu, &[(0, &uniforms), (1, left), (2, right), (3, &strands)]),
            finish: module.stage(gpu, "joint_sums_total", &[]).bind(gpu, &[(0, &uniforms), (3, &strands), (4, &total)]),
            groups: (left_rows.div_ceil(4) * right_rows.div_ceil(4)) as u32,
            outputs: outputs as u32,
            total,
        }
    }

    /// Encodes the sum.
    pub fn encode(&self, pass: &mut wgpu::ComputePass<'_>) {
        self.strands.dispatch(pass, self.groups);
        self.finish.dispatch(pass, groups(self.outputs));
    }
}

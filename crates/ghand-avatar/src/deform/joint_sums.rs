//! Host part of `joint_sums.wgsl`: products of two tables, summed over the Gaussians. Maps offsets to joints, and
//! gradients of points to bones.

use bytemuck::{Pod, Zeroable};

use ghand_render::pipeline::{Bound, Module};
use ghand_render::stages::{JointSumsStrands, JointSumsStrandsBindings, JointSumsTotal, JointSumsTotalBindings};
use ghand_render::{Gpu, buffers};

/// See `shaders/joint_sums.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct SumUniforms {
    /// N.
    pub count: u32,
    /// Number of rows of the left table; all are used.
    pub left_rows: u32,
    /// Number of used rows of the right table.
    pub right_rows: u32,
    /// The first used row of the right table.
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
    /// Number of strands (partial sums), as in the shader.
    pub const STRANDS: usize = 64;

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
        JointSums::of_kind(gpu, false, [left, right], [left_rows, right_rows], offset, count)
    }

    /// As [`JointSums::new`], for [`Deformation::weights`](super::Deformation::weights).
    pub fn of_weights(
        gpu: &Gpu,
        weights: &wgpu::Buffer,
        joints: usize,
        right: &wgpu::Buffer,
        offset: u32,
        right_rows: usize,
        count: usize,
    ) -> JointSums {
        JointSums::of_kind(gpu, true, [weights, right], [joints, right_rows], offset, count)
    }

    fn of_kind(
        gpu: &Gpu,
        of_weights: bool,
        [left, right]: [&wgpu::Buffer; 2],
        [left_rows, right_rows]: [usize; 2],
        offset: u32,
        count: usize,
    ) -> JointSums {
        let constants = [("OF_WEIGHTS", f64::from(u8::from(of_weights)))];
        let module = Module::new(gpu, "joint_sums");
        let sizes = SumUniforms {
            count: count as u32,
            left_rows: left_rows as u32,
            right_rows: right_rows as u32,
            right_offset: offset,
        };
        let sums = &buffers::uniform(gpu, "joint sums", &sizes);
        let outputs = left_rows * right_rows;
        let partial = &buffers::zeroed(gpu, "joint sum strands", outputs * Self::STRANDS);
        let total = buffers::zeroed(gpu, "joint sums", outputs);
        JointSums {
            strands: module
                .stage::<JointSumsStrands>(gpu, &constants)
                .bind(gpu, &JointSumsStrandsBindings { sums, left, right, partial }),
            finish: module
                .stage::<JointSumsTotal>(gpu, &[])
                .bind(gpu, &JointSumsTotalBindings { sums, partial, total: &total }),
            groups: (left_rows.div_ceil(4) * right_rows.div_ceil(4)) as u32,
            outputs: outputs as u32,
            total,
        }
    }

    /// Encodes the sum.
    pub fn encode(&self, pass: &mut wgpu::ComputePass<'_>) {
        self.strands.dispatch(pass, self.groups);
        self.finish.dispatch_invocations(pass, self.outputs);
    }
}

//! Host part of `normals.wgsl`: normals of the skinned surface, for shading.

use super::{ForwardBuffers, invocations_of_four};
use ghand_render::pipeline::{Bound, Module};
use ghand_render::stages::{SkinNormals, SkinNormalsBindings};
use ghand_render::{Gpu, buffers};

/// Rest normals and bones to posed normals.
pub struct Normals {
    /// The result, `[3][N]`.
    pub normals: wgpu::Buffer,
    skin_normals: Bound,
    invocations: u32,
}

impl Normals {
    /// `rest_normals`: `[3][N]`, unit length.
    pub fn new(gpu: &Gpu, b: &ForwardBuffers, rest_normals: &[f32]) -> Normals {
        let rest = buffers::filled(gpu, "rest normals", rest_normals);
        let normals = buffers::zeroed(gpu, "normals", rest_normals.len());
        let module = Module::new(gpu, "normals");
        Normals {
            skin_normals: module.stage::<SkinNormals>(gpu, &b.properties.sizes.skinning()).bind(
                gpu,
                &SkinNormalsBindings {
                    pose: &b.pose,
                    residual_weights: &b.properties.residual_weights,
                    chain: &b.chain,
                    residual_chain: &b.residual_chain,
                    rest_normals: &rest,
                    normals: &normals,
                    weights: &b.weights,
                },
            ),
            invocations: invocations_of_four(b.properties.sizes.gaussians),
            normals,
        }
    }

    pub fn encode(&self, pass: &mut wgpu::ComputePass<'_>) {
        self.skin_normals.dispatch_invocations(pass, self.invocations);
    }
}

// The residual skeleton: joints regressed from the offsets, and their chain. CPU twin: `ghand_core::residual_skeleton`.

import package::shared::chain::{chain, pose_chain};
import package::shared::pose::{CHAIN_POSED, CHAIN_STRIDE, pose};

@group(0) @binding(5) var<storage, read> rest_joints: array<f32>;
// Regressor times offsets, [joints][3].
@group(0) @binding(6) var<storage, read> regressed: array<f32>;
@group(0) @binding(7) var<storage, read_write> residual_joints: array<f32>;

@compute @workgroup_size(32)
fn place_residual_joints(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x < 3u * pose.joint_count {
        residual_joints[id.x] = f32(pose.anchored) * rest_joints[id.x] + regressed[id.x];
    }
}

// The residual chain. Residual weights whose mean over the joints is taken off act on bones as they are just as weights
// as they are act on bones whose mean is taken off; the latter is done once instead of for every point. Where no mean is
// taken off, the root turns about the origin instead of about its joint.
@compute @workgroup_size(1)
fn residual_skeleton() {
    pose_chain();
    if pose.zero_sum == 0u {
        for (var r = 0u; r < 3u; r++) {
            let c = CHAIN_POSED + 4u * r + 3u;
            let root = chain[c];
            for (var k = 0u; k < pose.joint_count; k++) {
                chain[k * CHAIN_STRIDE + c] -= root;
            }
        }
        return;
    }
    for (var c = 0u; c < 12u; c++) {
        var mean = 0.0;
        for (var k = 0u; k < pose.joint_count; k++) {
            mean += chain[k * CHAIN_STRIDE + CHAIN_POSED + c];
        }
        mean /= f32(pose.joint_count);
        for (var k = 0u; k < pose.joint_count; k++) {
            chain[k * CHAIN_STRIDE + CHAIN_POSED + c] -= mean;
        }
    }
}

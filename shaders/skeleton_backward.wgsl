// Gradient of the kinematic chain, from the leaves to the root, and of the pose. CPU twin:
// `ghand_core::skeleton::pose_skeleton_vjp`.

import package::shared::chain_backward::{d_bones, d_joints, d_local, pose_chain_backward};
import package::shared::pose::pose;
import package::shared::rotation::rotation_from_axis_angle_backward;

@group(0) @binding(1) var<storage, read> poses: array<f32>;
@group(0) @binding(8) var<storage, read_write> d_pose: array<f32>;
// 1 for joints whose rotation may change, 0 for the others.
@group(0) @binding(9) var<storage, read> mobility: array<f32>;
// dL/d(residual joints); if anchored, these are relative to the rest joints.
@group(0) @binding(10) var<storage, read> d_residual_joints: array<f32>;

@compute @workgroup_size(1)
fn skeleton_backward() {
    // Skinning weights sum to one, so the translation's gradient is the sum over the joints.
    for (var c = 0u; c < 3u; c++) {
        var sum = 0.0;
        for (var k = 0u; k < pose.joint_count; k++) {
            sum += d_bones[12u * k + 4u * c + 3u];
        }
        d_pose[3u * pose.joint_count + c] = sum;
    }
    pose_chain_backward(1.0);
    for (var i = 0u; i < 3u * pose.joint_count; i++) {
        d_joints[i] += f32(pose.anchored) * d_residual_joints[i];
    }
}

@compute @workgroup_size(32)
fn rotation_backward(@builtin(global_invocation_id) id: vec3<u32>) {
    let k = id.x;
    if k >= pose.joint_count {
        return;
    }
    let at = pose.pose_offset + 3u * k;
    let l = 9u * k;
    let g = transpose(mat3x3(vec3(d_local[l], d_local[l + 1u], d_local[l + 2u]),
                             vec3(d_local[l + 3u], d_local[l + 4u], d_local[l + 5u]),
                             vec3(d_local[l + 6u], d_local[l + 7u], d_local[l + 8u])));
    let d = rotation_from_axis_angle_backward(vec3(poses[at], poses[at + 1u], poses[at + 2u]), g)
        * mobility[k];
    d_pose[3u * k] = d.x;
    d_pose[3u * k + 1u] = d.y;
    d_pose[3u * k + 2u] = d.z;
}

// Gradient of the kinematic chain, from the leaves to the root. CPU twin: `ghand_core::skeleton::pose_skeleton_vjp`.

@group(0) @binding(0) var<uniform> pose: PoseUniforms;
@group(0) @binding(1) var<storage, read> poses: array<f32>;
@group(0) @binding(2) var<storage, read> parents: array<i32>;
@group(0) @binding(3) var<storage, read> joints: array<f32>;
@group(0) @binding(4) var<storage, read> chain: array<f32>;
// dL/d(posed_from_rest), 12 per joint; converted to dL/d(world_from_joint) in place.
@group(0) @binding(5) var<storage, read_write> d_bones: array<f32>;
// dL/d(local rotation), 9 per joint, row-major.
@group(0) @binding(6) var<storage, read_write> d_local: array<f32>;
@group(0) @binding(7) var<storage, read_write> d_joints: array<f32>;
@group(0) @binding(8) var<storage, read_write> d_pose: array<f32>;
// 1 for joints whose rotation may change, 0 for the others.
@group(0) @binding(9) var<storage, read> mobility: array<f32>;
// dL/d(residual joints); if anchored, these are relative to the rest joints.
@group(0) @binding(10) var<storage, read> d_residual_joints: array<f32>;

fn joint(k: u32) -> vec3<f32> {
    return vec3(joints[3u * k], joints[3u * k + 1u], joints[3u * k + 2u]);
}

fn world_rotation(k: u32) -> mat3x3<f32> {
    let w = k * CHAIN_STRIDE + CHAIN_WORLD;
    return transpose(mat3x3(vec3(chain[w], chain[w + 1u], chain[w + 2u]),
                            vec3(chain[w + 4u], chain[w + 5u], chain[w + 6u]),
                            vec3(chain[w + 8u], chain[w + 9u], chain[w + 10u])));
}

fn local_rotation(k: u32) -> mat3x3<f32> {
    let l = k * CHAIN_STRIDE;
    return transpose(mat3x3(vec3(chain[l], chain[l + 1u], chain[l + 2u]),
                            vec3(chain[l + 3u], chain[l + 4u], chain[l + 5u]),
                            vec3(chain[l + 6u], chain[l + 7u], chain[l + 8u])));
}

fn d_bone_linear(k: u32) -> mat3x3<f32> {
    let b = 12u * k;
    return transpose(mat3x3(vec3(d_bones[b], d_bones[b + 1u], d_bones[b + 2u]),
                            vec3(d_bones[b + 4u], d_bones[b + 5u], d_bones[b + 6u]),
                            vec3(d_bones[b + 8u], d_bones[b + 9u], d_bones[b + 10u])));
}

fn d_bone_translation(k: u32) -> vec3<f32> {
    let b = 12u * k;
    return vec3(d_bones[b + 3u], d_bones[b + 7u], d_bones[b + 11u]);
}

fn set_d_bone(k: u32, linear: mat3x3<f32>, translation: vec3<f32>) {
    for (var r = 0u; r < 3u; r++) {
        for (var c = 0u; c < 3u; c++) {
            d_bones[12u * k + 4u * r + c] = linear[c][r];
        }
        d_bones[12u * k + 4u * r + 3u] = translation[r];
    }
}

fn outer(a: vec3<f32>, b: vec3<f32>) -> mat3x3<f32> {
    return mat3x3(a * b.x, a * b.y, a * b.z);
}

fn add_d_joint(k: u32, d: vec3<f32>) {
    for (var c = 0u; c < 3u; c++) {
        d_joints[3u * k + c] += d[c];
    }
}

// With `keep` 1 the gradient of the local rotations is added to the stored values, with 0 it replaces them.
fn walk(keep: f32) {
    for (var k = 0u; k < pose.joint_count; k++) {
        let d_translation = d_bone_translation(k);
        let d_world = d_bone_linear(k) - outer(d_translation, joint(k));
        let d_joint = -(transpose(world_rotation(k)) * d_translation);
        for (var c = 0u; c < 3u; c++) {
            d_joints[3u * k + c] = d_joint[c];
        }
        set_d_bone(k, d_world, d_translation);
    }
    for (var i = pose.joint_count; i > 0u; i--) {
        let k = i - 1u;
        let d_linear = d_bone_linear(k);
        let d_translation = d_bone_translation(k);
        var d_rotation = d_linear;
        if parents[k] < 0 {
            add_d_joint(k, d_translation);
        } else {
            let p = u32(parents[k]);
            let parent = transpose(world_rotation(p));
            d_rotation = parent * d_linear;
            let bone = joint(k) - joint(p);
            let d_parent = d_bone_linear(p) + d_linear * transpose(local_rotation(k)) + outer(d_translation, bone);
            set_d_bone(p, d_parent, d_bone_translation(p) + d_translation);
            let d_bone = parent * d_translation;
            add_d_joint(k, d_bone);
            add_d_joint(p, -d_bone);
        }
        for (var r = 0u; r < 3u; r++) {
            for (var c = 0u; c < 3u; c++) {
                let at = 9u * k + 3u * r + c;
                d_local[at] = keep * d_local[at] + d_rotation[c][r];
            }
        }
    }
}

// The residual chain comes first and replaces d_local.
@compute @workgroup_size(1)
fn residual_skeleton_backward() {
    if pose.zero_sum != 0u {
        // The mean over the joints was subtracted from the residual bones.
        for (var c = 0u; c < 12u; c++) {
            var mean = 0.0;
            for (var k = 0u; k < pose.joint_count; k++) {
                mean += d_bones[12u * k + c];
            }
            mean /= f32(pose.joint_count);
            for (var k = 0u; k < pose.joint_count; k++) {
                d_bones[12u * k + c] -= mean;
            }
        }
    } else {
        // The root's translation was subtracted from the residual bones.
        for (var r = 0u; r < 3u; r++) {
            var sum = 0.0;
            for (var k = 0u; k < pose.joint_count; k++) {
                sum += d_bones[12u * k + 4u * r + 3u];
            }
            d_bones[4u * r + 3u] -= sum;
        }
    }
    walk(0.0);
}

@compute @workgroup_size(1)
fn main_skeleton_backward() {
    // Skinning weights sum to one, so the translation's gradient is the sum over the joints.
    for (var c = 0u; c < 3u; c++) {
        var sum = 0.0;
        for (var k = 0u; k < pose.joint_count; k++) {
            sum += d_bones[12u * k + 4u * c + 3u];
        }
        d_pose[3u * pose.joint_count + c] = sum;
    }
    walk(1.0);
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

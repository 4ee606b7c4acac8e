// Gradient of a kinematic chain, as `shared/chain.wgsl` poses it.

import package::shared::pose::{CHAIN_STRIDE, CHAIN_WORLD, pose};

@group(0) @binding(2) var<storage, read> parents: array<i32>;
@group(0) @binding(3) var<storage, read> joints: array<f32>;
@group(0) @binding(4) var<storage, read> chain: array<f32>;
// dL/d(posed_from_rest), 12 a joint; turned into dL/d(world_from_joint) in place.
@group(0) @binding(5) var<storage, read_write> d_bones: array<f32>;
// dL/d(local rotation), 9 a joint, row-major.
@group(0) @binding(6) var<storage, read_write> d_local: array<f32>;
@group(0) @binding(7) var<storage, read_write> d_joints: array<f32>;

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

// Carries the gradient of the bones from the leaves to the root. With `keep` 1 the gradient of the local rotations is added to what is there, with 0 it replaces it.
fn pose_chain_backward(keep: f32) {
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

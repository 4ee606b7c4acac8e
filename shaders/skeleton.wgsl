// The kinematic chain: joint rotations to posed_from_rest maps. A hand has a few dozen joints, so one invocation
// processes them in order. CPU twin: `ghand_core::skeleton`.

@group(0) @binding(0) var<uniform> pose: PoseUniforms;
@group(0) @binding(1) var<storage, read> poses: array<f32>;
// -1 for the root.
@group(0) @binding(2) var<storage, read> parents: array<i32>;
@group(0) @binding(3) var<storage, read> joints: array<f32>;
@group(0) @binding(4) var<storage, read_write> chain: array<f32>;

fn joint(k: u32) -> vec3<f32> {
    return vec3(joints[3u * k], joints[3u * k + 1u], joints[3u * k + 2u]);
}

fn walk() {
    for (var k = 0u; k < pose.joint_count; k++) {
        let at = pose.pose_offset + 3u * k;
        let local = rotation_from_axis_angle(vec3(poses[at], poses[at + 1u], poses[at + 2u]));
        var world = local;
        var origin = joint(k);
        if parents[k] >= 0 {
            let p = u32(parents[k]);
            let w = p * CHAIN_STRIDE + CHAIN_WORLD;
            let parent = transpose(mat3x3(vec3(chain[w], chain[w + 1u], chain[w + 2u]),
                                          vec3(chain[w + 4u], chain[w + 5u], chain[w + 6u]),
                                          vec3(chain[w + 8u], chain[w + 9u], chain[w + 10u])));
            world = parent * local;
            origin = parent * (joint(k) - joint(p)) + vec3(chain[w + 3u], chain[w + 7u], chain[w + 11u]);
        }
        let moved = origin - world * joint(k);
        let base = k * CHAIN_STRIDE;
        for (var r = 0u; r < 3u; r++) {
            for (var c = 0u; c < 3u; c++) {
                chain[base + 3u * r + c] = local[c][r];
                chain[base + CHAIN_WORLD + 4u * r + c] = world[c][r];
                chain[base + CHAIN_POSED + 4u * r + c] = world[c][r];
            }
            chain[base + CHAIN_WORLD + 4u * r + 3u] = origin[r];
            chain[base + CHAIN_POSED + 4u * r + 3u] = moved[r];
        }
    }
}

@compute @workgroup_size(1)
fn skeleton() {
    walk();
}

// The residual chain. Subtracting the mean over the joints from the residual weights has the same effect as subtracting
// it from the bones, which is done once instead of for every point. If no mean is subtracted, the root turns about the
// origin instead of about its joint.
@compute @workgroup_size(1)
fn residual_skeleton() {
    walk();
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

// The `direct` property model: blend coefficients and colours as local, linear functions of the joints' rotations, and
// the appearance tables. CPU twin: `ghand_core::pose_response`.
//
// Channels are the basis_count blend coefficients, then the colour components. `response` holds one bias a channel, then
// gains [channels][joints][9].

struct ResponseUniforms {
    color_components: u32,
    // Largest standard deviation of a Gaussian, metres.
    max_scale: f32,
    padding: vec2<u32>,
}

// Rows of the appearance table: scale logit, base colour logits (3), colour components (3 each).
const ROW_SCALE_LOGIT: u32 = 0u;
const ROW_BASE_COLOR: u32 = 1u;
const ROW_COMPONENTS: u32 = 4u;

@group(0) @binding(0) var<uniform> pose: PoseUniforms;
@group(0) @binding(1) var<uniform> response_sizes: ResponseUniforms;
@group(0) @binding(2) var<storage, read> response: array<f32>;
@group(0) @binding(3) var<storage, read> chain: array<f32>;
// What each joint adds to each channel, [channels][joints].
@group(0) @binding(4) var<storage, read_write> joint_terms: array<f32>;
@group(0) @binding(5) var<storage, read> weights: array<f32>;
@group(0) @binding(6) var<storage, read> appearance: array<f32>;
// Channel values, [channels][N].
@group(0) @binding(7) var<storage, read_write> channels: array<f32>;
@group(0) @binding(8) var<storage, read_write> gaussians: array<f32>;

@group(0) @binding(9) var<storage, read> d_gaussians: array<f32>;
@group(0) @binding(10) var<storage, read_write> d_appearance: array<f32>;
@group(0) @binding(11) var<storage, read_write> d_channels: array<f32>;
// dL/d(joint terms), [joints][channels].
@group(0) @binding(12) var<storage, read> d_joint_terms: array<f32>;
@group(0) @binding(13) var<storage, read_write> d_response: array<f32>;
@group(0) @binding(14) var<storage, read_write> d_local: array<f32>;

fn channel_count() -> u32 {
    return pose.basis_count + response_sizes.color_components;
}

fn gain_at(channel: u32, k: u32) -> u32 {
    return channel_count() + (channel * pose.joint_count + k) * 9u;
}

// Entry c of vec(R_k - I).
fn feature(k: u32, c: u32) -> f32 {
    return chain[k * CHAIN_STRIDE + c] - select(0.0, 1.0, c % 4u == 0u);
}

fn sigmoid(x: f32) -> f32 {
    return 1.0 / (1.0 + exp(-x));
}

@compute @workgroup_size(64)
fn response_terms(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= channel_count() * pose.joint_count {
        return;
    }
    let channel = id.x / pose.joint_count;
    let k = id.x % pose.joint_count;
    var sum = 0.0;
    for (var c = 0u; c < 9u; c++) {
        sum += response[gain_at(channel, k) + c] * feature(k, c);
    }
    joint_terms[id.x] = sum;
}

@compute @workgroup_size(64)
fn respond(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
           @builtin(local_invocation_index) local: u32) {
    let p = flat_index(group, groups, local, 64u);
    let n = pose.gaussian_count;
    if p >= n {
        return;
    }
    var color = vec3(appearance[ROW_BASE_COLOR * n + p], appearance[(ROW_BASE_COLOR + 1u) * n + p],
                     appearance[(ROW_BASE_COLOR + 2u) * n + p]);
    for (var i = 0u; i < channel_count(); i++) {
        var value = response[i];
        for (var k = 0u; k < pose.joint_count; k++) {
            value += weights[k * n + p] * joint_terms[i * pose.joint_count + k];
        }
        channels[i * n + p] = value;
        if i >= pose.basis_count {
            let row = ROW_COMPONENTS + 3u * (i - pose.basis_count);
            color += value * vec3(appearance[row * n + p], appearance[(row + 1u) * n + p], appearance[(row + 2u) * n + p]);
        }
    }
    gaussians[ROW_SCALE * n + p] = response_sizes.max_scale * sigmoid(appearance[p]);
    gaussians[ROW_COLOR * n + p] = sigmoid(color.x);
    gaussians[(ROW_COLOR + 1u) * n + p] = sigmoid(color.y);
    gaussians[(ROW_COLOR + 2u) * n + p] = sigmoid(color.z);
}

// Gradient of the appearance tables and of the colour channels.
@compute @workgroup_size(64)
fn respond_backward(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                    @builtin(local_invocation_index) local: u32) {
    let p = flat_index(group, groups, local, 64u);
    let n = pose.gaussian_count;
    if p >= n {
        return;
    }
    let s = sigmoid(appearance[p]);
    let scale = response_sizes.max_scale * s;
    d_appearance[p] = (d_gaussians[ROW_SCALE * n + p] + pose.scale_weight * scale) * scale * (1.0 - s);
    var d_color = vec3(0.0);
    for (var c = 0u; c < 3u; c++) {
        let color = gaussians[(ROW_COLOR + c) * n + p];
        d_color[c] = d_gaussians[(ROW_COLOR + c) * n + p] * color * (1.0 - color);
        d_appearance[(ROW_BASE_COLOR + c) * n + p] = d_color[c];
    }
    for (var j = 0u; j < response_sizes.color_components; j++) {
        let channel = pose.basis_count + j;
        let value = channels[channel * n + p];
        var d_value = 0.0;
        for (var c = 0u; c < 3u; c++) {
            let at = (ROW_COMPONENTS + 3u * j + c) * n + p;
            d_appearance[at] = value * d_color[c];
            d_value += appearance[at] * d_color[c];
        }
        d_channels[channel * n + p] = d_value;
    }
}

// Gradient of the response itself, and what the rotations get through it (added to d_local). Invocation k owns joint k;
// skinning weights sum to one, so a channel's bias gets the sum over the joints.
@compute @workgroup_size(64)
fn response_backward(@builtin(global_invocation_id) id: vec3<u32>) {
    let count = channel_count();
    if id.x < count {
        var sum = 0.0;
        for (var k = 0u; k < pose.joint_count; k++) {
            sum += d_joint_terms[k * count + id.x];
        }
        d_response[id.x] = sum;
    }
    let k = id.x;
    if k >= pose.joint_count {
        return;
    }
    for (var c = 0u; c < 9u; c++) {
        var d_feature = 0.0;
        for (var i = 0u; i < count; i++) {
            let at = gain_at(i, k) + c;
            let d_term = d_joint_terms[k * count + i];
            d_response[at] = d_term * feature(k, c);
            d_feature += d_term * response[at];
        }
        d_local[9u * k + c] += d_feature;
    }
}

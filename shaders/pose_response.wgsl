// The `direct` property model: blend coefficients and colours as local, linear functions of the joints' rotations within
// limits, and the appearance tables. CPU twin: `ghand_core::pose_response`.
//
// Channels are the rows of the blend coefficients, then the colour components. `response` holds one bias per channel, then
// gains [channels][joints][9].

import package::shared::dispatch::flat_index;
import package::shared::points4::{points4, in_range4, invocations};
import package::shared::pose::{CHAIN_STRIDE, pose};
import package::shared::sigmoid::sigmoid_slope;
import package::shared::weights::{joint_at, joints_of, weight_row};

struct ResponseUniforms {
    // Rows of the blend coefficients.
    coefficient_rows: u32,
    color_components: u32,
    // Largest standard deviation of a Gaussian, metres.
    max_scale: f32,
    padding: u32,
}

// Rows of the appearance table: scale logit, base colour logits (3), colour components (3 each).
const ROW_SCALE_LOGIT: u32 = 0u;
const ROW_BASE_COLOR: u32 = 1u;
const ROW_COMPONENTS: u32 = 4u;

@group(0) @binding(1) var<uniform> response_sizes: ResponseUniforms;
@group(0) @binding(2) var<storage, read> response: array<f32>;
@group(0) @binding(3) var<storage, read> chain: array<f32>;
// What each joint adds to each channel, within its limits, [channels][joints].
@group(0) @binding(4) var<storage, read_write> joint_terms: array<f32>;
@group(0) @binding(6) var<storage, read> appearance: array<f32>;
// Channel values: of the blend coefficients, a property, and of the colour components, [channels][N] each.
@group(0) @binding(7) var<storage, read_write> coefficients: array<f32>;
@group(0) @binding(18) var<storage, read_write> color_channels: array<f32>;
// Properties: standard deviations, [N], metres, and colours, [3][N].
@group(0) @binding(8) var<storage, read_write> scale: array<f32>;
@group(0) @binding(16) var<storage, read_write> color: array<f32>;

@group(0) @binding(9) var<storage, read> d_scale: array<f32>;
@group(0) @binding(17) var<storage, read> d_color: array<f32>;
@group(0) @binding(10) var<storage, read_write> d_appearance: array<f32>;
@group(0) @binding(11) var<storage, read_write> d_color_channels: array<f32>;
// dL/d(joint terms), [joints][channels], of the coefficients and of the colour components.
@group(0) @binding(12) var<storage, read> d_coefficient_terms: array<f32>;
@group(0) @binding(19) var<storage, read> d_color_terms: array<f32>;
@group(0) @binding(13) var<storage, read_write> d_response: array<f32>;
@group(0) @binding(14) var<storage, read_write> d_local: array<f32>;
// Smallest and largest joint term, [channels][joints].
@group(0) @binding(15) var<storage, read> response_limits: array<vec2<f32>>;

// The root turns the whole hand and is ignored: neither shape nor colour depends on its rotation.
const ROOT: u32 = 0u;

fn channel_count() -> u32 {
    return response_sizes.coefficient_rows + response_sizes.color_components;
}

fn gain_at(channel: u32, k: u32) -> u32 {
    return channel_count() + (channel * pose.joint_count + k) * 9u;
}

// Entry c of vec(R_k - I).
fn feature(k: u32, c: u32) -> f32 {
    return chain[k * CHAIN_STRIDE + c] - select(0.0, 1.0, c % 4u == 0u);
}

@compute @workgroup_size(64)
fn response_terms(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= channel_count() * pose.joint_count {
        return;
    }
    let channel = id.x / pose.joint_count;
    let k = id.x % pose.joint_count;
    var sum = 0.0;
    if k != ROOT {
        for (var c = 0u; c < 9u; c++) {
            sum += response[gain_at(channel, k) + c] * feature(k, c);
        }
    }
    joint_terms[id.x] = clamp(sum, response_limits[id.x].x, response_limits[id.x].y);
}

// Whether a joint term depends on the joint's rotation: at a limit it does not.
fn follows(channel: u32, k: u32) -> bool {
    let at = channel * pose.joint_count + k;
    return k != ROOT && joint_terms[at] > response_limits[at].x && joint_terms[at] < response_limits[at].y;
}

fn appearance_row(row: u32, p: vec4<u32>) -> vec4<f32> {
    let at = vec4(row * pose.gaussian_count) + p;
    return vec4(appearance[at.x], appearance[at.y], appearance[at.z], appearance[at.w]);
}

fn store_scale(p: vec4<u32>, stored: vec4<bool>, value: vec4<f32>) {
    if stored.x { scale[p.x] = value.x; }
    if stored.y { scale[p.y] = value.y; }
    if stored.z { scale[p.z] = value.z; }
    if stored.w { scale[p.w] = value.w; }
}

fn store_color(row: u32, p: vec4<u32>, stored: vec4<bool>, value: vec4<f32>) {
    let at = vec4(row * pose.gaussian_count) + p;
    if stored.x { color[at.x] = value.x; }
    if stored.y { color[at.y] = value.y; }
    if stored.z { color[at.z] = value.z; }
    if stored.w { color[at.w] = value.w; }
}

fn sigmoid4(x: vec4<f32>) -> vec4<f32> {
    return 1.0 / (1.0 + exp(-x));
}

// What joint k adds to the channels first to first + 3; channels beyond the last repeat the last and are not used.
fn term_block(first: u32, k: u32) -> vec4<f32> {
    let channel = min(vec4(first) + vec4(0u, 1u, 2u, 3u), vec4(channel_count() - 1u));
    let at = channel * pose.joint_count + k;
    return vec4(joint_terms[at.x], joint_terms[at.y], joint_terms[at.z], joint_terms[at.w]);
}

// Stores a channel of four points and adds a colour channel's part to the colour (one column per colour channel).
fn take_channel(channel: u32, p: vec4<u32>, stored: vec4<bool>, moved: vec4<f32>, logits: ptr<function, mat3x4<f32>>) {
    if channel >= channel_count() {
        return;
    }
    let value = response[channel] + moved;
    if channel < response_sizes.coefficient_rows {
        let at = vec4(channel * pose.gaussian_count) + p;
        if stored.x { coefficients[at.x] = value.x; }
        if stored.y { coefficients[at.y] = value.y; }
        if stored.z { coefficients[at.z] = value.z; }
        if stored.w { coefficients[at.w] = value.w; }
    } else {
        let component = channel - response_sizes.coefficient_rows;
        let at = vec4(component * pose.gaussian_count) + p;
        if stored.x { color_channels[at.x] = value.x; }
        if stored.y { color_channels[at.y] = value.y; }
        if stored.z { color_channels[at.z] = value.z; }
        if stored.w { color_channels[at.w] = value.w; }
        let row = ROW_COMPONENTS + 3u * component;
        *logits += mat3x4(value * appearance_row(row, p), value * appearance_row(row + 1u, p),
                         value * appearance_row(row + 2u, p));
    }
}

// Four points and four channels at a time, so that weights and terms are loaded once for sixteen products.
@compute @workgroup_size(64)
fn respond(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
           @builtin(local_invocation_index) local: u32) {
    let i = flat_index(group, groups, local, 64u);
    let n = pose.gaussian_count;
    if i >= invocations(n) {
        return;
    }
    let p = points4(i, n);
    let stored = in_range4(i, n);
    let joints = joints_of(p);
    var logits = mat3x4(appearance_row(ROW_BASE_COLOR, p), appearance_row(ROW_BASE_COLOR + 1u, p),
                       appearance_row(ROW_BASE_COLOR + 2u, p));
    for (var first = 0u; first < channel_count(); first += 4u) {
        var moved = mat4x4<f32>();
        for (var j = joints.x; j < joints.y; j++) {
            let k = joint_at(j);
            let w = weight_row(k, p);
            let t = term_block(first, k);
            moved += mat4x4(w * t.x, w * t.y, w * t.z, w * t.w);
        }
        take_channel(first, p, stored, moved[0], &logits);
        take_channel(first + 1u, p, stored, moved[1], &logits);
        take_channel(first + 2u, p, stored, moved[2], &logits);
        take_channel(first + 3u, p, stored, moved[3], &logits);
    }
    store_scale(p, stored, response_sizes.max_scale * sigmoid4(appearance_row(ROW_SCALE_LOGIT, p)));
    store_color(0u, p, stored, sigmoid4(logits[0]));
    store_color(1u, p, stored, sigmoid4(logits[1]));
    store_color(2u, p, stored, sigmoid4(logits[2]));
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
    d_appearance[p] = d_scale[p] * response_sizes.max_scale * sigmoid_slope(appearance[p]);
    var logits = vec3(0.0);
    for (var c = 0u; c < 3u; c++) {
        logits[c] = appearance[(ROW_BASE_COLOR + c) * n + p];
    }
    for (var j = 0u; j < response_sizes.color_components; j++) {
        let value = color_channels[j * n + p];
        for (var c = 0u; c < 3u; c++) {
            logits[c] += value * appearance[(ROW_COMPONENTS + 3u * j + c) * n + p];
        }
    }
    var d_logits = vec3(0.0);
    for (var c = 0u; c < 3u; c++) {
        d_logits[c] = d_color[c * n + p] * sigmoid_slope(logits[c]);
        d_appearance[(ROW_BASE_COLOR + c) * n + p] = d_logits[c];
    }
    for (var j = 0u; j < response_sizes.color_components; j++) {
        let value = color_channels[j * n + p];
        var d_value = 0.0;
        for (var c = 0u; c < 3u; c++) {
            let at = (ROW_COMPONENTS + 3u * j + c) * n + p;
            d_appearance[at] = value * d_logits[c];
            d_value += appearance[at] * d_logits[c];
        }
        d_color_channels[j * n + p] = d_value;
    }
}

fn d_joint_term(k: u32, channel: u32) -> f32 {
    let rows = response_sizes.coefficient_rows;
    if channel < rows {
        return d_coefficient_terms[k * rows + channel];
    }
    return d_color_terms[k * response_sizes.color_components + channel - rows];
}

// Gradient of the response, and through it that of the rotations (added to d_local). Invocation k owns joint k;
// skinning weights sum to one, so the gradient of a channel's bias is the sum over the joints.
@compute @workgroup_size(64)
fn response_backward(@builtin(global_invocation_id) id: vec3<u32>) {
    let count = channel_count();
    if id.x < count {
        var sum = 0.0;
        for (var k = 0u; k < pose.joint_count; k++) {
            sum += d_joint_term(k, id.x);
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
            let d_term = select(0.0, d_joint_term(k, i), follows(i, k));
            d_response[at] = d_term * feature(k, c);
            d_feature += d_term * response[at];
        }
        d_local[9u * k + c] += d_feature;
    }
}

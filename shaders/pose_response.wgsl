// The `direct` property model: blend coefficients and colours as local, linear functions of the joints' rotations within
// limits, and the appearance tables. CPU twin: `ghand_core::pose_response`.
//
// Channels are the basis_count blend coefficients, then the colour components. `response` holds one bias per channel,
// then gains [channels][joints][9].

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
// What each joint adds to each channel, within its limits, [channels][joints].
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
// Smallest and largest joint term, [channels][joints].
@group(0) @binding(15) var<storage, read> response_limits: array<vec2<f32>>;

// The root turns the whole hand and is ignored: neither shape nor colour depends on its rotation.
const ROOT: u32 = 0u;

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

fn weight_row(k: u32, p: vec4<u32>) -> vec4<f32> {
    let at = vec4(k * pose.gaussian_count) + p;
    return vec4(weights[at.x], weights[at.y], weights[at.z], weights[at.w]);
}

fn appearance_row(row: u32, p: vec4<u32>) -> vec4<f32> {
    let at = vec4(row * pose.gaussian_count) + p;
    return vec4(appearance[at.x], appearance[at.y], appearance[at.z], appearance[at.w]);
}

fn store_gaussian(row: u32, p: vec4<u32>, stored: vec4<bool>, value: vec4<f32>) {
    let at = vec4(row * pose.gaussian_count) + p;
    if stored.x { gaussians[at.x] = value.x; }
    if stored.y { gaussians[at.y] = value.y; }
    if stored.z { gaussians[at.z] = value.z; }
    if stored.w { gaussians[at.w] = value.w; }
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
fn take_channel(channel: u32, p: vec4<u32>, stored: vec4<bool>, moved: vec4<f32>, color: ptr<function, mat3x4<f32>>) {
    if channel >= channel_count() {
        return;
    }
    let value = response[channel] + moved;
    let at = vec4(channel * pose.gaussian_count) + p;
    if stored.x { channels[at.x] = value.x; }
    if stored.y { channels[at.y] = value.y; }
    if stored.z { channels[at.z] = value.z; }
    if stored.w { channels[at.w] = value.w; }
    if channel >= pose.basis_count {
        let row = ROW_COMPONENTS + 3u * (channel - pose.basis_count);
        *color += mat3x4(value * appearance_row(row, p), value * appearance_row(row + 1u, p),
                         value * appearance_row(row + 2u, p));
    }
}

// Four points and four channels at a time, so that weights and terms are loaded once for sixteen products.
@compute @workgroup_size(64)
fn respond(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
           @builtin(local_invocation_index) local: u32) {
    let i = flat_index(group, groups, local, 64u);
    let n = pose.gaussian_count;
    if i >= quarter(n) {
        return;
    }
    let p = four_points(i, n);
    let stored = four_stored(i, n);
    var color = mat3x4(appearance_row(ROW_BASE_COLOR, p), appearance_row(ROW_BASE_COLOR + 1u, p),
                       appearance_row(ROW_BASE_COLOR + 2u, p));
    for (var first = 0u; first < channel_count(); first += 4u) {
        var moved = mat4x4<f32>();
        for (var k = 0u; k < pose.joint_count; k++) {
            let w = weight_row(k, p);
            let t = term_block(first, k);
            moved += mat4x4(w * t.x, w * t.y, w * t.z, w * t.w);
        }
        take_channel(first, p, stored, moved[0], &color);
        take_channel(first + 1u, p, stored, moved[1], &color);
        take_channel(first + 2u, p, stored, moved[2], &color);
        take_channel(first + 3u, p, stored, moved[3], &color);
    }
    store_gaussian(ROW_SCALE, p, stored, response_sizes.max_scale * sigmoid4(appearance_row(ROW_SCALE_LOGIT, p)));
    store_gaussian(ROW_COLOR, p, stored, sigmoid4(color[0]));
    store_gaussian(ROW_COLOR + 1u, p, stored, sigmoid4(color[1]));
    store_gaussian(ROW_COLOR + 2u, p, stored, sigmoid4(color[2]));
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

// Gradient of the response, and through it that of the rotations (added to d_local). Invocation k owns joint k;
// skinning weights sum to one, so the gradient of a channel's bias is the sum over the joints.
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
            let d_term = select(0.0, d_joint_terms[k * count + i], follows(i, k));
            d_response[at] = d_term * feature(k, c);
            d_feature += d_term * response[at];
        }
        d_local[9u * k + c] += d_feature;
    }
}

// L1 + SSIM between a rendered image and an 8-bit target, value and gradient.
//
// SSIM uses an 11x11 Gaussian window (sigma 1.5) as two one-dimensional passes; outside the image both pictures count as
// zero. Every invocation makes a run of RUN outputs along the pass's direction, so that a tap is loaded once for four.

struct LossUniforms {
    size: vec2<u32>,
    // Weights of mean |x - y| and of 1 - mean SSIM.
    l1_weight: f32,
    ssim_weight: f32,
    // One over the number of values (pixels times three) that the means are taken over.
    inverse_count: f32,
    padding: u32,
}

const RUN: u32 = 4u;
const RADIUS: u32 = 5u;
const TAPS: u32 = 14u;
const C1: f32 = 0.0001;
const C2: f32 = 0.0009;
// Weight of tap j for each of the run's four outputs: the normalised window, shifted by one each.
const WINDOW = array<vec4<f32>, 14>(
    vec4(0.00102838008, 0.0, 0.0, 0.0),
    vec4(0.00759875814, 0.00102838008, 0.0, 0.0),
    vec4(0.0360007721, 0.00759875814, 0.00102838008, 0.0),
    vec4(0.10936069, 0.0360007721, 0.00759875814, 0.00102838008),
    vec4(0.213005538, 0.10936069, 0.0360007721, 0.00759875814),
    vec4(0.266011725, 0.213005538, 0.10936069, 0.0360007721),
    vec4(0.213005538, 0.266011725, 0.213005538, 0.10936069),
    vec4(0.10936069, 0.213005538, 0.266011725, 0.213005538),
    vec4(0.0360007721, 0.10936069, 0.213005538, 0.266011725),
    vec4(0.00759875814, 0.0360007721, 0.10936069, 0.213005538),
    vec4(0.00102838008, 0.00759875814, 0.0360007721, 0.10936069),
    vec4(0.0, 0.00102838008, 0.00759875814, 0.0360007721),
    vec4(0.0, 0.0, 0.00102838008, 0.00759875814),
    vec4(0.0, 0.0, 0.0, 0.00102838008),
);

@group(0) @binding(0) var<uniform> loss: LossUniforms;
// Rendered colour (rgb) and coverage.
@group(0) @binding(1) var<storage, read> image: array<vec4<f32>>;
// Target: red in the lowest byte, then green, blue, mask.
@group(0) @binding(2) var<storage, read> target_image: array<u32>;
// Five blurred values a pixel: x, y, x^2, y^2, x y; later three: the gradients to mean, square and product.
@group(0) @binding(3) var<storage, read_write> rows: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read_write> partials: array<vec4<f32>>;
// |x - y| and SSIM of each pixel, summed over the channels.
@group(0) @binding(5) var<storage, read_write> values: array<vec2<f32>>;
@group(0) @binding(6) var<storage, read_write> d_image: array<vec4<f32>>;
@group(0) @binding(7) var<storage, read_write> strand_sums: array<vec2<f32>>;

fn target_color(pixel: u32) -> vec3<f32> {
    return unpack4x8unorm(target_image[pixel]).xyz;
}

fn spread(value: vec3<f32>, w: vec4<f32>) -> mat4x3<f32> {
    return mat4x3(value * w.x, value * w.y, value * w.z, value * w.w);
}

// The first pixel of the run of an invocation, runs lying along rows.
fn run_in_row(index: u32) -> vec2<u32> {
    let runs = (loss.size.x + RUN - 1u) / RUN;
    return vec2((index % runs) * RUN, index / runs);
}

// The same, runs lying along columns.
fn run_in_column(index: u32) -> vec2<u32> {
    return vec2(index % loss.size.x, index / loss.size.x * RUN);
}

@compute @workgroup_size(64)
fn loss_rows(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
             @builtin(local_invocation_index) local: u32) {
    let at = run_in_row(flat_index(group, groups, local, 64u));
    if at.y >= loss.size.y {
        return;
    }
    var sum_x = mat4x3<f32>();
    var sum_y = mat4x3<f32>();
    var sum_xx = mat4x3<f32>();
    var sum_yy = mat4x3<f32>();
    var sum_xy = mat4x3<f32>();
    for (var j = 0u; j < TAPS; j++) {
        let column = at.x + j - RADIUS;
        // Left of the image the subtraction wraps to a huge number.
        if column < loss.size.x {
            let pixel = at.y * loss.size.x + column;
            let x = image[pixel].xyz;
            let y = target_color(pixel);
            let w = WINDOW[j];
            sum_x += spread(x, w);
            sum_y += spread(y, w);
            sum_xx += spread(x * x, w);
            sum_yy += spread(y * y, w);
            sum_xy += spread(x * y, w);
        }
    }
    for (var o = 0u; o < RUN && at.x + o < loss.size.x; o++) {
        let pixel = 5u * (at.y * loss.size.x + at.x + o);
        rows[pixel] = vec4(sum_x[o], 0.0);
        rows[pixel + 1u] = vec4(sum_y[o], 0.0);
        rows[pixel + 2u] = vec4(sum_xx[o], 0.0);
        rows[pixel + 3u] = vec4(sum_yy[o], 0.0);
        rows[pixel + 4u] = vec4(sum_xy[o], 0.0);
    }
}

@compute @workgroup_size(64)
fn loss_columns(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                @builtin(local_invocation_index) local: u32) {
    let at = run_in_column(flat_index(group, groups, local, 64u));
    if at.y >= loss.size.y {
        return;
    }
    var sum_x = mat4x3<f32>();
    var sum_y = mat4x3<f32>();
    var sum_xx = mat4x3<f32>();
    var sum_yy = mat4x3<f32>();
    var sum_xy = mat4x3<f32>();
    for (var j = 0u; j < TAPS; j++) {
        let row = at.y + j - RADIUS;
        if row < loss.size.y {
            let pixel = 5u * (row * loss.size.x + at.x);
            let w = WINDOW[j];
            sum_x += spread(rows[pixel].xyz, w);
            sum_y += spread(rows[pixel + 1u].xyz, w);
            sum_xx += spread(rows[pixel + 2u].xyz, w);
            sum_yy += spread(rows[pixel + 3u].xyz, w);
            sum_xy += spread(rows[pixel + 4u].xyz, w);
        }
    }
    let d_ssim = -loss.ssim_weight * loss.inverse_count;
    for (var o = 0u; o < RUN && at.y + o < loss.size.y; o++) {
        let pixel = (at.y + o) * loss.size.x + at.x;
        let mean_x = sum_x[o];
        let mean_y = sum_y[o];
        let n1 = 2.0 * mean_x * mean_y + C1;
        let n2 = 2.0 * (sum_xy[o] - mean_x * mean_y) + C2;
        let d1 = mean_x * mean_x + mean_y * mean_y + C1;
        let d2 = (sum_xx[o] - mean_x * mean_x) + (sum_yy[o] - mean_y * mean_y) + C2;
        let inverse = 1.0 / (d1 * d2);
        let ssim = n1 * n2 * inverse;
        partials[3u * pixel] =
            vec4(d_ssim * (2.0 * mean_y * (n2 - n1) * inverse - 2.0 * mean_x * ssim * (1.0 / d1 - 1.0 / d2)), 0.0);
        partials[3u * pixel + 1u] = vec4(d_ssim * -ssim / d2, 0.0);
        partials[3u * pixel + 2u] = vec4(d_ssim * 2.0 * n1 * inverse, 0.0);
        let error = abs(image[pixel].xyz - target_color(pixel));
        values[pixel] = vec2(error.x + error.y + error.z, ssim.x + ssim.y + ssim.z);
    }
}

@compute @workgroup_size(64)
fn gradient_rows(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                 @builtin(local_invocation_index) local: u32) {
    let at = run_in_row(flat_index(group, groups, local, 64u));
    if at.y >= loss.size.y {
        return;
    }
    var d_mean = mat4x3<f32>();
    var d_square = mat4x3<f32>();
    var d_product = mat4x3<f32>();
    for (var j = 0u; j < TAPS; j++) {
        let column = at.x + j - RADIUS;
        if column < loss.size.x {
            let pixel = 3u * (at.y * loss.size.x + column);
            let w = WINDOW[j];
            d_mean += spread(partials[pixel].xyz, w);
            d_square += spread(partials[pixel + 1u].xyz, w);
            d_product += spread(partials[pixel + 2u].xyz, w);
        }
    }
    for (var o = 0u; o < RUN && at.x + o < loss.size.x; o++) {
        let pixel = 3u * (at.y * loss.size.x + at.x + o);
        rows[pixel] = vec4(d_mean[o], 0.0);
        rows[pixel + 1u] = vec4(d_square[o], 0.0);
        rows[pixel + 2u] = vec4(d_product[o], 0.0);
    }
}

@compute @workgroup_size(64)
fn gradient_columns(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                    @builtin(local_invocation_index) local: u32) {
    let at = run_in_column(flat_index(group, groups, local, 64u));
    if at.y >= loss.size.y {
        return;
    }
    var d_mean = mat4x3<f32>();
    var d_square = mat4x3<f32>();
    var d_product = mat4x3<f32>();
    for (var j = 0u; j < TAPS; j++) {
        let row = at.y + j - RADIUS;
        if row < loss.size.y {
            let pixel = 3u * (row * loss.size.x + at.x);
            let w = WINDOW[j];
            d_mean += spread(rows[pixel].xyz, w);
            d_square += spread(rows[pixel + 1u].xyz, w);
            d_product += spread(rows[pixel + 2u].xyz, w);
        }
    }
    let d_l1 = loss.l1_weight * loss.inverse_count;
    for (var o = 0u; o < RUN && at.y + o < loss.size.y; o++) {
        let pixel = (at.y + o) * loss.size.x + at.x;
        let x = image[pixel].xyz;
        let y = target_color(pixel);
        d_image[pixel] = vec4(d_l1 * sign(x - y) + d_mean[o] + 2.0 * x * d_square[o] + y * d_product[o], 0.0);
    }
}

// Sums `values` over 256 contiguous strands; the host adds those up in order.
@compute @workgroup_size(64)
fn loss_sums(@builtin(global_invocation_id) id: vec3<u32>) {
    let count = loss.size.x * loss.size.y;
    let length = (count + 255u) / 256u;
    var sum = vec2(0.0);
    for (var i = min(id.x * length, count); i < min((id.x + 1u) * length, count); i++) {
        sum += values[i];
    }
    strand_sums[id.x] = sum;
}

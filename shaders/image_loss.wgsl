// L1, SSIM and squared error between a rendered image and an 8-bit target, and a penalty between coverage and mask:
// value and gradient.
//
// SSIM uses an 11x11 Gaussian window (sigma 1.5) as two one-dimensional passes; both pictures are zero outside the
// image. Every invocation computes a run of four outputs along the pass's direction, so that a tap is loaded once for
// four outputs. The taps are unrolled with their weights: if a loop indexed them, weights and sums would be kept in
// memory, which is four times slower on a software rasteriser.

import package::shared::dispatch::flat_index;

struct LossUniforms {
    size: vec2<u32>,
    // Weights of mean |x - y| and of 1 - mean SSIM.
    l1_weight: f32,
    ssim_weight: f32,
    // One over the number of values (pixels times three) in the means.
    inverse_count: f32,
    // Weight of mean (x - y)^2.
    squared_weight: f32,
    // Whether each pixel is weighted by its mask (SSIM: by the mask at the centre of its window).
    masked: u32,
    // Weight of the mean penalty on coverage, over the pixels.
    coverage_weight: f32,
}

const RUN: u32 = 4u;
const RADIUS: u32 = 5u;
const C1: f32 = 0.0001;
const C2: f32 = 0.0009;
// Up to here an error of the coverage counts by its square, beyond linearly.
const COVERAGE_WIDTH: f32 = 0.1;

@group(0) @binding(0) var<uniform> loss: LossUniforms;
// Rendered colour (rgb) and coverage.
@group(0) @binding(1) var<storage, read> image: array<vec4<f32>>;
// Target: red in the lowest byte, then green, blue, mask.
@group(0) @binding(2) var<storage, read> target_image: array<u32>;
// Four blurred values per pixel: x, y, x^2 + y^2, x y; later three: the gradients to mean, square and product.
@group(0) @binding(3) var<storage, read_write> rows: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read_write> partials: array<vec4<f32>>;
// |x - y|, SSIM and (x - y)^2 of each pixel, summed over the channels, times its mask; and its penalty on coverage.
@group(0) @binding(5) var<storage, read_write> values: array<vec4<f32>>;
@group(0) @binding(6) var<storage, read_write> d_image: array<vec4<f32>>;
@group(0) @binding(7) var<storage, read_write> strand_sums: array<vec4<f32>>;

fn target_color(pixel: u32) -> vec3<f32> {
    return unpack4x8unorm(target_image[pixel]).xyz;
}

fn mask_weight(pixel: u32) -> f32 {
    return select(1.0, unpack4x8unorm(target_image[pixel]).w, loss.masked != 0u);
}

// Coverage less mask. A mask that is neither 0 nor 1 says nothing.
fn coverage_error(pixel: u32) -> f32 {
    let mask = unpack4x8unorm(target_image[pixel]).w;
    return select(0.0, image[pixel].w - mask, mask == 0.0 || mask == 1.0);
}

fn coverage_penalty(error: f32) -> f32 {
    let size = abs(error);
    return select(size - 0.5 * COVERAGE_WIDTH, 0.5 * size * size / COVERAGE_WIDTH, size < COVERAGE_WIDTH);
}

// What the loss without SSIM adds to dL/d(colour, coverage) of a pixel with these colours.
fn plain_gradient(pixel: u32, x: vec3<f32>, y: vec3<f32>) -> vec4<f32> {
    let d_l1 = loss.l1_weight * loss.inverse_count * mask_weight(pixel);
    let d_squared = 2.0 * loss.squared_weight * loss.inverse_count * mask_weight(pixel);
    // The mean is over pixels, which have three values each.
    let d_coverage = 3.0 * loss.coverage_weight * loss.inverse_count
        * clamp(coverage_error(pixel) / COVERAGE_WIDTH, -1.0, 1.0);
    return vec4(d_l1 * sign(x - y) + d_squared * (x - y), d_coverage);
}

// The values of a pixel, whose SSIM is given as a sum over its channels, with its weight by the mask.
fn values_of(pixel: u32, ssim: f32, weight: f32) -> vec4<f32> {
    let error = abs(image[pixel].xyz - target_color(pixel));
    let sums = weight * vec3(error.x + error.y + error.z, ssim, dot(error, error));
    return vec4(sums, coverage_penalty(coverage_error(pixel)));
}

fn spread(value: vec3<f32>, w: vec4<f32>) -> mat4x3<f32> {
    return mat4x3(value * w.x, value * w.y, value * w.z, value * w.w);
}

// The first pixel of an invocation's run, for runs along rows.
fn run_in_row(index: u32) -> vec2<u32> {
    let runs = (loss.size.x + RUN - 1u) / RUN;
    return vec2((index % runs) * RUN, index / runs);
}

// The same for runs along columns.
fn run_in_column(index: u32) -> vec2<u32> {
    return vec2(index % loss.size.x, index / loss.size.x * RUN);
}

// Sums of a run: one column for each of its four outputs.
struct PairSums {
    x: mat4x3<f32>,
    y: mat4x3<f32>,
    squares: mat4x3<f32>,
    product: mat4x3<f32>,
}

struct GradientSums {
    mean: mat4x3<f32>,
    square: mat4x3<f32>,
    product: mat4x3<f32>,
}

// Tap number `tap` of the run that starts at `at`, with its weight for each output. Before the first pixel the
// subtraction wraps to a huge number.
fn pair_tap(sums: ptr<function, PairSums>, at: vec2<u32>, tap: u32, w: vec4<f32>) {
    let column = at.x + tap - RADIUS;
    if column < loss.size.x {
        let pixel = at.y * loss.size.x + column;
        let x = image[pixel].xyz;
        let y = target_color(pixel);
        (*sums).x += spread(x, w);
        (*sums).y += spread(y, w);
        (*sums).squares += spread(x * x + y * y, w);
        (*sums).product += spread(x * y, w);
    }
}

fn blurred_tap(sums: ptr<function, PairSums>, at: vec2<u32>, tap: u32, w: vec4<f32>) {
    let row = at.y + tap - RADIUS;
    if row < loss.size.y {
        let pixel = 4u * (row * loss.size.x + at.x);
        (*sums).x += spread(rows[pixel].xyz, w);
        (*sums).y += spread(rows[pixel + 1u].xyz, w);
        (*sums).squares += spread(rows[pixel + 2u].xyz, w);
        (*sums).product += spread(rows[pixel + 3u].xyz, w);
    }
}

fn partial_tap(sums: ptr<function, GradientSums>, at: vec2<u32>, tap: u32, w: vec4<f32>) {
    let column = at.x + tap - RADIUS;
    if column < loss.size.x {
        let pixel = 3u * (at.y * loss.size.x + column);
        (*sums).mean += spread(partials[pixel].xyz, w);
        (*sums).square += spread(partials[pixel + 1u].xyz, w);
        (*sums).product += spread(partials[pixel + 2u].xyz, w);
    }
}

fn gradient_tap(sums: ptr<function, GradientSums>, at: vec2<u32>, tap: u32, w: vec4<f32>) {
    let row = at.y + tap - RADIUS;
    if row < loss.size.y {
        let pixel = 3u * (row * loss.size.x + at.x);
        (*sums).mean += spread(rows[pixel].xyz, w);
        (*sums).square += spread(rows[pixel + 1u].xyz, w);
        (*sums).product += spread(rows[pixel + 2u].xyz, w);
    }
}

fn store_rows(at: vec2<u32>, x: vec3<f32>, y: vec3<f32>, squares: vec3<f32>, product: vec3<f32>) {
    if at.x < loss.size.x {
        let pixel = 4u * (at.y * loss.size.x + at.x);
        rows[pixel] = vec4(x, 0.0);
        rows[pixel + 1u] = vec4(y, 0.0);
        rows[pixel + 2u] = vec4(squares, 0.0);
        rows[pixel + 3u] = vec4(product, 0.0);
    }
}

fn store_ssim(at: vec2<u32>, mean_x: vec3<f32>, mean_y: vec3<f32>, squares: vec3<f32>, product: vec3<f32>) {
    if at.y < loss.size.y {
        let pixel = at.y * loss.size.x + at.x;
        let weight = mask_weight(pixel);
        let d_ssim = -loss.ssim_weight * loss.inverse_count * weight;
        let mean_squares = mean_x * mean_x + mean_y * mean_y;
        let n1 = 2.0 * mean_x * mean_y + C1;
        let n2 = 2.0 * (product - mean_x * mean_y) + C2;
        let d1 = mean_squares + C1;
        let d2 = squares - mean_squares + C2;
        let inverse = 1.0 / (d1 * d2);
        let ssim = n1 * n2 * inverse;
        partials[3u * pixel] =
            vec4(d_ssim * (2.0 * mean_y * (n2 - n1) * inverse - 2.0 * mean_x * ssim * (1.0 / d1 - 1.0 / d2)), 0.0);
        partials[3u * pixel + 1u] = vec4(d_ssim * -ssim / d2, 0.0);
        partials[3u * pixel + 2u] = vec4(d_ssim * 2.0 * n1 * inverse, 0.0);
        values[pixel] = values_of(pixel, ssim.x + ssim.y + ssim.z, weight);
    }
}

fn store_partials(at: vec2<u32>, d_mean: vec3<f32>, d_square: vec3<f32>, d_product: vec3<f32>) {
    if at.x < loss.size.x {
        let pixel = 3u * (at.y * loss.size.x + at.x);
        rows[pixel] = vec4(d_mean, 0.0);
        rows[pixel + 1u] = vec4(d_square, 0.0);
        rows[pixel + 2u] = vec4(d_product, 0.0);
    }
}

fn store_gradient(at: vec2<u32>, d_mean: vec3<f32>, d_square: vec3<f32>, d_product: vec3<f32>) {
    if at.y < loss.size.y {
        let pixel = at.y * loss.size.x + at.x;
        let x = image[pixel].xyz;
        let y = target_color(pixel);
        d_image[pixel] = plain_gradient(pixel, x, y) + vec4(d_mean + 2.0 * x * d_square + y * d_product, 0.0);
    }
}

// All of it, where SSIM has no weight.
@compute @workgroup_size(64)
fn loss_without_ssim(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                     @builtin(local_invocation_index) local: u32) {
    let pixel = flat_index(group, groups, local, 64u);
    if pixel < loss.size.x * loss.size.y {
        values[pixel] = values_of(pixel, 0.0, mask_weight(pixel));
        d_image[pixel] = plain_gradient(pixel, image[pixel].xyz, target_color(pixel));
    }
}

@compute @workgroup_size(64)
fn loss_rows(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
             @builtin(local_invocation_index) local: u32) {
    let at = run_in_row(flat_index(group, groups, local, 64u));
    if at.y >= loss.size.y {
        return;
    }
    var sums = PairSums();
    pair_tap(&sums, at, 0u, vec4(0.00102838008, 0.0, 0.0, 0.0));
    pair_tap(&sums, at, 1u, vec4(0.00759875814, 0.00102838008, 0.0, 0.0));
    pair_tap(&sums, at, 2u, vec4(0.0360007721, 0.00759875814, 0.00102838008, 0.0));
    pair_tap(&sums, at, 3u, vec4(0.10936069, 0.0360007721, 0.00759875814, 0.00102838008));
    pair_tap(&sums, at, 4u, vec4(0.213005538, 0.10936069, 0.0360007721, 0.00759875814));
    pair_tap(&sums, at, 5u, vec4(0.266011725, 0.213005538, 0.10936069, 0.0360007721));
    pair_tap(&sums, at, 6u, vec4(0.213005538, 0.266011725, 0.213005538, 0.10936069));
    pair_tap(&sums, at, 7u, vec4(0.10936069, 0.213005538, 0.266011725, 0.213005538));
    pair_tap(&sums, at, 8u, vec4(0.0360007721, 0.10936069, 0.213005538, 0.266011725));
    pair_tap(&sums, at, 9u, vec4(0.00759875814, 0.0360007721, 0.10936069, 0.213005538));
    pair_tap(&sums, at, 10u, vec4(0.00102838008, 0.00759875814, 0.0360007721, 0.10936069));
    pair_tap(&sums, at, 11u, vec4(0.0, 0.00102838008, 0.00759875814, 0.0360007721));
    pair_tap(&sums, at, 12u, vec4(0.0, 0.0, 0.00102838008, 0.00759875814));
    pair_tap(&sums, at, 13u, vec4(0.0, 0.0, 0.0, 0.00102838008));
    store_rows(at + vec2(0u, 0u), sums.x[0], sums.y[0], sums.squares[0], sums.product[0]);
    store_rows(at + vec2(1u, 0u), sums.x[1], sums.y[1], sums.squares[1], sums.product[1]);
    store_rows(at + vec2(2u, 0u), sums.x[2], sums.y[2], sums.squares[2], sums.product[2]);
    store_rows(at + vec2(3u, 0u), sums.x[3], sums.y[3], sums.squares[3], sums.product[3]);
}

@compute @workgroup_size(64)
fn loss_columns(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                @builtin(local_invocation_index) local: u32) {
    let at = run_in_column(flat_index(group, groups, local, 64u));
    if at.y >= loss.size.y {
        return;
    }
    var sums = PairSums();
    blurred_tap(&sums, at, 0u, vec4(0.00102838008, 0.0, 0.0, 0.0));
    blurred_tap(&sums, at, 1u, vec4(0.00759875814, 0.00102838008, 0.0, 0.0));
    blurred_tap(&sums, at, 2u, vec4(0.0360007721, 0.00759875814, 0.00102838008, 0.0));
    blurred_tap(&sums, at, 3u, vec4(0.10936069, 0.0360007721, 0.00759875814, 0.00102838008));
    blurred_tap(&sums, at, 4u, vec4(0.213005538, 0.10936069, 0.0360007721, 0.00759875814));
    blurred_tap(&sums, at, 5u, vec4(0.266011725, 0.213005538, 0.10936069, 0.0360007721));
    blurred_tap(&sums, at, 6u, vec4(0.213005538, 0.266011725, 0.213005538, 0.10936069));
    blurred_tap(&sums, at, 7u, vec4(0.10936069, 0.213005538, 0.266011725, 0.213005538));
    blurred_tap(&sums, at, 8u, vec4(0.0360007721, 0.10936069, 0.213005538, 0.266011725));
    blurred_tap(&sums, at, 9u, vec4(0.00759875814, 0.0360007721, 0.10936069, 0.213005538));
    blurred_tap(&sums, at, 10u, vec4(0.00102838008, 0.00759875814, 0.0360007721, 0.10936069));
    blurred_tap(&sums, at, 11u, vec4(0.0, 0.00102838008, 0.00759875814, 0.0360007721));
    blurred_tap(&sums, at, 12u, vec4(0.0, 0.0, 0.00102838008, 0.00759875814));
    blurred_tap(&sums, at, 13u, vec4(0.0, 0.0, 0.0, 0.00102838008));
    store_ssim(at + vec2(0u, 0u), sums.x[0], sums.y[0], sums.squares[0], sums.product[0]);
    store_ssim(at + vec2(0u, 1u), sums.x[1], sums.y[1], sums.squares[1], sums.product[1]);
    store_ssim(at + vec2(0u, 2u), sums.x[2], sums.y[2], sums.squares[2], sums.product[2]);
    store_ssim(at + vec2(0u, 3u), sums.x[3], sums.y[3], sums.squares[3], sums.product[3]);
}

@compute @workgroup_size(64)
fn gradient_rows(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                 @builtin(local_invocation_index) local: u32) {
    let at = run_in_row(flat_index(group, groups, local, 64u));
    if at.y >= loss.size.y {
        return;
    }
    var sums = GradientSums();
    partial_tap(&sums, at, 0u, vec4(0.00102838008, 0.0, 0.0, 0.0));
    partial_tap(&sums, at, 1u, vec4(0.00759875814, 0.00102838008, 0.0, 0.0));
    partial_tap(&sums, at, 2u, vec4(0.0360007721, 0.00759875814, 0.00102838008, 0.0));
    partial_tap(&sums, at, 3u, vec4(0.10936069, 0.0360007721, 0.00759875814, 0.00102838008));
    partial_tap(&sums, at, 4u, vec4(0.213005538, 0.10936069, 0.0360007721, 0.00759875814));
    partial_tap(&sums, at, 5u, vec4(0.266011725, 0.213005538, 0.10936069, 0.0360007721));
    partial_tap(&sums, at, 6u, vec4(0.213005538, 0.266011725, 0.213005538, 0.10936069));
    partial_tap(&sums, at, 7u, vec4(0.10936069, 0.213005538, 0.266011725, 0.213005538));
    partial_tap(&sums, at, 8u, vec4(0.0360007721, 0.10936069, 0.213005538, 0.266011725));
    partial_tap(&sums, at, 9u, vec4(0.00759875814, 0.0360007721, 0.10936069, 0.213005538));
    partial_tap(&sums, at, 10u, vec4(0.00102838008, 0.00759875814, 0.0360007721, 0.10936069));
    partial_tap(&sums, at, 11u, vec4(0.0, 0.00102838008, 0.00759875814, 0.0360007721));
    partial_tap(&sums, at, 12u, vec4(0.0, 0.0, 0.00102838008, 0.00759875814));
    partial_tap(&sums, at, 13u, vec4(0.0, 0.0, 0.0, 0.00102838008));
    store_partials(at + vec2(0u, 0u), sums.mean[0], sums.square[0], sums.product[0]);
    store_partials(at + vec2(1u, 0u), sums.mean[1], sums.square[1], sums.product[1]);
    store_partials(at + vec2(2u, 0u), sums.mean[2], sums.square[2], sums.product[2]);
    store_partials(at + vec2(3u, 0u), sums.mean[3], sums.square[3], sums.product[3]);
}

@compute @workgroup_size(64)
fn gradient_columns(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                    @builtin(local_invocation_index) local: u32) {
    let at = run_in_column(flat_index(group, groups, local, 64u));
    if at.y >= loss.size.y {
        return;
    }
    var sums = GradientSums();
    gradient_tap(&sums, at, 0u, vec4(0.00102838008, 0.0, 0.0, 0.0));
    gradient_tap(&sums, at, 1u, vec4(0.00759875814, 0.00102838008, 0.0, 0.0));
    gradient_tap(&sums, at, 2u, vec4(0.0360007721, 0.00759875814, 0.00102838008, 0.0));
    gradient_tap(&sums, at, 3u, vec4(0.10936069, 0.0360007721, 0.00759875814, 0.00102838008));
    gradient_tap(&sums, at, 4u, vec4(0.213005538, 0.10936069, 0.0360007721, 0.00759875814));
    gradient_tap(&sums, at, 5u, vec4(0.266011725, 0.213005538, 0.10936069, 0.0360007721));
    gradient_tap(&sums, at, 6u, vec4(0.213005538, 0.266011725, 0.213005538, 0.10936069));
    gradient_tap(&sums, at, 7u, vec4(0.10936069, 0.213005538, 0.266011725, 0.213005538));
    gradient_tap(&sums, at, 8u, vec4(0.0360007721, 0.10936069, 0.213005538, 0.266011725));
    gradient_tap(&sums, at, 9u, vec4(0.00759875814, 0.0360007721, 0.10936069, 0.213005538));
    gradient_tap(&sums, at, 10u, vec4(0.00102838008, 0.00759875814, 0.0360007721, 0.10936069));
    gradient_tap(&sums, at, 11u, vec4(0.0, 0.00102838008, 0.00759875814, 0.0360007721));
    gradient_tap(&sums, at, 12u, vec4(0.0, 0.0, 0.00102838008, 0.00759875814));
    gradient_tap(&sums, at, 13u, vec4(0.0, 0.0, 0.0, 0.00102838008));
    store_gradient(at + vec2(0u, 0u), sums.mean[0], sums.square[0], sums.product[0]);
    store_gradient(at + vec2(0u, 1u), sums.mean[1], sums.square[1], sums.product[1]);
    store_gradient(at + vec2(0u, 2u), sums.mean[2], sums.square[2], sums.product[2]);
    store_gradient(at + vec2(0u, 3u), sums.mean[3], sums.square[3], sums.product[3]);
}

// Sums `values` over 256 contiguous strands; the host adds those up in order.
@compute @workgroup_size(64)
fn loss_sums(@builtin(global_invocation_id) id: vec3<u32>) {
    let count = loss.size.x * loss.size.y;
    let length = (count + 255u) / 256u;
    var sum = vec4(0.0);
    for (var i = min(id.x * length, count); i < min((id.x + 1u) * length, count); i++) {
        sum += values[i];
    }
    strand_sums[id.x] = sum;
}

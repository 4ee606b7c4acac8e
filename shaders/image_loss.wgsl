// L1 and SSIM between a rendered image and an 8-bit target: value and gradient.
//
// SSIM uses an 11x11 Gaussian window (sigma 1.5) as one-dimensional passes; both pictures are zero outside the image. An
// invocation walks along a strip of a row or column and carries the ten last inputs with it, so that each is loaded once,
// not once for each of the eleven outputs that it counts for: on a software rasteriser loads are what costs. The columns'
// pass has two such windows, one behind the other: the gradients to the blurred values are blurred, too.

import package::shared::dispatch::flat_index;

struct LossUniforms {
    size: vec2<u32>,
    // Weights of mean |x - y| and of 1 - mean SSIM.
    l1_weight: f32,
    ssim_weight: f32,
    // One over the number of values (pixels times three) in the means.
    inverse_count: f32,
    // Number of `values`.
    summands: u32,
    padding: vec2<u32>,
}

const RADIUS: i32 = 5;
const C1: f32 = 0.0001;
const C2: f32 = 0.0009;
// Outputs of an invocation: with the inputs around them a multiple of four.
const ROW_STRIP: i32 = 54;
const COLUMN_STRIP: i32 = 84;

@group(0) @binding(0) var<uniform> loss: LossUniforms;
// Rendered colour (rgb) and coverage.
@group(0) @binding(1) var<storage, read> image: array<vec4<f32>>;
// Target: red in the lowest byte, then green and blue.
@group(0) @binding(2) var<storage, read> target_image: array<u32>;
// Pixel by pixel, for red, green and blue: x, y, x^2 + y^2 and x y, blurred along rows.
@group(0) @binding(3) var<storage, read_write> rows: array<mat3x4<f32>>;
// The same way: the gradients to the blurred x, x^2 + y^2 and x y, blurred along columns.
@group(0) @binding(4) var<storage, read_write> columns: array<mat3x4<f32>>;
// Sums of |x - y| and of SSIM over the channels of some pixels.
@group(0) @binding(5) var<storage, read_write> values: array<vec2<f32>>;
@group(0) @binding(6) var<storage, read_write> d_image: array<vec4<f32>>;
@group(0) @binding(7) var<storage, read_write> strand_sums: array<vec2<f32>>;

// Colour of a pixel of the target.
fn target_at(pixel: u32) -> vec3<f32> {
    return unpack4x8unorm(target_image[pixel]).xyz;
}

// The last ten inputs of a strip, the oldest first: for each pixel one column for each colour.
struct Window {
    inputs: array<mat3x4<f32>, 10>,
}

// Takes the next input and returns the blurred value at the one five before it. Without a loop, which would keep the
// inputs in memory.
fn slide(window: ptr<function, Window>, next: mat3x4<f32>) -> mat3x4<f32> {
    let last = (*window).inputs;
    (*window).inputs =
        array(last[1], last[2], last[3], last[4], last[5], last[6], last[7], last[8], last[9], next);
    return (last[0] + next) * 0.00102838008 + (last[1] + last[9]) * 0.00759875814
        + (last[2] + last[8]) * 0.0360007721 + (last[3] + last[7]) * 0.10936069
        + (last[4] + last[6]) * 0.213005538 + last[5] * 0.266011725;
}

// x, y, x^2 + y^2 and x y of one colour.
fn products(x: f32, y: f32) -> vec4<f32> {
    return vec4(x, y, x * x + y * y, x * y);
}

// SSIM of one colour from its blurred products, and its gradient to the blurred x, x^2 + y^2 and x y.
fn ssim_of(blurred: vec4<f32>) -> vec4<f32> {
    let mean_x = blurred.x;
    let mean_y = blurred.y;
    let mean_squares = mean_x * mean_x + mean_y * mean_y;
    let n1 = 2.0 * mean_x * mean_y + C1;
    let n2 = 2.0 * (blurred.w - mean_x * mean_y) + C2;
    let d1 = mean_squares + C1;
    let d2 = blurred.z - mean_squares + C2;
    let inverse = 1.0 / (d1 * d2);
    let ssim = n1 * n2 * inverse;
    let d_mean = 2.0 * mean_y * (n2 - n1) * inverse - 2.0 * mean_x * ssim * (1.0 / d1 - 1.0 / d2);
    return vec4(d_mean, -ssim / d2, 2.0 * n1 * inverse, ssim);
}

// The outputs of an invocation: a part of a row or column.
struct Strip {
    // The row or column.
    line: u32,
    // The first, and one past the last.
    first: i32,
    end: i32,
}

// Strip number `index` of so many lines of a length, cut into strips of a size. Beyond the last it is empty.
fn strip_of(index: u32, lines: u32, length: u32, size: i32) -> Strip {
    let first = i32(index / lines) * size;
    return Strip(index % lines, first, min(first + size, i32(length)));
}

fn is_own(output: i32, strip: Strip) -> bool {
    return output >= strip.first && output < strip.end;
}

// One input of a strip of a row, and the output that it completes.
fn blur_in_row(window: ptr<function, Window>, row: Strip, input: i32) {
    var next = mat3x4<f32>();
    if input >= 0 && input < i32(loss.size.x) {
        let pixel = row.line * loss.size.x + u32(input);
        let x = image[pixel];
        let y = target_at(pixel);
        next = mat3x4(products(x.x, y.x), products(x.y, y.y), products(x.z, y.z));
    }
    let blurred = slide(window, next);
    let output = input - RADIUS;
    if is_own(output, row) {
        rows[row.line * loss.size.x + u32(output)] = blurred;
    }
}

// One input of a strip of a column: it completes the blurred products of one pixel and, with the gradients to them, the
// output five before that. Returns what it adds to SSIM.
fn blur_in_column(window: ptr<function, Window>, d_window: ptr<function, Window>, column: Strip, input: i32) -> f32 {
    var next = mat3x4<f32>();
    if input >= 0 && input < i32(loss.size.y) {
        next = rows[u32(input) * loss.size.x + column.line];
    }
    let blurred = slide(window, next);
    let middle = input - RADIUS;
    var d_next = mat3x4<f32>();
    var ssim = 0.0;
    if middle >= 0 && middle < i32(loss.size.y) {
        let colors = mat3x4(ssim_of(blurred[0]), ssim_of(blurred[1]), ssim_of(blurred[2]));
        d_next = colors * (-loss.ssim_weight * loss.inverse_count);
        ssim = select(0.0, colors[0].w + colors[1].w + colors[2].w, is_own(middle, column));
    }
    let d_blurred = slide(d_window, d_next);
    let output = middle - RADIUS;
    if is_own(output, column) {
        columns[u32(output) * loss.size.x + column.line] = d_blurred;
    }
    return ssim;
}

// One input of a strip of a row of the gradients, and the gradient of the pixel that it completes. Returns the pixel's
// L1.
fn d_blur_in_row(window: ptr<function, Window>, row: Strip, input: i32) -> f32 {
    var next = mat3x4<f32>();
    if input >= 0 && input < i32(loss.size.x) {
        next = columns[row.line * loss.size.x + u32(input)];
    }
    let d = transpose(slide(window, next));
    let output = input - RADIUS;
    var l1 = 0.0;
    if is_own(output, row) {
        let pixel = row.line * loss.size.x + u32(output);
        let x = image[pixel].xyz;
        let y = target_at(pixel);
        let d_l1 = loss.l1_weight * loss.inverse_count * sign(x - y);
        d_image[pixel] = vec4(d_l1 + (d[0] + 2.0 * x * d[1] + y * d[2]), 0.0);
        let error = abs(x - y);
        l1 = error.x + error.y + error.z;
    }
    return l1;
}

@compute @workgroup_size(32)
fn blur_rows(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
             @builtin(local_invocation_index) local: u32) {
    let row = strip_of(flat_index(group, groups, local, 32u), loss.size.y, loss.size.x, ROW_STRIP);
    var window = Window();
    if row.first < row.end {
        for (var i = row.first - RADIUS; i < row.end + RADIUS; i += 4) {
            blur_in_row(&window, row, i);
            blur_in_row(&window, row, i + 1);
            blur_in_row(&window, row, i + 2);
            blur_in_row(&window, row, i + 3);
        }
    }
}

@compute @workgroup_size(32)
fn blur_columns(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                @builtin(local_invocation_index) local: u32) {
    let index = flat_index(group, groups, local, 32u);
    let column = strip_of(index, loss.size.x, loss.size.y, COLUMN_STRIP);
    var window = Window();
    var d_window = Window();
    if column.first < column.end {
        var ssim = 0.0;
        for (var i = column.first - 2 * RADIUS; i < column.end + 2 * RADIUS; i += 4) {
            ssim += blur_in_column(&window, &d_window, column, i);
            ssim += blur_in_column(&window, &d_window, column, i + 1);
            ssim += blur_in_column(&window, &d_window, column, i + 2);
            ssim += blur_in_column(&window, &d_window, column, i + 3);
        }
        values[index] = vec2(0.0, ssim);
    }
}

@compute @workgroup_size(32)
fn d_blur_rows(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
               @builtin(local_invocation_index) local: u32) {
    let index = flat_index(group, groups, local, 32u);
    let row = strip_of(index, loss.size.y, loss.size.x, ROW_STRIP);
    var window = Window();
    if row.first < row.end {
        var l1 = 0.0;
        for (var i = row.first - RADIUS; i < row.end + RADIUS; i += 4) {
            l1 += d_blur_in_row(&window, row, i);
            l1 += d_blur_in_row(&window, row, i + 1);
            l1 += d_blur_in_row(&window, row, i + 2);
            l1 += d_blur_in_row(&window, row, i + 3);
        }
        // Behind those of the columns.
        let strips = (i32(loss.size.y) + COLUMN_STRIP - 1) / COLUMN_STRIP;
        values[loss.size.x * u32(strips) + index] = vec2(l1, 0.0);
    }
}

// Sums `values` over 256 contiguous strands; the host adds those up in order.
@compute @workgroup_size(64)
fn loss_sums(@builtin(global_invocation_id) id: vec3<u32>) {
    let count = loss.summands;
    let length = (count + 255u) / 256u;
    var sum = vec2(0.0);
    for (var i = min(id.x * length, count); i < min((id.x + 1u) * length, count); i++) {
        sum += values[i];
    }
    strand_sums[id.x] = sum;
}

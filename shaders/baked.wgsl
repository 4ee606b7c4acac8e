// A baked hand: the posed Gaussians from the joints' rotations in one stage. CPU twin: `ghand_render::reference::baked`.
//
// Gaussians lie in groups of 64. A group has its own few joints and components, so that what they are is the same for its
// sixteen invocations, which handle four Gaussians each: vectors here have a component for each of the four.
// `layout_words` has the groups, then their joints, then their entries; `words` has what each Gaussian is at the mean, then
// skinning weights, then the values of the entries.

import package::shared::dispatch::flat_index;
import package::shared::pose::{CHAIN_POSED, CHAIN_STRIDE, pose};

struct BakedUniforms {
    // The box that packed positions are relative to, and the standard deviation that packed ones are, metres.
    corner: vec3<f32>,
    max_scale: f32,
    size: vec3<f32>,
    component_count: u32,
    group_count: u32,
    // Where joints and entries start in `layout_words`, weights and values in `words`.
    joints_start: u32,
    entries_start: u32,
    weights_start: u32,
    values_start: u32,
    padding_1: u32,
    padding_2: u32,
    padding_3: u32,
}

// Words of an entry's seven values of a Gaussian: 7 for f32, 4 for f16, 2 for u8. With 7, what it is at the mean is f32 too.
override VALUE_WORDS: u32 = 7u;
// Whether the table has normals, and whether the hand does.
override FLAT: bool = false;
override NORMALS: bool = false;
// Whether light is apart from the colours, so that another stage writes them.
override LIT: bool = false;
// First row of the colours in the splatter's table.
override ROW_COLOR: u32 = 4u;

const GROUP: u32 = 64u;
// Invocations of a group.
const LANES: u32 = GROUP / 4u;
// Words of a group: first joint and their number, which is even, first entry and their number.
const GROUP_WORDS: u32 = 4u;
// Words of an entry: its component, and the factors on offsets, standard deviations and colours.
const ENTRY_WORDS: u32 = 4u;
// Words of a component: its joint, the joint whose bend its product has, its limits, the product's gain, then nine gains.
const COMPONENT_WORDS: u32 = 14u;
// Rows of the mean: position, standard deviation, colour, normal.
const MEAN_ROWS: u32 = 10u;
const ROW_SCALE: u32 = 3u;
// As `ghand_avatar::deform::baked::SMALLEST_SCALE`.
const SMALLEST_SCALE: f32 = 1e-6;

@group(0) @binding(1) var<uniform> baked: BakedUniforms;
@group(0) @binding(2) var<storage, read> chain: array<f32>;
@group(0) @binding(3) var<storage, read> poses: array<f32>;
@group(0) @binding(4) var<storage, read> components: array<f32>;
// Which way each joint bends, [joints][9].
@group(0) @binding(5) var<storage, read> bends: array<f32>;
// The components in this pose.
@group(0) @binding(6) var<storage, read_write> terms: array<f32>;
@group(0) @binding(7) var<storage, read> layout_words: array<u32>;
@group(0) @binding(8) var<storage, read> words: array<u32>;
@group(0) @binding(9) var<storage, read_write> gaussians: array<f32>;
// [3][N], for the stage that lights them.
@group(0) @binding(10) var<storage, read_write> color: array<f32>;

// Entry c of vec(R_k - I).
fn feature(k: u32, c: u32) -> f32 {
    return chain[k * CHAIN_STRIDE + c] - select(0.0, 1.0, c % 4u == 0u);
}

fn bend(k: u32) -> f32 {
    var sum = 0.0;
    for (var c = 0u; c < 9u; c++) {
        sum += bends[9u * k + c] * feature(k, c);
    }
    return sum;
}

@compute @workgroup_size(64)
fn baked_terms(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= baked.component_count {
        return;
    }
    let at = id.x * COMPONENT_WORDS;
    let k = u32(components[at]);
    var sum = components[at + 4u] * bend(k) * bend(u32(components[at + 1u]));
    for (var c = 0u; c < 9u; c++) {
        sum += components[at + 5u + c] * feature(k, c);
    }
    terms[id.x] = clamp(sum, components[at + 2u], components[at + 3u]);
}

// Four Gaussians before they are skinned; a column of a matrix for each coordinate.
struct Unposed {
    point: mat3x4<f32>,
    scale: vec4<f32>,
    color: mat3x4<f32>,
    normal: mat3x4<f32>,
}

fn words_at(at: vec4<u32>) -> vec4<u32> {
    return vec4(words[at.x], words[at.y], words[at.z], words[at.w]);
}

fn floats_at(at: vec4<u32>) -> vec4<f32> {
    return bitcast<vec4<f32>>(words_at(at));
}

// Numbers of 16 and 8 bits from their places in words: without a sign from 0 to 1, with one from -1 to 1.
fn unorm16(word: vec4<u32>, bit: u32) -> vec4<f32> {
    return vec4<f32>((word >> vec4(bit)) & vec4(0xffffu)) / 65535.0;
}

fn unorm8(word: vec4<u32>, bit: u32) -> vec4<f32> {
    return vec4<f32>((word >> vec4(bit)) & vec4(0xffu)) / 255.0;
}

fn snorm8(word: vec4<u32>, bit: u32) -> vec4<f32> {
    let signed = bitcast<vec4<i32>>(word << vec4(24u - bit)) >> vec4(24u);
    return max(vec4<f32>(signed) / 127.0, vec4(-1.0));
}

// Numbers of half precision. Not `unpack2x16float`, which not every device has; the smallest may become 0.
fn half_at(word: vec4<u32>, bit: u32) -> vec4<f32> {
    let bits = (word >> vec4(bit)) & vec4(0xffffu);
    // An f32 has 112 more in its exponent.
    let magnitude = bitcast<vec4<f32>>((bits & vec4(0x7fffu)) << vec4(13u)) * 5.192296858534828e33;
    return select(magnitude, -magnitude, (bits & vec4(0x8000u)) != vec4(0u));
}

fn mean(p: vec4<u32>) -> Unposed {
    let n = pose.gaussian_count;
    if VALUE_WORDS == 7u {
        return Unposed(mat3x4(floats_at(p), floats_at(p + n), floats_at(p + 2u * n)),
                       floats_at(p + 3u * n),
                       mat3x4(floats_at(p + 4u * n), floats_at(p + 5u * n), floats_at(p + 6u * n)),
                       mat3x4(floats_at(p + 7u * n), floats_at(p + 8u * n), floats_at(p + 9u * n)));
    }
    let xy = words_at(p);
    let z_scale = words_at(p + n);
    let color = words_at(p + 2u * n);
    let normal = words_at(p + 3u * n);
    return Unposed(mat3x4(baked.corner.x + baked.size.x * unorm16(xy, 0u),
                          baked.corner.y + baked.size.y * unorm16(xy, 16u),
                          baked.corner.z + baked.size.z * unorm16(z_scale, 0u)),
                   baked.max_scale * unorm16(z_scale, 16u),
                   mat3x4(unorm8(color, 0u), unorm8(color, 8u), unorm8(color, 16u)),
                   mat3x4(snorm8(normal, 0u), snorm8(normal, 8u), snorm8(normal, 16u)));
}

// The values of an entry, before its factors.
struct Values {
    offset: mat3x4<f32>,
    scale: vec4<f32>,
    color: mat3x4<f32>,
}

fn values(entry: u32, lane: vec4<u32>) -> Values {
    let at = baked.values_start + entry * VALUE_WORDS * GROUP + lane;
    if VALUE_WORDS == 2u {
        let a = words_at(at);
        let b = words_at(at + GROUP);
        return Values(mat3x4(snorm8(a, 0u), snorm8(a, 8u), snorm8(a, 16u)), snorm8(a, 24u),
                      mat3x4(snorm8(b, 0u), snorm8(b, 8u), snorm8(b, 16u)));
    }
    if VALUE_WORDS == 4u {
        let a = words_at(at);
        let b = words_at(at + GROUP);
        let c = words_at(at + 2u * GROUP);
        let d = words_at(at + 3u * GROUP);
        return Values(mat3x4(half_at(a, 0u), half_at(a, 16u), half_at(b, 0u)), half_at(b, 16u),
                      mat3x4(half_at(c, 0u), half_at(c, 16u), half_at(d, 0u)));
    }
    return Values(mat3x4(floats_at(at), floats_at(at + GROUP), floats_at(at + 2u * GROUP)),
                  floats_at(at + 3u * GROUP),
                  mat3x4(floats_at(at + 4u * GROUP), floats_at(at + 5u * GROUP), floats_at(at + 6u * GROUP)));
}

fn store(row: u32, p: vec4<u32>, stored: vec4<bool>, value: vec4<f32>) {
    let at = row * pose.table_columns + pose.table_first + p;
    if stored.x { gaussians[at.x] = value.x; }
    if stored.y { gaussians[at.y] = value.y; }
    if stored.z { gaussians[at.z] = value.z; }
    if stored.w { gaussians[at.w] = value.w; }
}

fn store_color(channel: u32, p: vec4<u32>, stored: vec4<bool>, value: vec4<f32>) {
    let at = channel * pose.gaussian_count + p;
    if stored.x { color[at.x] = value.x; }
    if stored.y { color[at.y] = value.y; }
    if stored.z { color[at.z] = value.z; }
    if stored.w { color[at.w] = value.w; }
}

fn bone_row(k: u32, row: u32) -> vec4<f32> {
    let at = k * CHAIN_STRIDE + CHAIN_POSED + 4u * row;
    return vec4(chain[at], chain[at + 1u], chain[at + 2u], chain[at + 3u]);
}

// A row of two bones, weighted; a column for each entry of the row.
fn weighted_row(row: u32, a: u32, of_a: vec4<f32>, b: u32, of_b: vec4<f32>) -> mat4x4<f32> {
    let bone_a = bone_row(a, row);
    let bone_b = bone_row(b, row);
    return mat4x4(of_a * bone_a.x + of_b * bone_b.x, of_a * bone_a.y + of_b * bone_b.y,
                  of_a * bone_a.z + of_b * bone_b.z, of_a * bone_a.w + of_b * bone_b.w);
}

// A row of the map on points.
fn moved(row: mat4x4<f32>, point: mat3x4<f32>) -> vec4<f32> {
    return row[0] * point[0] + row[1] * point[1] + row[2] * point[2] + row[3];
}

// The triple product a x b . n of rows without their translation.
fn triple(a: mat4x4<f32>, b: mat4x4<f32>, n: mat3x4<f32>) -> vec4<f32> {
    return (a[1] * b[2] - a[2] * b[1]) * n[0] + (a[2] * b[0] - a[0] * b[2]) * n[1] + (a[0] * b[1] - a[1] * b[0]) * n[2];
}

@compute @workgroup_size(64)
fn baked_pose(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
              @builtin(local_invocation_index) local: u32) {
    let i = flat_index(group, groups, local, 64u);
    let g = i / LANES;
    if g >= baked.group_count {
        return;
    }
    let n = pose.gaussian_count;
    let lane = i % LANES + vec4(0u, LANES, 2u * LANES, 3u * LANES);
    // The last group may have fewer; those beyond are computed as the last and not stored.
    let p = min(g * GROUP + lane, vec4(n - 1u));
    let stored = g * GROUP + lane < vec4(n);
    var hand = mean(p);
    let first_entry = layout_words[g * GROUP_WORDS + 2u];
    let entries = layout_words[g * GROUP_WORDS + 3u];
    for (var e = first_entry; e < first_entry + entries; e++) {
        let at = baked.entries_start + e * ENTRY_WORDS;
        let term = terms[layout_words[at]];
        let value = values(e, lane);
        hand.point += value.offset * (term * bitcast<f32>(layout_words[at + 1u]));
        hand.scale += value.scale * (term * bitcast<f32>(layout_words[at + 2u]));
        hand.color += value.color * (term * bitcast<f32>(layout_words[at + 3u]));
    }
    let first_joint = layout_words[g * GROUP_WORDS];
    let joints = layout_words[g * GROUP_WORDS + 1u];
    var x = mat4x4<f32>();
    var y = mat4x4<f32>();
    var z = mat4x4<f32>();
    for (var j = first_joint; j < first_joint + joints; j += 2u) {
        let weights = words_at(baked.weights_start + j / 2u * GROUP + lane);
        let of_a = unorm16(weights, 0u);
        let of_b = unorm16(weights, 16u);
        let a = layout_words[baked.joints_start + j];
        let b = layout_words[baked.joints_start + j + 1u];
        x += weighted_row(0u, a, of_a, b, of_b);
        y += weighted_row(1u, a, of_a, b, of_b);
        z += weighted_row(2u, a, of_a, b, of_b);
    }
    let t = pose.pose_offset + 3u * pose.joint_count;
    store(0u, p, stored, moved(x, hand.point) + poses[t]);
    store(1u, p, stored, moved(y, hand.point) + poses[t + 1u]);
    store(2u, p, stored, moved(z, hand.point) + poses[t + 2u]);
    store(ROW_SCALE, p, stored, max(hand.scale, vec4(SMALLEST_SCALE)));
    if FLAT {
        var normal = mat3x4<f32>();
        if NORMALS {
            // A normal turns as the cross product of two tangents does, by the cofactors of the map.
            let turned = mat3x4(triple(y, z, hand.normal), triple(z, x, hand.normal), triple(x, y, hand.normal));
            let squared = turned[0] * turned[0] + turned[1] * turned[1] + turned[2] * turned[2];
            // Zero where the map flattens the surface's neighbourhood to a line.
            let scale = select(vec4(0.0), inverseSqrt(squared), squared > vec4(1e-30));
            normal = mat3x4(turned[0] * scale, turned[1] * scale, turned[2] * scale);
        }
        store(ROW_SCALE + 1u, p, stored, normal[0]);
        store(ROW_SCALE + 2u, p, stored, normal[1]);
        store(ROW_SCALE + 3u, p, stored, normal[2]);
    }
    for (var c = 0u; c < 3u; c++) {
        let shown = clamp(hand.color[c], vec4(0.0), vec4(1.0));
        if LIT {
            store_color(c, p, stored, shown);
        } else {
            store(ROW_COLOR + c, p, stored, shown);
        }
    }
}

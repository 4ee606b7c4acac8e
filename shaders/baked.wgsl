// A baked hand: the posed Gaussians from the joints' rotations in one stage. CPU twin: `ghand_render::reference::baked`.
//
// Gaussians lie in groups of 64, one for each workgroup. A group has its own few joints and components, so that what they
// are is the same for all of a workgroup. `layout_words` has the groups, then their joints, then their entries; `words` has
// what each Gaussian is at the mean, then skinning weights, then the values of the entries.

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
// Words of a group: first joint and their number, which is even, first entry and their number.
const GROUP_WORDS: u32 = 4u;
// Words of an entry: its component, and the factors on offsets, standard deviations and colours.
const ENTRY_WORDS: u32 = 4u;
// Words of a component: its joint, the joint whose bend its product has, its limits, the product's gain, then nine gains.
const COMPONENT_WORDS: u32 = 14u;
// Rows of the mean: position, standard deviation, colour, normal.
const MEAN_ROWS: u32 = 10u;
const ROW_SCALE: u32 = 3u;
// As `ghand_render::deform::baked::SMALLEST_SCALE`.
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

// A Gaussian before it is skinned.
struct Unposed {
    point: vec3<f32>,
    scale: f32,
    color: vec3<f32>,
    normal: vec3<f32>,
}

fn word(row: u32, p: u32) -> u32 {
    return words[row * pose.gaussian_count + p];
}

fn mean_vector(row: u32, p: u32) -> vec3<f32> {
    return bitcast<vec3<f32>>(vec3(word(row, p), word(row + 1u, p), word(row + 2u, p)));
}

fn mean(p: u32) -> Unposed {
    if VALUE_WORDS == 7u {
        return Unposed(mean_vector(0u, p), bitcast<f32>(word(3u, p)), mean_vector(4u, p), mean_vector(7u, p));
    }
    let xy = unpack2x16unorm(word(0u, p));
    let z_scale = unpack2x16unorm(word(1u, p));
    return Unposed(baked.corner + baked.size * vec3(xy, z_scale.x), baked.max_scale * z_scale.y,
                   unpack4x8unorm(word(2u, p)).xyz, unpack4x8snorm(word(3u, p)).xyz);
}

// Two numbers of half precision. Not `unpack2x16float`, which not every device has; the smallest may become 0.
fn halves(word: u32) -> vec2<f32> {
    let bits = vec2(word & 0xffffu, word >> 16u);
    // An f32 has 112 more in its exponent.
    let magnitude = bitcast<vec2<f32>>((bits & vec2(0x7fffu)) << vec2(13u)) * 5.192296858534828e33;
    return select(magnitude, -magnitude, (bits & vec2(0x8000u)) != vec2(0u));
}

// The values of an entry, before its factors.
struct Values {
    offset: vec3<f32>,
    scale: f32,
    color: vec3<f32>,
}

fn values(entry: u32, lane: u32) -> Values {
    let at = baked.values_start + entry * VALUE_WORDS * GROUP + lane;
    if VALUE_WORDS == 2u {
        let first = unpack4x8snorm(words[at]);
        return Values(first.xyz, first.w, unpack4x8snorm(words[at + GROUP]).xyz);
    }
    if VALUE_WORDS == 4u {
        let b = halves(words[at + GROUP]);
        return Values(vec3(halves(words[at]), b.x), b.y,
                      vec3(halves(words[at + 2u * GROUP]), halves(words[at + 3u * GROUP]).x));
    }
    let first = vec4(words[at], words[at + GROUP], words[at + 2u * GROUP], words[at + 3u * GROUP]);
    let color = vec3(words[at + 4u * GROUP], words[at + 5u * GROUP], words[at + 6u * GROUP]);
    return Values(bitcast<vec3<f32>>(first.xyz), bitcast<f32>(first.w), bitcast<vec3<f32>>(color));
}

fn store(row: u32, p: u32, value: vec3<f32>) {
    let at = row * pose.table_columns + pose.table_first + p;
    gaussians[at] = value.x;
    gaussians[at + pose.table_columns] = value.y;
    gaussians[at + 2u * pose.table_columns] = value.z;
}

fn bone_row(k: u32, row: u32) -> vec4<f32> {
    let at = k * CHAIN_STRIDE + CHAIN_POSED + 4u * row;
    return vec4(chain[at], chain[at + 1u], chain[at + 2u], chain[at + 3u]);
}

@compute @workgroup_size(64)
fn baked_pose(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
              @builtin(local_invocation_index) lane: u32) {
    let g = flat_index(group, groups, 0u, 1u);
    if g >= baked.group_count {
        return;
    }
    let n = pose.gaussian_count;
    // The last group may have fewer; lanes beyond are computed as its last and not stored.
    let p = min(g * GROUP + lane, n - 1u);
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
    var x = vec4(0.0);
    var y = vec4(0.0);
    var z = vec4(0.0);
    for (var j = first_joint; j < first_joint + joints; j += 2u) {
        let weights = unpack2x16unorm(words[baked.weights_start + j / 2u * GROUP + lane]);
        let a = layout_words[baked.joints_start + j];
        let b = layout_words[baked.joints_start + j + 1u];
        x += weights.x * bone_row(a, 0u) + weights.y * bone_row(b, 0u);
        y += weights.x * bone_row(a, 1u) + weights.y * bone_row(b, 1u);
        z += weights.x * bone_row(a, 2u) + weights.y * bone_row(b, 2u);
    }
    if g * GROUP + lane >= n {
        return;
    }
    let point = vec4(hand.point, 1.0);
    let t = pose.pose_offset + 3u * pose.joint_count;
    store(0u, p, vec3(dot(x, point), dot(y, point), dot(z, point)) + vec3(poses[t], poses[t + 1u], poses[t + 2u]));
    gaussians[ROW_SCALE * pose.table_columns + pose.table_first + p] = max(hand.scale, SMALLEST_SCALE);
    if FLAT {
        var normal = vec3(0.0);
        if NORMALS {
            // A normal turns as the cross product of two tangents does, by the cofactors of the map.
            let turned = vec3(dot(cross(y.xyz, z.xyz), hand.normal), dot(cross(z.xyz, x.xyz), hand.normal),
                              dot(cross(x.xyz, y.xyz), hand.normal));
            let squared = dot(turned, turned);
            // Zero where the map flattens the surface's neighbourhood to a line.
            normal = turned * select(0.0, inverseSqrt(squared), squared > 1e-30);
        }
        store(ROW_SCALE + 1u, p, normal);
    }
    let shown = clamp(hand.color, vec3(0.0), vec3(1.0));
    if LIT {
        color[p] = shown.x;
        color[n + p] = shown.y;
        color[2u * n + p] = shown.z;
    } else {
        store(ROW_COLOR, p, shown);
    }
}

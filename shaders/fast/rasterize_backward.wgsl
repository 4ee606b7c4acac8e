// As rasterize_backward.wgsl, for the fast tier: eight neighbours of a subgroup share a tile, each with 4x2 of its
// pixels. Each loads one of eight entries, and they add up an entry's gradients with shuffles, so that a slot has one
// place.

import package::shared::blend_backward::{
    ROWS, Row, SLOT_OPACITY, Sums, entries, last_end, load_row, row_sum, slot_gaussians, splats, tile_ranges, unblend
};
import package::shared::camera::{TILE_SIZE, view};
import package::shared::dispatch::flat_index;
import package::shared::splat::Splat;

// By slot, where its mark is set: mean x, mean y, red, green, blue, covariance xx, xy, yy.
@group(0) @binding(7) var<storage, read_write> slot_gradients: array<f32>;
// By slot: 1 where there is a gradient, and, if requested, the bits of the opacity times its gradient. Cleared
// beforehand.
@group(0) @binding(8) var<storage, read_write> slot_marks: array<u32>;

const LANES: u32 = 8u;

struct Loaded {
    slot: u32,
    splat: Splat,
}

// The entry that a lane of the subgroup has loaded.
fn loaded_by(mine: Loaded, lane: u32) -> Loaded {
    var loaded = Loaded();
    loaded.slot = subgroupShuffle(mine.slot, lane);
    loaded.splat.mean = subgroupShuffle(mine.splat.mean, lane);
    loaded.splat.opacity = subgroupShuffle(mine.splat.opacity, lane);
    loaded.splat.conic = subgroupShuffle(mine.splat.conic, lane);
    loaded.splat.color = subgroupShuffle(mine.splat.color, lane);
    return loaded;
}

// Sums eight numbers over eight lanes: each lane gets the sum of the number with its own index. Exchanging halves
// instead of repeating sums takes seven shuffles instead of 24.
fn sum_of_eight(first: vec4<f32>, second: vec4<f32>, member: u32) -> f32 {
    let upper = (member & 4u) != 0u;
    let four = select(first, second, upper) + subgroupShuffleXor(select(second, first, upper), 4u);
    let right = (member & 2u) != 0u;
    let two = select(four.xy, four.zw, right) + subgroupShuffleXor(select(four.zw, four.xy, right), 2u);
    let odd = (member & 1u) != 0u;
    return select(two.x, two.y, odd) + subgroupShuffleXor(select(two.y, two.x, odd), 1u);
}

// Sums a number over eight lanes.
fn sum_over_lanes(value: f32) -> f32 {
    let two = value + subgroupShuffleXor(value, 1u);
    let four = two + subgroupShuffleXor(two, 2u);
    return four + subgroupShuffleXor(four, 4u);
}

fn max_over_lanes(value: u32) -> u32 {
    let two = max(value, subgroupShuffleXor(value, 1u));
    let four = max(two, subgroupShuffleXor(two, 2u));
    return max(four, subgroupShuffleXor(four, 4u));
}

// Removes entry i, counted from 1, from the pixels and stores its gradient; 0 is none. This lane has loaded the entry.
fn take_off(rows: ptr<function, array<Row, ROWS>>, x: vec4<f32>, y: f32, i: u32, mine: Loaded, lane: u32, member: u32) {
    let loaded = loaded_by(mine, lane);
    let splat = loaded.splat;
    let dx = splat.mean.x - x;
    var sums = Sums();
    unblend(rows, 0u, &sums, i - 1u, splat, dx, splat.mean.y - y);
    unblend(rows, 1u, &sums, i - 1u, splat, dx, splat.mean.y - (y + 1.0));
    if subgroupAny(sums.touched) {
        let sum = sum_of_eight(
            vec4(row_sum(sums.mean_x), row_sum(sums.mean_y), row_sum(sums.red), row_sum(sums.green)),
            vec4(row_sum(sums.blue), row_sum(sums.xx), row_sum(sums.xy), row_sum(sums.yy)), member);
        var power = 0.0;
        if SLOT_OPACITY {
            power = sum_over_lanes(row_sum(sums.power));
        }
        if i > 0u {
            slot_gradients[loaded.slot * LANES + member] = sum;
            if member == 0u {
                if SLOT_OPACITY {
                    slot_marks[2u * loaded.slot] = 1u;
                    slot_marks[2u * loaded.slot + 1u] = bitcast<u32>(power);
                } else {
                    slot_marks[loaded.slot] = 1u;
                }
            }
        }
    }
}

@compute @workgroup_size(32)
fn rasterize_backward(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                      @builtin(subgroup_id) subgroup: u32, @builtin(subgroup_size) lanes: u32,
                      @builtin(subgroup_invocation_id) lane: u32) {
    let index = flat_index(group, groups, subgroup * lanes + lane, 32u);
    let tile = index / LANES;
    let member = lane & (LANES - 1u);
    let first_lane = lane - member;
    let corner =
        vec2(tile % view.tiles.x, tile / view.tiles.x) * TILE_SIZE + vec2((member & 1u) * 4u, (member >> 1u) * 2u);
    let x = vec4<f32>(vec4(corner.x) + vec4(0u, 1u, 2u, 3u)) + 0.5;
    let y = f32(view.first_row + corner.y) + 0.5;
    var rows: array<Row, ROWS>;
    var start = 0u;
    var i = 0u;
    if tile < view.tiles.x * view.tiles.y {
        rows[0] = load_row(corner);
        rows[1] = load_row(corner + vec2(0u, 1u));
        start = tile_ranges[tile].x;
        i = max(start, max(last_end(rows[0]), last_end(rows[1])));
    }
    // Remaining entries, the last first. All lanes continue until all are done: each loads for its neighbours.
    var left = max_over_lanes(i - start);
    while subgroupAny(left > 0u) {
        var mine = Loaded();
        if member < left {
            let slot = entries[start + left - 1u - member];
            mine = Loaded(slot, splats[slot_gaussians[slot]]);
        }
        let last = start + left;
        // Unrolled: software rasterisers limit the iterations of loops.
        take_off(&rows, x, y, select(0u, last, left > 0u), mine, first_lane, member);
        take_off(&rows, x, y, select(0u, last - 1u, left > 1u), mine, first_lane + 1u, member);
        take_off(&rows, x, y, select(0u, last - 2u, left > 2u), mine, first_lane + 2u, member);
        take_off(&rows, x, y, select(0u, last - 3u, left > 3u), mine, first_lane + 3u, member);
        take_off(&rows, x, y, select(0u, last - 4u, left > 4u), mine, first_lane + 4u, member);
        take_off(&rows, x, y, select(0u, last - 5u, left > 5u), mine, first_lane + 5u, member);
        take_off(&rows, x, y, select(0u, last - 6u, left > 6u), mine, first_lane + 6u, member);
        take_off(&rows, x, y, select(0u, last - 7u, left > 7u), mine, first_lane + 7u, member);
        left -= min(left, LANES);
    }
}

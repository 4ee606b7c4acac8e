// Gradients of the splats from the gradient of the image. An invocation owns a 4x4 cell of pixels and walks its tile's
// entries back to front; the sum for an entry is written only to that (slot, cell), so that there are no races and the
// later sum over slots and cells has a fixed order.

import package::shared::blend_backward::{
    ROWS, Row, SLOT_OPACITY, Sums, entries, last_end, load_row, row_sum, splats, tile_ranges, unblend
};
import package::shared::camera::{TILE_SIZE, view};
import package::shared::dispatch::flat_index;
import package::shared::splat::slot_of;

// By cell of a slot, where its mark is set: (mean x, mean y, red, green) and (blue, covariance xx, xy, yy).
@group(0) @binding(6) var<storage, read_write> slot_gradients: array<vec4<f32>>;
// By cell of a slot: 1 where there is a gradient, and, if requested, the bits of the opacity times its gradient.
// Cleared beforehand.
@group(0) @binding(7) var<storage, read_write> slot_marks: array<u32>;

const CELLS: u32 = 4u;

@compute @workgroup_size(32)
fn rasterize_backward(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
                      @builtin(local_invocation_index) local: u32) {
    let index = flat_index(group, groups, local, 32u);
    let tile = index / CELLS;
    let cell = index % CELLS;
    if tile >= view.tiles.x * view.tiles.y {
        return;
    }
    let range = tile_ranges[tile];
    if range.x >= range.y {
        return;
    }
    let tile_place = vec2(tile % view.tiles.x, tile / view.tiles.x);
    let corner = tile_place * TILE_SIZE + vec2(cell & 1u, cell >> 1u) * 4u;
    let x = vec4<f32>(vec4(corner.x) + vec4(0u, 1u, 2u, 3u)) + 0.5;
    var rows: array<Row, ROWS>;
    var last = range.x;
    for (var r = 0u; r < ROWS; r++) {
        rows[r] = load_row(corner + vec2(0u, r));
        last = max(last, last_end(rows[r]));
    }
    for (var i = last; i > range.x;) {
        i--;
        let splat = splats[entries[i]];
        let dx = splat.mean.x - x;
        var sums = Sums();
        for (var r = 0u; r < ROWS; r++) {
            unblend(&rows, r, &sums, i, splat, dx, splat.mean.y - (f32(view.first_row + corner.y + r) + 0.5));
        }
        if sums.touched {
            let at = slot_of(splat, tile_place) * CELLS + cell;
            slot_gradients[2u * at] =
                vec4(row_sum(sums.mean_x), row_sum(sums.mean_y), row_sum(sums.red), row_sum(sums.green));
            slot_gradients[2u * at + 1u] =
                vec4(row_sum(sums.blue), row_sum(sums.xx), row_sum(sums.xy), row_sum(sums.yy));
            if SLOT_OPACITY {
                slot_marks[2u * at] = 1u;
                slot_marks[2u * at + 1u] = bitcast<u32>(row_sum(sums.power));
            } else {
                slot_marks[at] = 1u;
            }
        }
    }
}

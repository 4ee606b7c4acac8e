// One pass of a stable radix sort of (key, value) pairs. The array is cut into contiguous strands, one invocation each:
// a strand counts its digits, the counts (digit-major) are scanned, and the strand then places its pairs in order.
// Stable by construction, without atomics or workgroup memory.

import package::shared::sort_buffers::{counters, digit_counts, keys_in, keys_out, sort, value_of, values_out};

fn strand_range(strand: u32) -> vec2<u32> {
    let count = counters[sort.counter];
    let length = (count + sort.strands - 1u) / sort.strands;
    let start = min(strand * length, count);
    return vec2(start, min(start + length, count));
}

@compute @workgroup_size(8)
fn sort_count(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= sort.strands {
        return;
    }
    for (var digit = 0u; digit <= sort.mask; digit++) {
        digit_counts[digit * sort.strands + id.x] = 0u;
    }
    let range = strand_range(id.x);
    for (var i = range.x; i < range.y; i++) {
        let digit = (keys_in[i] >> sort.shift) & sort.mask;
        digit_counts[digit * sort.strands + id.x] += 1u;
    }
}

@compute @workgroup_size(8)
fn sort_scatter(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= sort.strands {
        return;
    }
    let range = strand_range(id.x);
    for (var i = range.x; i < range.y; i++) {
        let key = keys_in[i];
        let at = ((key >> sort.shift) & sort.mask) * sort.strands + id.x;
        let place = digit_counts[at];
        digit_counts[at] = place + 1u;
        keys_out[place] = key;
        values_out[place] = value_of(i);
    }
}

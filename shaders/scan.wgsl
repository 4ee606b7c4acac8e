// Exclusive prefix sum over an array, in three passes over STRANDS contiguous pieces. One invocation sums each piece in
// order, so that nothing depends on scheduling and no workgroup memory is needed.

import package::shared::scan_buffers::{scan, strand_sums, totals, values};

const STRANDS: u32 = 1024u;

fn strand_length() -> u32 {
    return (scan.length + STRANDS - 1u) / STRANDS;
}

@compute @workgroup_size(64)
fn scan_sums(@builtin(global_invocation_id) id: vec3<u32>) {
    let start = min(id.x * strand_length(), scan.length);
    let end = min(start + strand_length(), scan.length);
    var sum = 0u;
    for (var i = start; i < end; i++) {
        sum += values[i];
    }
    strand_sums[id.x] = sum;
}

@compute @workgroup_size(1)
fn scan_strands() {
    var sum = 0u;
    for (var s = 0u; s < STRANDS; s++) {
        let here = strand_sums[s];
        strand_sums[s] = sum;
        sum += here;
    }
    totals[scan.total_index] = sum;
}

@compute @workgroup_size(64)
fn scan_apply(@builtin(global_invocation_id) id: vec3<u32>) {
    let start = min(id.x * strand_length(), scan.length);
    let end = min(start + strand_length(), scan.length);
    var sum = strand_sums[id.x];
    for (var i = start; i < end; i++) {
        let here = values[i];
        values[i] = sum;
        sum += here;
    }
}

// Exclusive prefix sum over an array, in three passes over blocks of consecutive values, for devices that run thousands
// of invocations at once. The sums are of integers: the result is that of `scan.wgsl`, bit for bit.

struct ScanUniforms {
    length: u32,
    // Where the grand total goes in `totals`.
    total_index: u32,
    padding: vec2<u32>,
}

const THREADS: u32 = 256u;
const SHARE: u32 = 8u;
const BLOCK: u32 = THREADS * SHARE;
// Subgroups have four invocations or more.
const MOST_SUBGROUPS: u32 = THREADS / 4u;

@group(0) @binding(0) var<uniform> scan: ScanUniforms;
@group(0) @binding(1) var<storage, read_write> values: array<u32>;
@group(0) @binding(2) var<storage, read_write> strand_sums: array<u32>;
@group(0) @binding(3) var<storage, read_write> totals: array<u32>;

var<workgroup> subgroup_totals: array<u32, MOST_SUBGROUPS>;

// Place of an invocation in its workgroup.
struct Place {
    subgroup: u32,
    subgroups: u32,
    lane: u32,
    thread: u32,
}

// The sum of `value` over the invocations before this one, and over all. Every invocation must call it.
fn workgroup_scan(value: u32, place: Place) -> vec2<u32> {
    var before = subgroupExclusiveAdd(value);
    let total = subgroupAdd(value);
    if place.lane == 0u {
        subgroup_totals[place.subgroup] = total;
    }
    workgroupBarrier();
    var all = 0u;
    for (var s = 0u; s < place.subgroups; s++) {
        let of_subgroup = subgroup_totals[s];
        if s < place.subgroup {
            before += of_subgroup;
        }
        all += of_subgroup;
    }
    // The next call may overwrite the totals.
    workgroupBarrier();
    return vec2(before, all);
}

// The sum of an invocation's consecutive values.
fn share_sum(block: u32, thread: u32) -> u32 {
    var sum = 0u;
    for (var k = 0u; k < SHARE; k++) {
        let i = block * BLOCK + thread * SHARE + k;
        if i < scan.length {
            sum += values[i];
        }
    }
    return sum;
}

@compute @workgroup_size(256)
fn scan_sums(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
             @builtin(subgroup_id) subgroup: u32, @builtin(num_subgroups) subgroups: u32,
             @builtin(subgroup_size) lanes: u32, @builtin(subgroup_invocation_id) lane: u32) {
    let block = group.x + group.y * groups.x;
    if block * BLOCK >= scan.length {
        return;
    }
    let place = Place(subgroup, subgroups, lane, subgroup * lanes + lane);
    let sums = workgroup_scan(share_sum(block, place.thread), place);
    if place.thread == 0u {
        strand_sums[block] = sums.y;
    }
}

// One workgroup scans the blocks' sums.
@compute @workgroup_size(256)
fn scan_strands(@builtin(subgroup_id) subgroup: u32, @builtin(num_subgroups) subgroups: u32,
                @builtin(subgroup_size) lanes: u32, @builtin(subgroup_invocation_id) lane: u32) {
    let place = Place(subgroup, subgroups, lane, subgroup * lanes + lane);
    let blocks = (scan.length + BLOCK - 1u) / BLOCK;
    var carry = 0u;
    for (var start = 0u; start < blocks; start += THREADS) {
        let i = start + place.thread;
        var value = 0u;
        if i < blocks {
            value = strand_sums[i];
        }
        let sums = workgroup_scan(value, place);
        if i < blocks {
            strand_sums[i] = carry + sums.x;
        }
        carry += sums.y;
    }
    if place.thread == 0u {
        totals[scan.total_index] = carry;
    }
}

@compute @workgroup_size(256)
fn scan_apply(@builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
              @builtin(subgroup_id) subgroup: u32, @builtin(num_subgroups) subgroups: u32,
              @builtin(subgroup_size) lanes: u32, @builtin(subgroup_invocation_id) lane: u32) {
    let block = group.x + group.y * groups.x;
    if block * BLOCK >= scan.length {
        return;
    }
    let place = Place(subgroup, subgroups, lane, subgroup * lanes + lane);
    var sum = strand_sums[block] + workgroup_scan(share_sum(block, place.thread), place).x;
    for (var k = 0u; k < SHARE; k++) {
        let i = block * BLOCK + place.thread * SHARE + k;
        if i < scan.length {
            let here = values[i];
            values[i] = sum;
            sum += here;
        }
    }
}

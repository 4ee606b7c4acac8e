// Exclusive prefix sum over an array, in three passes over blocks of consecutive values, for devices that run thousands
// of invocations at once. The sums are of integers: the result is that of `scan.wgsl`, bit for bit.

import package::shared::block::{Block, thread_of};
import package::shared::scan_buffers::{scan, strand_sums, totals, values};

const THREADS: u32 = 256u;
const SHARE: u32 = 8u;
const BLOCK: u32 = THREADS * SHARE;
// Subgroups have four invocations or more.
@if(subgroups) const PARTS: u32 = THREADS / 4u;
@if(!subgroups) const PARTS: u32 = THREADS;

// Totals of the subgroups; without them, running sums of the invocations.
var<workgroup> parts: array<u32, PARTS>;

// The sum of `value` over the invocations before this one, and over all. Every invocation must call it.
@if(subgroups)
fn workgroup_scan(value: u32, it: Block) -> vec2<u32> {
    var before = subgroupExclusiveAdd(value);
    let total = subgroupAdd(value);
    if it.lane == 0u {
        parts[it.subgroup] = total;
    }
    workgroupBarrier();
    var all = 0u;
    for (var s = 0u; s < it.subgroups; s++) {
        let of_subgroup = parts[s];
        if s < it.subgroup {
            before += of_subgroup;
        }
        all += of_subgroup;
    }
    // The next call may overwrite the totals.
    workgroupBarrier();
    return vec2(before, all);
}

@if(!subgroups)
fn workgroup_scan(value: u32, it: Block) -> vec2<u32> {
    let thread = it.index;
    var running = value;
    for (var step = 1u; step < THREADS; step *= 2u) {
        parts[thread] = running;
        workgroupBarrier();
        if thread >= step {
            running += parts[thread - step];
        }
        workgroupBarrier();
    }
    parts[thread] = running;
    workgroupBarrier();
    let all = parts[THREADS - 1u];
    // The next call may overwrite the sums.
    workgroupBarrier();
    return vec2(running - value, all);
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

@compute @workgroup_size(THREADS)
fn scan_sums(it: Block) {
    let block = it.group.x + it.group.y * it.groups.x;
    if block * BLOCK >= scan.length {
        return;
    }
    let thread = thread_of(it);
    let sums = workgroup_scan(share_sum(block, thread), it);
    if thread == 0u {
        strand_sums[block] = sums.y;
    }
}

// One workgroup scans the blocks' sums.
@compute @workgroup_size(THREADS)
fn scan_strands(it: Block) {
    let thread = thread_of(it);
    let blocks = (scan.length + BLOCK - 1u) / BLOCK;
    var carry = 0u;
    for (var start = 0u; start < blocks; start += THREADS) {
        let i = start + thread;
        var value = 0u;
        if i < blocks {
            value = strand_sums[i];
        }
        let sums = workgroup_scan(value, it);
        if i < blocks {
            strand_sums[i] = carry + sums.x;
        }
        carry += sums.y;
    }
    if thread == 0u {
        totals[scan.total_index] = carry;
    }
}

@compute @workgroup_size(THREADS)
fn scan_apply(it: Block) {
    let block = it.group.x + it.group.y * it.groups.x;
    if block * BLOCK >= scan.length {
        return;
    }
    let thread = thread_of(it);
    var sum = strand_sums[block] + workgroup_scan(share_sum(block, thread), it).x;
    for (var k = 0u; k < SHARE; k++) {
        let i = block * BLOCK + thread * SHARE + k;
        if i < scan.length {
            let here = values[i];
            values[i] = sum;
            sum += here;
        }
    }
}

// One pass of a stable radix sort of (key, value) pairs, for devices that run thousands of invocations at once. The
// array is divided into blocks of consecutive pairs, one workgroup each: a block counts its digits, the counts
// (digit-major) are scanned, and the block then orders its pairs in workgroup memory and writes them out, neighbours
// together. The order of a stable sort is unique: the result is that of `sort.wgsl`, bit for bit. With subgroups, these
// add up the counts of their invocations; without, workgroup memory does, of which every device has room for less.

import package::shared::block::{Block, thread_of};
import package::shared::sort_buffers::{counters, digit_counts, keys_in, keys_out, sort, value_of, values_out};

@if(subgroups) const THREADS: u32 = 256u;
@if(!subgroups) const THREADS: u32 = 128u;
const PAIRS: u32 = 8u;
const BLOCK: u32 = THREADS * PAIRS;
const DIGITS: u32 = 16u;
// Subgroups have four invocations or more.
@if(subgroups) const PARTS: u32 = THREADS / 4u;
@if(!subgroups) const PARTS: u32 = THREADS;

// How often each of the sixteen digits occurs: two per word, 0 to 7 in `low`, 8 to 15 in `high`. A block has fewer than
// 2^16.
struct Counts {
    low: vec4<u32>,
    high: vec4<u32>,
}

// Totals of the subgroups; without them, running sums of the invocations.
var<workgroup> parts: array<Counts, PARTS>;
var<workgroup> digit_starts: array<u32, DIGITS>;
var<workgroup> block_keys: array<u32, BLOCK>;
var<workgroup> block_values: array<u32, BLOCK>;

fn once(digit: u32) -> Counts {
    let value = vec4(1u << ((digit & 1u) * 16u));
    let words = vec4(0u, 1u, 2u, 3u);
    let word = digit >> 1u;
    return Counts(select(vec4(0u), value, words == vec4(word)), select(vec4(0u), value, words + 4u == vec4(word)));
}

fn sum(a: Counts, b: Counts) -> Counts {
    return Counts(a.low + b.low, a.high + b.high);
}

fn count_of(counts: Counts, digit: u32) -> u32 {
    let word = digit >> 1u;
    let half = select(counts.high, counts.low, word < 4u);
    return (half[word & 3u] >> ((digit & 1u) * 16u)) & 0xffffu;
}

fn digit_of(key: u32) -> u32 {
    return (key >> sort.shift) & sort.mask;
}

// The pairs of a block: the index of the first and their number.
fn block_range(block: u32) -> vec2<u32> {
    let count = counters[sort.counter];
    let start = min(block * BLOCK, count);
    return vec2(start, min(BLOCK, count - start));
}

struct BeforeAndAll {
    before: Counts,
    all: Counts,
}

// The sum of `mine` over the invocations before this one, and over all. Every invocation must call it, once.
@if(subgroups)
fn scan_counts(mine: Counts, it: Block) -> BeforeAndAll {
    var before = Counts(subgroupExclusiveAdd(mine.low), subgroupExclusiveAdd(mine.high));
    let total = Counts(subgroupAdd(mine.low), subgroupAdd(mine.high));
    if it.lane == 0u {
        parts[it.subgroup] = total;
    }
    workgroupBarrier();
    var all = Counts();
    for (var s = 0u; s < it.subgroups; s++) {
        if s == it.subgroup {
            before = sum(before, all);
        }
        all = sum(all, parts[s]);
    }
    return BeforeAndAll(before, all);
}

@if(!subgroups)
fn scan_counts(mine: Counts, it: Block) -> BeforeAndAll {
    let thread = it.index;
    var running = mine;
    for (var step = 1u; step < THREADS; step *= 2u) {
        parts[thread] = running;
        workgroupBarrier();
        if thread >= step {
            running = sum(running, parts[thread - step]);
        }
        workgroupBarrier();
    }
    parts[thread] = running;
    workgroupBarrier();
    return BeforeAndAll(Counts(running.low - mine.low, running.high - mine.high), parts[THREADS - 1u]);
}

@compute @workgroup_size(THREADS)
fn sort_count(it: Block) {
    let block = it.group.x + it.group.y * it.groups.x;
    if block >= sort.strands {
        return;
    }
    let range = block_range(block);
    let thread = thread_of(it);
    var mine = Counts();
    for (var k = 0u; k < PAIRS; k++) {
        // The order does not matter here: neighbouring invocations read neighbouring pairs.
        let i = thread + k * THREADS;
        if i < range.y {
            mine = sum(mine, once(digit_of(keys_in[range.x + i])));
        }
    }
    let counts = scan_counts(mine, it).all;
    if thread <= sort.mask {
        digit_counts[thread * sort.strands + block] = count_of(counts, thread);
    }
}

@compute @workgroup_size(THREADS)
fn sort_scatter(it: Block) {
    let block = it.group.x + it.group.y * it.groups.x;
    if block >= sort.strands {
        return;
    }
    let range = block_range(block);
    let thread = thread_of(it);
    // Each invocation has consecutive pairs, so that invocations and pairs are in the same order.
    var keys: array<u32, PAIRS>;
    var ranks: array<u32, PAIRS>;
    var mine = Counts();
    for (var k = 0u; k < PAIRS; k++) {
        let i = thread * PAIRS + k;
        if i < range.y {
            keys[k] = keys_in[range.x + i];
            let digit = digit_of(keys[k]);
            ranks[k] = count_of(mine, digit);
            mine = sum(mine, once(digit));
        }
    }
    let counts = scan_counts(mine, it);
    if thread < DIGITS {
        var start = 0u;
        for (var digit = 0u; digit < thread; digit++) {
            start += count_of(counts.all, digit);
        }
        digit_starts[thread] = start;
    }
    workgroupBarrier();
    for (var k = 0u; k < PAIRS; k++) {
        let i = thread * PAIRS + k;
        if i < range.y {
            let digit = digit_of(keys[k]);
            let rank = digit_starts[digit] + count_of(counts.before, digit) + ranks[k];
            block_keys[rank] = keys[k];
            block_values[rank] = value_of(range.x + i);
        }
    }
    workgroupBarrier();
    for (var k = 0u; k < PAIRS; k++) {
        let rank = thread + k * THREADS;
        if rank < range.y {
            let key = block_keys[rank];
            let digit = digit_of(key);
            let place = digit_counts[digit * sort.strands + block] + rank - digit_starts[digit];
            keys_out[place] = key;
            values_out[place] = block_values[rank];
        }
    }
}

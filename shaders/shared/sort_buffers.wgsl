// Uniforms and buffers of a pass of the radix sort.

struct SortUniforms {
    // The digit is (key >> shift) & mask. By blocks, the mask has at most four bits.
    shift: u32,
    mask: u32,
    // Number of strands or blocks that the keys are divided into.
    strands: u32,
    // Index of the counter that holds the number of pairs.
    counter: u32,
    // Whether the value of a pair is its number, and none is read.
    numbered: u32,
    padding_1: u32,
    padding_2: u32,
    padding_3: u32,
}

@group(0) @binding(0) var<uniform> sort: SortUniforms;
@group(0) @binding(1) var<storage, read> counters: array<u32>;
@group(0) @binding(2) var<storage, read> keys_in: array<u32>;
@group(0) @binding(3) var<storage, read> values_in: array<u32>;
@group(0) @binding(4) var<storage, read_write> digit_counts: array<u32>;
@group(0) @binding(5) var<storage, read_write> keys_out: array<u32>;
@group(0) @binding(6) var<storage, read_write> values_out: array<u32>;

fn value_of(i: u32) -> u32 {
    if sort.numbered != 0u {
        return i;
    }
    return values_in[i];
}

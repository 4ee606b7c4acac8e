// Uniforms and buffers of a prefix sum.

struct ScanUniforms {
    length: u32,
    // Where the grand total goes in `totals`.
    total_index: u32,
    padding: vec2<u32>,
}

@group(0) @binding(0) var<uniform> scan: ScanUniforms;
@group(0) @binding(1) var<storage, read_write> values: array<u32>;
@group(0) @binding(2) var<storage, read_write> strand_sums: array<u32>;
@group(0) @binding(3) var<storage, read_write> totals: array<u32>;

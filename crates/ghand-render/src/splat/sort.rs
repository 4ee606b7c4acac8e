//! Host part of `sort.wgsl` and `scan.wgsl`: a stable radix sort whose length only the GPU knows.

use bytemuck::{Pod, Zeroable};

use crate::pipeline::{Bound, Module, Stage};
use crate::{Gpu, buffers, shader_sources};

/// Strands of a prefix sum, as in `scan.wgsl`.
const SCAN_STRANDS: u32 = 1024;
/// Most pairs of a strand: half of what the loops of software rasterisers go through.
const MOST_PAIRS: u64 = 32_768;

/// See `shaders/shared/scan.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct ScanUniforms {
    /// How many values.
    pub length: u32,
    /// Where in the totals the sum of all goes.
    pub total_index: u32,
    /// Unused.
    pub padding: [u32; 2],
}

/// See `shaders/sort.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct SortUniforms {
    /// First bit of the digit.
    pub shift: u32,
    /// Largest digit.
    pub mask: u32,
    /// Into how many runs the keys are cut.
    pub strands: u32,
    /// Which counter holds the number of keys.
    pub counter: u32,
}

pub struct Pipelines {
    sort_count: Stage,
    sort_scatter: Stage,
    scan_sums: Stage,
    scan_strands: Stage,
    scan_apply: Stage,
    strands: u32,
}

impl Pipelines {
    pub fn new(gpu: &Gpu) -> Pipelines {
        let sort = Module::new(gpu, "sort", &shader_sources::sort());
        let scan = Module::new(gpu, "scan", &shader_sources::scan());
        Pipelines {
            sort_count: sort.stage(gpu, "sort_count", &[]),
            sort_scatter: sort.stage(gpu, "sort_scatter", &[]),
            scan_sums: scan.stage(gpu, "scan_sums", &[]),
            scan_strands: scan.stage(gpu, "scan_strands", &[]),
            scan_apply: scan.stage(gpu, "scan_apply", &[]),
            // Enough strands to fill the machine, few enough that counting digits stays cheap beside moving pairs.
            strands: if gpu.is_cpu() { 128 } else { 4096 },
        }
    }

    /// An exclusive prefix sum of the first `length` words of `values`; the total goes to `totals[total_index]`.
    pub fn scan(&self, gpu: &Gpu, values: &wgpu::Buffer, length: u32, totals: &wgpu::Buffer, total_index: u32) -> Scan {
        let uniforms = buffers::uniform(gpu, "scan", &ScanUniforms { length, total_index, padding: [0; 2] });
        let sums = buffers::zeroed(gpu, "strand sums", SCAN_STRANDS as usize);
        let piece = [(0, &uniforms), (1, values), (2, &sums)];
        Scan {
            sums: self.scan_sums.bind(gpu, &piece),
            strands: self.scan_strands.bind(gpu, &[(0, &uniforms), (2, &sums), (3, totals)]),
            apply: self.scan_apply.bind(gpu, &piece),
        }
    }
}

/// A prefix sum, bound.
pub struct Scan {
    sums: Bound,
    strands: Bound,
    apply: Bound,
}

impl Scan {
    pub fn encode(&self, pass: &mut wgpu::ComputePass<'_>) {
        self.sums.dispatch(pass, SCAN_STRANDS / 64);
        self.strands.dispatch(pass, 1);
        self.apply.dispatch(pass, SCAN_STRANDS / 64);
    }
}

struct Pass {
    count: Bound,
    scan: Scan,
    scatter: Bound,
}

/// A sort of key and value buffers by the lowest `bits` of the keys, bound.
pub struct Stages {
    passes: Vec<Pass>,
    strands: u32,
}

impl Stages {
    /// Sorts as many pairs as `counters[counter]` says. The pairs start in the first of each two buffers and end in the
    /// one that [`Stages::sorted`] names.
    pub fn new(
        gpu: &Gpu,
        pipelines: &Pipelines,
        counters: &wgpu::Buffer,
        counter: u32,
        bits: u32,
        keys: &[wgpu::Buffer; 2],
        values: &[wgpu::Buffer; 2],
    ) -> Stages {
        let count = bits.div_ceil(8);
        let digit_bits = bits.div_ceil(count);
        // A strand takes a round of a loop for each pair, and software rasterisers end loops after 65,535.
        let pairs = keys[0].size() / 4;
        let strands = pipelines.strands.max(u32::try_from(pairs.div_ceil(MOST_PAIRS)).unwrap_or(u32::MAX));
        let digits = buffers::zeroed(gpu, "digit counts", (strands as usize) << digit_bits);
        let total = buffers::zeroed(gpu, "digit total", 1);
        let passes = (0..count)
            .map(|i| {
                let uniforms = SortUniforms { shift: i * digit_bits, mask: (1 << digit_bits) - 1, strands, counter };
                let uniforms = buffers::uniform(gpu, "sort", &uniforms);
                let (from, to) = ((i % 2) as usize, ((i + 1) % 2) as usize);
                Pass {
                    count: pipelines
                        .sort_count
                        .bind(gpu, &[(0, &uniforms), (1, counters), (2, &keys[from]), (4, &digits)]),
                    scan: pipelines.scan(gpu, &digits, strands << digit_bits, &total, 0),
                    scatter: pipelines.sort_scatter.bind(
                        gpu,
                        &[
                            (0, &uniforms),
                            (1, counters),
                            (2, &keys[from]),
                            (3, &values[from]),
                            (4, &digits),
                            (5, &keys[to]),
                            (6, &values[to]),
                        ],
                    ),
                }
            })
            .collect();
        Stages { passes, strands }
    }

    /// Which of the two buffers holds the sorted pairs.
    pub fn sorted(&self) -> usize {
        self.passes.len() % 2
    }

    pub fn encode(&self, pass: &mut wgpu::ComputePass<'_>) {
        for p in &self.passes {
            p.count.dispatch(pass, self.strands.div_ceil(16));
            p.scan.encode(pass);
            p.scatter.dispatch(pass, self.strands.div_ceil(16));
        }
    }
}

//! Host part of `sort.wgsl` and `scan.wgsl`, and of `sort_by_blocks.wgsl` and `scan_by_blocks.wgsl` on tiers for graphics
//! processors: a stable radix sort whose length only the GPU knows.

use bytemuck::{Pod, Zeroable};

use super::counters::CounterIndex;
use crate::pipeline::{Bound, Module, Stage};
use crate::stages::{
    ScanApply, ScanApplyBindings, ScanStrands, ScanStrandsBindings, ScanSums, ScanSumsBindings, SortCount,
    SortCountBindings, SortScatter, SortScatterBindings,
};
use crate::{Gpu, Tier, buffers};

/// Number of strands of a prefix sum, as in `scan.wgsl`.
const SCAN_STRANDS: u32 = 1024;
/// Number of values in a block of a prefix sum, as in `scan_by_blocks.wgsl`.
const SCAN_BLOCK: u32 = 2048;
/// Number of pairs in a block of the sort, as in `sort_by_blocks.wgsl` without and with subgroups.
const SORT_BLOCKS: [u32; 2] = [1024, 2048];
/// Maximum number of pairs in a strand: half of the iterations that software rasterisers allow in a loop.
const MOST_PAIRS: u64 = 32_768;

/// See `shaders/shared/scan_buffers.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct ScanUniforms {
    /// Number of values.
    pub length: u32,
    /// Index in the totals where the total is written.
    pub total_index: u32,
    /// Unused.
    pub padding: [u32; 2],
}

/// See `shaders/shared/sort_buffers.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct SortUniforms {
    /// First bit of the digit.
    pub shift: u32,
    /// Largest digit.
    pub mask: u32,
    /// Number of strands into which the keys are divided.
    pub strands: u32,
    /// Index of the counter that holds the number of keys.
    pub counter: u32,
    /// 1 if the value of a pair is its number, 0 if it is read.
    pub numbered: u32,
    /// Unused.
    pub padding_1: u32,
    /// Unused.
    pub padding_2: u32,
    /// Unused.
    pub padding_3: u32,
}

/// Constants shared with the shaders: stage, name, value.
pub const SHARED_CONSTANTS: [(&str, &str, u32); 5] = [
    ("scan", "STRANDS", SCAN_STRANDS),
    ("scan_by_blocks", "BLOCK", SCAN_BLOCK),
    ("subgroups/scan_by_blocks", "BLOCK", SCAN_BLOCK),
    ("sort_by_blocks", "BLOCK", SORT_BLOCKS[0]),
    ("subgroups/sort_by_blocks", "BLOCK", SORT_BLOCKS[1]),
];

/// The only word of a buffer for a total that nobody needs.
pub const FIRST_WORD: CounterIndex = CounterIndex(0);

pub struct Pipelines {
    sort_count: Stage<SortCount>,
    sort_scatter: Stage<SortScatter>,
    scan_sums: Stage<ScanSums>,
    scan_strands: Stage<ScanStrands>,
    scan_apply: Stage<ScanApply>,
    /// Pairs in a block of the sort, unless it is by strands.
    block: Option<u32>,
}

impl Pipelines {
    pub fn new(gpu: &Gpu) -> Pipelines {
        // A software rasteriser runs a workgroup's invocations in turn: barriers cost more than they save.
        let (sort, scan) = match gpu.tier {
            Tier::Cpu | Tier::CpuSubgroups => ("sort", "scan"),
            Tier::Gpu => ("sort_by_blocks", "scan_by_blocks"),
            Tier::GpuSubgroups => ("subgroups/sort_by_blocks", "subgroups/scan_by_blocks"),
        };
        let sort = Module::new(gpu, sort);
        let scan = Module::new(gpu, scan);
        let [portable, subgroups] = SORT_BLOCKS;
        Pipelines {
            sort_count: sort.stage(gpu, &[]),
            sort_scatter: sort.stage(gpu, &[]),
            scan_sums: scan.stage(gpu, &[]),
            scan_strands: scan.stage(gpu, &[]),
            scan_apply: scan.stage(gpu, &[]),
            block: (!gpu.tier.has_strands()).then(|| gpu.tier.choose(portable, subgroups)),
        }
    }

    /// Maximum number of bits in a digit.
    fn digit_bits(&self) -> u32 {
        // By blocks, the number of digits in `sort_by_blocks.wgsl`. On a software rasteriser counting digits is cheap
        // compared with moving pairs, so few passes are best.
        if self.block.is_some() { 4 } else { 13 }
    }

    /// Number of separately sorted pieces into which `pairs` pairs are divided.
    pub(super) fn pieces(&self, pairs: u64) -> u32 {
        let enough_for_all_cores = || std::thread::available_parallelism().map_or(8, |n| n.get() as u64) * 16;
        let pieces = match self.block {
            Some(block) => pairs.div_ceil(block.into()).max(1),
            // A strand needs one loop iteration per pair.
            None => pairs.div_ceil(MOST_PAIRS).max(enough_for_all_cores().clamp(32, 128)),
        };
        u32::try_from(pieces).unwrap_or(u32::MAX)
    }

    /// An exclusive prefix sum of the first `length` words of `values`; the total is written to word `total` of
    /// `totals`.
    pub fn scan(
        &self,
        gpu: &Gpu,
        values: &wgpu::Buffer,
        length: u32,
        totals: &wgpu::Buffer,
        total: CounterIndex,
    ) -> Scan {
        let scan = &buffers::uniform(gpu, "scan", &ScanUniforms { length, total_index: total.0, padding: [0; 2] });
        let (pieces, groups) = match self.block {
            None => (SCAN_STRANDS, self.scan_sums.groups(SCAN_STRANDS)),
            Some(_) => (length.div_ceil(SCAN_BLOCK), length.div_ceil(SCAN_BLOCK)),
        };
        let strand_sums = &buffers::zeroed(gpu, "strand sums", pieces as usize);
        Scan {
            groups,
            sums: self.scan_sums.bind(gpu, &ScanSumsBindings { scan, values, strand_sums }),
            strands: self.scan_strands.bind(gpu, &ScanStrandsBindings { scan, strand_sums, totals }),
            apply: self.scan_apply.bind(gpu, &ScanApplyBindings { scan, values, strand_sums }),
        }
    }
}

/// A prefix sum, bound.
pub struct Scan {
    groups: u32,
    sums: Bound,
    strands: Bound,
    apply: Bound,
}

impl Scan {
    pub fn encode(&self, pass: &mut wgpu::ComputePass<'_>) {
        self.sums.dispatch(pass, self.groups);
        self.strands.dispatch(pass, 1);
        self.apply.dispatch(pass, self.groups);
    }
}

struct Pass {
    count: Bound,
    scan: Scan,
    scatter: Bound,
}

/// What a sort does.
#[derive(Debug, Clone, Copy)]
pub struct Order {
    /// The counter that holds the number of pairs.
    pub counter: CounterIndex,
    /// So many of the lowest bits of the keys count.
    pub bits: u32,
    /// Whether the values are the numbers that the pairs have at first, and not what the first buffer holds.
    pub numbered: bool,
}

/// A sort of key and value buffers, bound.
pub struct Stages {
    passes: Vec<Pass>,
    groups: u32,
}

impl Stages {
    /// Sorts `counters[order.counter]` pairs. They start in the first of their two buffers and end in the one with index
    /// [`Stages::sorted`].
    pub fn new(
        gpu: &Gpu,
        pipelines: &Pipelines,
        counters: &wgpu::Buffer,
        order: Order,
        keys: &[wgpu::Buffer; 2],
        values: &[wgpu::Buffer; 2],
    ) -> Stages {
        let Order { counter, bits, numbered } = order;
        let count = bits.div_ceil(pipelines.digit_bits());
        let digit_bits = bits.div_ceil(count);
        let pieces = pipelines.pieces(keys[0].size() / 4);
        let digit_counts = &buffers::zeroed(gpu, "digit counts", (pieces as usize) << digit_bits);
        let total = buffers::zeroed(gpu, "digit total", 1);
        let passes = (0..count)
            .map(|i| {
                let uniforms = SortUniforms {
                    shift: i * digit_bits,
                    mask: (1 << digit_bits) - 1,
                    strands: pieces,
                    counter: counter.0,
                    numbered: u32::from(numbered && i == 0),
                    ..SortUniforms::zeroed()
                };
                let sort = &buffers::uniform(gpu, "sort", &uniforms);
                let (from, to) = ((i % 2) as usize, ((i + 1) % 2) as usize);
                let keys_in = &keys[from];
                Pass {
                    count: pipelines.sort_count.bind(gpu, &SortCountBindings { sort, counters, keys_in, digit_counts }),
                    scan: pipelines.scan(gpu, digit_counts, pieces << digit_bits, &total, FIRST_WORD),
                    scatter: pipelines.sort_scatter.bind(
                        gpu,
                        &SortScatterBindings {
                            sort,
                            counters,
                            keys_in,
                            values_in: &values[from],
                            digit_counts,
                            keys_out: &keys[to],
                            values_out: &values[to],
                        },
                    ),
                }
            })
            .collect();
        let groups = match pipelines.block {
            None => pipelines.sort_count.groups(pieces),
            Some(_) => pieces,
        };
        Stages { passes, groups }
    }

    /// Index (0 or 1) of the buffer with the sorted pairs.
    pub fn sorted(&self) -> usize {
        self.passes.len() % 2
    }

    pub fn encode(&self, pass: &mut wgpu::ComputePass<'_>) {
        for p in &self.passes {
            p.count.dispatch(pass, self.groups);
            p.scan.encode(pass);
            p.scatter.dispatch(pass, self.groups);
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

    use rand::{RngExt, SeedableRng};

    use super::*;
    use crate::{AdapterChoice, DeviceError, reference};

    /// The pipelines of all tiers that the adapter supports.
    fn kinds() -> Vec<(Gpu, Pipelines)> {
        let open = |tier: Tier| match Gpu::with_tier(&AdapterChoice::from_env(), tier) {
            Ok(gpu) => Some(gpu),
            Err(e @ DeviceError::NoTier { .. }) => {
                println!("skipped: {e}");
                None
            }
            Err(e) => panic!("{e}"),
        };
        let gpus = Tier::ALL.into_iter().filter_map(open);
        gpus.map(|gpu| (gpu.clone(), Pipelines::new(&gpu))).collect()
    }

    fn sorted(
        gpu: &Gpu,
        pipelines: &Pipelines,
        pairs: &[(u32, u32)],
        room: usize,
        bits: u32,
        numbered: bool,
    ) -> Vec<(u32, u32)> {
        // What comes after the pairs must not be sorted among them.
        let padded = |words: Vec<u32>| {
            let words = [words, vec![0; room - pairs.len()]].concat();
            [buffers::filled(gpu, "test", &words), buffers::zeroed(gpu, "test", room)]
        };
        let keys = padded(pairs.iter().map(|pair| pair.0).collect());
        let values = padded(pairs.iter().map(|pair| if numbered { 7 } else { pair.1 }).collect());
        let counters = buffers::filled(gpu, "counters", &[7, pairs.len() as u32]);
        let order = Order { counter: CounterIndex(1), bits, numbered };
        let stages = Stages::new(gpu, pipelines, &counters, order, &keys, &values);
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        stages.encode(&mut encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default()));
        gpu.queue.submit([encoder.finish()]);
        let read = |buffers: &[wgpu::Buffer; 2]| buffers::read(gpu, &buffers[stages.sorted()], pairs.len()).unwrap();
        let (keys, values): (Vec<u32>, Vec<u32>) = (read(&keys), read(&values));
        keys.into_iter().zip(values).collect()
    }

    #[test]
    fn pairs_are_sorted_as_by_the_twin() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(1);
        for (gpu, pipelines) in kinds() {
            for (count, bits) in
                [(0, 5), (1, 12), (2, 1), (7, 30), (2047, 4), (2048, 13), (2049, 14), (100_003, 30), (50_000, 3)]
            {
                let pairs: Vec<(u32, u32)> = (0..count).map(|i| (rng.random_range(0..1 << bits), i)).collect();
                let expected = reference::sort::sort(&pairs, bits);
                let got = sorted(&gpu, &pipelines, &pairs, pairs.len() + 3000, bits, true);
                assert!(got == expected, "{count} pairs, {bits} bits, {}", gpu.tier.name());
                let pairs: Vec<(u32, u32)> = pairs.iter().map(|&(key, i)| (key, 3 * i + 1)).collect();
                let expected = reference::sort::sort(&pairs, bits);
                let got = sorted(&gpu, &pipelines, &pairs, pairs.len() + 3000, bits, false);
                assert!(got == expected, "{count} pairs with values, {bits} bits, {}", gpu.tier.name());
                if count == 2048 {
                    let unsorted = sorted(&gpu, &pipelines, &pairs, pairs.len(), bits - 5, false);
                    assert!(unsorted != expected, "the order is not compared");
                }
            }
        }
    }

    #[test]
    fn prefix_sums_equal_those_of_the_twin() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(2);
        for (gpu, pipelines) in kinds() {
            for count in [1, 2, 1023, 1024, 2048, 2049, 600_001] {
                let values: Vec<u32> = (0..count).map(|_| rng.random_range(0..100)).collect();
                let buffer = buffers::filled(&gpu, "test", &values);
                let totals = buffers::zeroed(&gpu, "totals", 16);
                let scan = pipelines.scan(&gpu, &buffer, count, &totals, CounterIndex(2));
                let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
                scan.encode(&mut encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default()));
                gpu.queue.submit([encoder.finish()]);
                let got: Vec<u32> = buffers::read(&gpu, &buffer, count as usize).unwrap();
                let total = buffers::read::<u32>(&gpu, &totals, 3).unwrap()[2];
                let expected = reference::sort::exclusive_scan(&values);
                assert!((&got, total) == (&expected.0, expected.1), "{count} values, {}", gpu.tier.name());
            }
        }
    }
}

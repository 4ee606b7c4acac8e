//! Twin of `sort.wgsl`, `scan.wgsl` and their block variants.

/// Pairs of key and value, stably sorted by the lowest `bits` of the keys.
pub fn sort(pairs: &[(u32, u32)], bits: u32) -> Vec<(u32, u32)> {
    let mut sorted = pairs.to_vec();
    sorted.sort_by_key(|(key, _)| u64::from(*key) & ((1 << bits) - 1));
    sorted
}

/// For each value the sum of the values before it, and the total.
pub fn exclusive_scan(values: &[u32]) -> (Vec<u32>, u32) {
    let mut total = 0;
    let mut sums = Vec::with_capacity(values.len());
    for value in values {
        sums.push(total);
        total += value;
    }
    (sums, total)
}

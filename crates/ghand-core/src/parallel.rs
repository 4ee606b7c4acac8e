//! Work split in a way that does not depend on the number of threads.

/// Points that one task takes at least, and after which sums are rounded: a few microseconds of work.
pub(crate) const CHUNK: usize = 1024;

/// Sums over `0..count` in chunks of [`CHUNK`] and the chunks in order: always the same order of additions, with far
/// less rounding than one long sum.
pub(crate) fn sum_in_chunks<T: Copy>(
    count: usize,
    zero: T,
    add_point: impl Fn(T, usize) -> T,
    add: impl Fn(T, T) -> T,
) -> T {
    let starts = (0..count).step_by(CHUNK);
    starts.fold(zero, |total, start| add(total, (start..count.min(start + CHUNK)).fold(zero, &add_point)))
}

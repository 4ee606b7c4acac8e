//! Splits work independently of the number of threads.

/// Least number of points per task, and length of the partial sums: a few microseconds of work.
pub(crate) const CHUNK: usize = 1024;

/// Sums over `0..count` in chunks of [`CHUNK`], then over the chunks in order. The order of additions is always the
/// same, and there is far less rounding than in one long sum.
pub(crate) fn sum_in_chunks<T: Copy>(
    count: usize,
    zero: T,
    add_point: impl Fn(T, usize) -> T,
    add: impl Fn(T, T) -> T,
) -> T {
    let starts = (0..count).step_by(CHUNK);
    starts.fold(zero, |total, start| add(total, (start..count.min(start + CHUNK)).fold(zero, &add_point)))
}

//! What can go wrong.

/// Errors of the tracker.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum TrackerError {
    /// Landmarks at one point, or not numbers.
    #[error("landmarks that are to be seen in space are at one point, or no numbers")]
    Landmarks,
    /// Bytes that are not a picture of the given size.
    #[error("a picture of {width} x {height} pixels in RGB has {expected} bytes, not {got}")]
    Picture {
        /// Columns.
        width: u32,
        /// Rows.
        height: u32,
        /// Three bytes for each pixel.
        expected: u64,
        /// Bytes that were given.
        got: usize,
    },
}

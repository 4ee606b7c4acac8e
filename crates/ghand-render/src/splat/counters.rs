//! The counters of a frame.

use std::mem::offset_of;

use bytemuck::{Pod, Zeroable};

/// The counters of a splatter's frame, see `shaders/shared/counters.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct Counters {
    /// Number of Gaussians in the table.
    pub gaussians: u32,
    /// Number of drawn intersections: the wanted ones, up to the capacity.
    pub intersections: u32,
    /// Number of intersections of Gaussians with tiles. If it is larger than the drawn number, the frame is incomplete.
    pub intersections_wanted: u32,
    /// Number of Gaussians dropped because of a number that is not finite, or a quaternion of 0.
    pub broken: u32,
    /// Largest number of Gaussians on a tile, if too many for the driver; else 0.
    pub cut_short: u32,
    /// Largest number of tiles of a Gaussian, if too many for the driver; else 0.
    pub too_wide: u32,
    /// Number of Gaussians with a gradient that is not finite. The backward pass counts them, so only counters that are
    /// read after it have them.
    pub bad_gradients: u32,
    /// Unused.
    pub padding: u32,
}

/// Index of a counter among the counters' words, for the sort and the prefix sum.
#[derive(Debug, Clone, Copy)]
pub struct CounterIndex(pub u32);

impl Counters {
    /// Index of [`Counters::gaussians`].
    pub const GAUSSIANS: CounterIndex = index(offset_of!(Counters, gaussians));
    /// Index of [`Counters::intersections`].
    pub const INTERSECTIONS: CounterIndex = index(offset_of!(Counters, intersections));
    /// Index of [`Counters::intersections_wanted`].
    pub const INTERSECTIONS_WANTED: CounterIndex = index(offset_of!(Counters, intersections_wanted));
    /// Byte offset of the counters that are cleared in every frame and incremented by the stages.
    pub(super) const CLEARED_FROM: u64 = offset_of!(Counters, broken) as u64;
}

const fn index(offset: usize) -> CounterIndex {
    CounterIndex((offset / size_of::<u32>()) as u32)
}

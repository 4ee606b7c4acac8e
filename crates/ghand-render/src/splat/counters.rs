//! What a frame counts.

use std::mem::offset_of;

use bytemuck::{Pod, Zeroable};

/// What a frame of the splatter counts, see `shaders/shared/counters.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct Counters {
    /// Gaussians in the table.
    pub gaussians: u32,
    /// Intersections drawn: those wanted, as far as they fit.
    pub intersections: u32,
    /// Intersections of Gaussians with tiles. More wanted than drawn means that the frame is incomplete.
    pub intersections_wanted: u32,
    /// Gaussians that were dropped because of a number that is not finite, or a quaternion of 0.
    pub broken: u32,
    /// Of the tiles with too many Gaussians for the driver, the largest number of Gaussians; 0 if there is none.
    pub cut_short: u32,
    /// Of the Gaussians on too many tiles for the driver, the largest number of tiles; 0 if there is none.
    pub too_wide: u32,
    /// Unused.
    pub padding_1: u32,
    /// Unused.
    pub padding_2: u32,
}

/// A counter as the sort and the prefix sum address it: its index among the counters' words.
#[derive(Debug, Clone, Copy)]
pub struct CounterIndex(pub u32);

impl Counters {
    /// Index of [`Counters::gaussians`].
    pub const GAUSSIANS: CounterIndex = index(offset_of!(Counters, gaussians));
    /// Index of [`Counters::intersections`].
    pub const INTERSECTIONS: CounterIndex = index(offset_of!(Counters, intersections));
    /// Index of [`Counters::intersections_wanted`].
    pub const INTERSECTIONS_WANTED: CounterIndex = index(offset_of!(Counters, intersections_wanted));
    /// Bytes before the counters that start at 0 in every frame, and that stages add to.
    pub(super) const CLEARED_FROM: u64 = offset_of!(Counters, broken) as u64;
}

const fn index(offset: usize) -> CounterIndex {
    CounterIndex((offset / size_of::<u32>()) as u32)
}

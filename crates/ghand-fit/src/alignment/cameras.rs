//! Cameras in an alignment: their refinement, their clocks, and those that show another hand.

pub(crate) mod calibration;
pub(crate) mod odd;
pub(crate) mod time_offsets;
pub(crate) mod unknowns;

//! The joints of a hand: their names, axes and limits, and where they are in the skin.

pub mod axes;
pub mod hand_directions;
pub mod limits;
pub mod names;
pub mod regressor;
pub mod xr_names;

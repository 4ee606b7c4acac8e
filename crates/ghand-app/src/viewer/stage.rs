//! What is on the screen: the picture, its layers, the comparison with the truth, and what the pointer does there.

pub mod adaptive_detail;
pub mod comparison;
pub mod drags;
pub mod layer;
pub mod legend;
pub mod overlay;
pub mod truth_reader;

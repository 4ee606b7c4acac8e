//! From a recording to the hand model: the fit to landmarks and its report, the transfer of rotations, and what is not
//! plausible.

pub(crate) mod landmark_fit;
pub mod landmark_report;
pub(crate) mod plausibility;
pub(crate) mod proportions;
pub(crate) mod to_model;

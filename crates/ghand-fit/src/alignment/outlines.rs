//! The outlines of masks and of the posed template, and how far they are apart.

pub(crate) mod contour;
pub(crate) mod distance_field;
pub(crate) mod mask_end;

//! Each stage of the deformation on the device against its f64 twin, which gets the device's inputs of that stage.
#![allow(clippy::neg_cmp_op_on_partial_ord, reason = "`!(error <= bound)` rejects NaN too")]

mod blend_shapes;
mod hand;
mod joint_sums;
mod normals;
mod residual_skeleton;
mod shade;
mod skeleton;
mod skin;
mod stretch;

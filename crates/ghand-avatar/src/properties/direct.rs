//! The `direct` property model: free tables per Gaussian, and a local, linear dependence on the pose within limits.

mod device;
mod response_limits;
mod tables;
mod tensors;
mod unseen;

pub use device::{DirectModel, ResponseUniforms};
pub use response_limits::RESPONSE_MARGIN;
pub(super) use tables::bytes_per_gaussian;
#[cfg(feature = "networks")]
pub(super) use tables::set_color_logits;
pub use tables::{DirectTables, no_limits, table_lengths};

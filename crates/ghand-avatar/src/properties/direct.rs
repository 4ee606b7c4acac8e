//! The `direct` property model: free tables per Gaussian, and a local, linear dependence on the pose within limits.

mod device;
mod response_limits;
mod tables;
mod tensors;
mod unseen;

pub use device::{DirectModel, ResponseUniforms};
pub use response_limits::RESPONSE_MARGIN;
pub use tables::{DirectTables, no_limits, table_lengths};
pub(super) use tables::{bytes_per_gaussian, set_color_logits};

//! The `direct` property model: free tables per Gaussian, and a local, linear dependence on the pose within limits.

mod device;
mod response_limits;
mod tables;
mod tensors;

pub use device::{DirectModel, ResponseUniforms};
pub use response_limits::RESPONSE_MARGIN;
pub use tables::{DirectTables, START_SCALE, table_lengths, unlimited};

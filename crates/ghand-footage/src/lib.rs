//! Videos and folders of pictures as frames with times.
//!
//! [`Footage::open`] reads what a video says of itself: size, rate, and the time of each frame. [`Footage::frames`] streams
//! its frames. [`LiveFrames`] gives the newest frame of a camera, or of a video that plays. Videos and cameras are read by
//! ffmpeg, which must be installed; pictures need nothing.

mod clock;
mod error;
mod focal;
mod footage;
mod frames;
mod live;
mod natural_order;
mod pictures;
mod video;

pub use error::FootageError;
pub use focal::StatedFocal;
pub use footage::Footage;
pub use frames::Frames;
pub use live::{LiveFrame, LiveFrames, LiveSource};

//! Captures of hands: calibrated images, masks and poses, read into one type whatever their format, and a synthetic
//! capture whose truth is known.
//!
//! [`Capture`] is what the rest of the system sees. [`ghand_format`] reads and writes the project's own format;
//! [`synthetic`] makes a small capture of a hand that is richer than the template it comes with.

pub mod capture;
pub mod ghand_format;
pub mod synthetic;

pub use capture::{Capture, CaptureError, Frame, Split, View};

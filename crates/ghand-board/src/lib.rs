//! Calibration boards: cameras, and the differences of their clocks, from a board that they film.
//!
//! 1. [`BoardKind`] says what the board is; [`picture`] draws it, for printing.
//! 2. [`BoardFinder`] finds its corners in images; [`BoardCamera`] gathers what one camera saw.
//! 3. [`calibrate`] finds lenses, places and clocks of all cameras together.
//!
//! Corners have numbers as in OpenCV: from left to right, then down; those of an AprilGrid as in Kalibr: from left to right,
//! then up. The board's axes are x right, y down and z away from who looks at it, in metres; its origin is the outer corner
//! at the top left of its squares.

mod calibration;
mod camera;
mod error;
mod finder;
mod kind;
pub mod picture;
pub mod print;

pub use calibration::{BoardCalibration, CalibratedCamera, StandardErrors, calibrate};
pub use camera::{BoardCamera, BoardView, SeenCorner};
pub use error::BoardError;
pub use finder::{BoardFinder, Sight};
pub use kind::BoardKind;

//! The viewer. [`app`] is the user interface, the same in a window and in a screenshot without a display.
//!
//! A folder uses only those above it in this list:
//!
//! - [`widgets`]: controls that know nothing of hands
//! - [`rendering`]: how a subject becomes a picture
//! - [`hand`]: a hand that is posed and shaped, with its panels
//! - [`document`]: what is open
//! - [`session`]: settings and messages
//! - [`stage`]: what is on the screen
//! - [`command`], [`dialogs`], [`live`], [`output`]: what can be done
//! - [`app`], then [`window`] and [`screenshot`] around it

pub mod app;
pub mod command;
pub mod dialogs;
pub mod document;
pub mod hand;
pub mod live;
pub mod output;
pub mod rendering;
pub mod screenshot;
pub mod session;
pub mod stage;
pub mod widgets;
pub mod window;

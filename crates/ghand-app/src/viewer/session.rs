//! What stays when another file is opened: settings, saved views, and messages.

pub mod saved_view;
pub mod settings;
pub mod toasts;

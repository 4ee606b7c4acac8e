//! Plots, and letters in pictures.

pub mod draw_text;
pub mod plot;

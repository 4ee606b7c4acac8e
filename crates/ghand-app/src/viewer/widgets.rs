//! Controls that know nothing of hands: a slider with a number, a plot, a word in a corner.

pub mod corner_label;
pub mod curve_plot;
pub mod number_slider;

//! Controls that know nothing of hands: a slider with a number, a plot.

pub mod curve_plot;
pub mod number_slider;

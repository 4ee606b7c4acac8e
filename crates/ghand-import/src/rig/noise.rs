//! How far landmarks are off, with Student's distribution: single wrong ones hardly count.

/// Degrees of freedom: four are the usual choice (Lange, Little and Taylor 1989).
const FREEDOM: f64 = 4.0;

/// Twice the negative logarithm of the probability of an error of `dimensions` numbers with this square, in units of the
/// noise, and the weight of the square.
pub fn cost_and_weight(squared: f64, dimensions: f64) -> (f64, f64) {
    let strength = FREEDOM + dimensions;
    (strength * (squared / FREEDOM).ln_1p(), strength / (FREEDOM + squared))
}

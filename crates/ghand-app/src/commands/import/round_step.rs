//! Round numbers for scales and axes.

/// The smallest of 1, 2 and 5 times a power of ten that is at least `least`; 1 if that is not positive.
pub fn round_step(least: f64) -> f64 {
    if !(least.is_finite() && least > 0.0) {
        return 1.0;
    }
    let power = 10f64.powf(least.log10().floor());
    let factor = [1.0, 2.0, 5.0].into_iter().find(|factor| factor * power >= least * (1.0 - 1e-9));
    factor.unwrap_or(10.0) * power
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_round_and_not_too_small() {
        for (least, step) in [(0.7, 1.0), (1.0, 1.0), (1.1, 2.0), (0.21, 0.5), (6.0, 10.0), (0.0, 1.0), (f64::NAN, 1.0)]
        {
            assert!((round_step(least) - step).abs() < 1e-12, "{least}: {}", round_step(least));
        }
    }
}

//! Mean, spread and extremes of numbers.

/// Mean and standard deviation; 0 without numbers.
pub fn mean_and_spread(values: impl Iterator<Item = f64> + Clone) -> [f64; 2] {
    let count = values.clone().count().max(1) as f64;
    let mean = values.clone().sum::<f64>() / count;
    [mean, (values.map(|value| (value - mean).powi(2)).sum::<f64>() / count).sqrt()]
}

/// Smallest and largest number; 0 without numbers.
pub fn extremes(values: impl Iterator<Item = f64>) -> [f64; 2] {
    let [low, high] = values.fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], v| [l.min(v), h.max(v)]);
    if low > high { [0.0; 2] } else { [low, high] }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_numbers_have_known_statistics() {
        let values = [1.0, 3.0, 5.0, 7.0, 9.0];
        assert_eq!(mean_and_spread(values.into_iter()), [5.0, 8.0f64.sqrt()]);
        assert_eq!(extremes(values.into_iter()), [1.0, 9.0]);
        assert_eq!(mean_and_spread(std::iter::empty()), [0.0; 2]);
    }
}

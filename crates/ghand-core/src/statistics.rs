//! Quantiles of numbers.

/// The number below which this fraction of the numbers is: the one at the nearest rank; 0 without numbers.
pub fn quantile(values: impl IntoIterator<Item = f64>, fraction: f64) -> f64 {
    let mut values: Vec<f64> = values.into_iter().collect();
    let Some(last) = values.len().checked_sub(1) else { return 0.0 };
    let rank = (fraction * last as f64).round() as usize;
    *values.select_nth_unstable_by(rank.min(last), f64::total_cmp).1
}

/// The number in the middle, of two the larger one; 0 without numbers.
pub fn median(values: impl IntoIterator<Item = f64>) -> f64 {
    quantile(values, 0.5)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_numbers_have_known_quantiles() {
        let values = [9.0, 3.0, 5.0, 7.0, 1.0];
        assert_eq!([0.0, 0.5, 1.0].map(|fraction| quantile(values, fraction)), [1.0, 5.0, 9.0]);
        assert_eq!(median([4.0, 1.0, 3.0, 2.0]), 3.0);
        assert_eq!(quantile([], 0.5), 0.0);
    }
}

//! Agreement of two masks, and the spread of numbers over many images.

/// Intersection over union of two masks of the same image, in `[0, 1]`; `None` if both are empty, because then
/// agreement is undefined. If the lengths differ, the excess counts as disagreement.
pub fn iou(a: &[bool], b: &[bool]) -> Option<f64> {
    let both = a.iter().zip(b).filter(|(a, b)| **a && **b).count();
    let count = |mask: &[bool]| mask.iter().filter(|inside| **inside).count();
    let either = count(a) + count(b) - both;
    (either > 0).then(|| both as f64 / either as f64)
}

/// The spread of numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spread {
    /// Their count, at least 1.
    pub count: usize,
    /// Their mean.
    pub mean: f64,
    /// The smallest.
    pub min: f64,
    /// The largest.
    pub max: f64,
}

impl Spread {
    /// The spread of some numbers; `None` if there are none. A NaN makes mean, minimum and maximum NaN.
    pub fn of(values: impl IntoIterator<Item = f64>) -> Option<Spread> {
        let mut values = values.into_iter();
        let first = values.next()?;
        let mut count = 1;
        let mut sum = first;
        let mut min = first;
        let mut max = first;
        for value in values {
            count += 1;
            sum += value;
            // `f64::min` would drop a NaN.
            min = if value < min || value.is_nan() { value } else { min };
            max = if value > max || value.is_nan() { value } else { max };
        }
        Some(Spread { count, mean: sum / count as f64, min, max })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mask(text: &str) -> Vec<bool> {
        text.bytes().map(|b| b == b'#').collect()
    }

    #[test]
    fn equal_masks_have_overlap_one_and_disjoint_ones_zero() {
        assert_eq!(iou(&mask("##.#"), &mask("##.#")), Some(1.0));
        assert_eq!(iou(&mask("##.."), &mask("..##")), Some(0.0));
        assert_eq!(iou(&mask("...."), &mask("...#")), Some(0.0));
        assert_eq!(iou(&mask("...#"), &mask("....")), Some(0.0));
    }

    #[test]
    fn an_overlap_matches_a_hand_calculation() {
        // 2 in both, 5 in either.
        assert_eq!(iou(&mask("###.#.."), &mask(".##..#.")), Some(0.4));
    }

    #[test]
    fn empty_masks_have_no_overlap_and_excess_length_disagrees() {
        assert_eq!(iou(&mask("..."), &mask("...")), None);
        assert_eq!(iou(&[], &[]), None);
        assert_eq!(iou(&mask("##"), &mask("####")), Some(0.5));
    }

    #[test]
    fn spreads_cover_all_numbers() {
        let spread = Spread::of([2.0, 0.5, 3.5]);
        assert_eq!(spread, Some(Spread { count: 3, mean: 2.0, min: 0.5, max: 3.5 }));
        assert_eq!(Spread::of([]), None);
    }

    #[test]
    fn a_nan_is_kept_at_any_position() {
        for values in [[f64::NAN, 1.0, 2.0], [1.0, f64::NAN, 2.0], [1.0, 2.0, f64::NAN]] {
            let spread = Spread::of(values).unwrap();
            assert!(spread.mean.is_nan() && spread.min.is_nan() && spread.max.is_nan(), "{spread:?}");
        }
    }
}

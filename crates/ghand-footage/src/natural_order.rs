//! The order of names in which numbers count as numbers: `frame9` before `frame10`.

use std::cmp::Ordering;

/// Compares two names.
pub(crate) fn compare(a: &str, b: &str) -> Ordering {
    let mut left = a;
    let mut right = b;
    loop {
        let (Some(first), Some(second)) = (left.chars().next(), right.chars().next()) else {
            // Names that differ only in leading zeros still have an order.
            return left.len().cmp(&right.len()).then_with(|| a.cmp(b));
        };
        let order = if first.is_ascii_digit() && second.is_ascii_digit() {
            let (own, rest) = split_digits(left);
            let (other, other_rest) = split_digits(right);
            left = rest;
            right = other_rest;
            let [own, other] = [own, other].map(|digits| digits.trim_start_matches('0'));
            own.len().cmp(&other.len()).then_with(|| own.cmp(other))
        } else {
            left = &left[first.len_utf8()..];
            right = &right[second.len_utf8()..];
            first.cmp(&second)
        };
        if order.is_ne() {
            return order;
        }
    }
}

fn split_digits(text: &str) -> (&str, &str) {
    text.split_at(text.find(|c: char| !c.is_ascii_digit()).unwrap_or(text.len()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_in_names_count_as_numbers() {
        let mut names = ["b", "a10b2", "a10b10", "a9", "a010", "ä1", "a", "a99999999999999999999999", "a10"];
        names.sort_by(|a, b| compare(a, b));
        assert_eq!(names, ["a", "a9", "a010", "a10", "a10b2", "a10b10", "a99999999999999999999999", "b", "ä1"]);
    }
}

//! Sliders with a formatted number that accept only numbers in the range.

use std::ops::RangeInclusive;

use egui::{Slider, SliderClamping};

/// A slider with this many decimals. Only the user changes its value: rounding to the decimals does not count as a
/// change.
pub fn number_slider<'a>(value: &'a mut f64, range: RangeInclusive<f64>, decimals: usize, unit: &'a str) -> Slider<'a> {
    let accepted = range.clone();
    let now = *value;
    Slider::new(value, range)
        .clamping(SliderClamping::Edits)
        .fixed_decimals(decimals)
        .suffix(unit)
        .custom_formatter(move |value, _| shown(value, decimals))
        // Showing the number does not round it.
        .custom_parser(move |text| if text == shown(now, decimals) { Some(now) } else { typed(text, unit, &accepted) })
        // Typed text counts once it is complete: while typing 180, 18 is not a value to show.
        .update_while_editing(false)
}

/// A number with this many decimals, without a sign if all digits are zero.
fn shown(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    match text.strip_prefix('-') {
        Some(digits) if digits.bytes().all(|b| matches!(b, b'0' | b'.')) => digits.into(),
        _ => text,
    }
}

/// The number that the user typed, with or without its unit; `None` if it is not a number in the range.
fn typed(text: &str, unit: &str, range: &RangeInclusive<f64>) -> Option<f64> {
    // Copied text may have U+2212 as minus sign.
    let text = text.trim().replace('\u{2212}', "-");
    let number = text.strip_suffix(unit.trim()).unwrap_or(&text);
    number.trim().parse().ok().filter(|value| range.contains(value))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_number_is_shown_as_minus_zero() {
        assert_eq!([-0.4, 0.4, -0.0, -0.6, 180.0].map(|v| shown(v, 0)), ["0", "0", "0", "-1", "180"]);
        assert_eq!([-0.004, -0.006, 1.5].map(|v| shown(v, 2)), ["0.00", "-0.01", "1.50"]);
    }

    #[test]
    fn only_numbers_in_the_range_are_accepted() {
        let typed = |text| typed(text, "°", &(-180.0..=180.0));
        assert_eq!(
            [" 12.5 ", "-180", "\u{2212}3", "90°", "1e1"].map(typed).map(Option::unwrap),
            [12.5, -180.0, -3.0, 90.0, 10.0]
        );
        for text in ["", "nan", "NaN", "-nan", "inf", "-inf", "infinity", "181", "-180.5", "1e300", "ten", "1 2", "°"]
        {
            assert_eq!(typed(text), None, "{text}");
        }
    }
}

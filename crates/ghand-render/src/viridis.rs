//! Viridis, the colours of heat maps.

use glam::DVec3;

/// Viridis at 0, 1/8, ..., 1 (Smith and van der Walt, CC0): lightness increases evenly with the value, also for
/// viewers with red-green colour blindness.
const VIRIDIS: [[u8; 3]; 9] = [
    [0x44, 0x01, 0x54],
    [0x47, 0x2c, 0x7a],
    [0x3b, 0x51, 0x8b],
    [0x2c, 0x71, 0x8e],
    [0x21, 0x90, 0x8d],
    [0x27, 0xad, 0x81],
    [0x5c, 0xc8, 0x63],
    [0xaa, 0xdc, 0x32],
    [0xfd, 0xe7, 0x25],
];

/// The colour of a value from 0, dark violet, to 1, yellow; display values. Values beyond are clamped, NaN is as 0.
pub fn viridis(value: f64) -> DVec3 {
    let value = if value.is_nan() { 0.0 } else { value.clamp(0.0, 1.0) };
    let at = value * (VIRIDIS.len() - 1) as f64;
    let low = (at as usize).min(VIRIDIS.len() - 2);
    let [a, b] = [low, low + 1].map(|i| DVec3::from(VIRIDIS[i].map(|v| f64::from(v) / 255.0)));
    a.lerp(b, at - low as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lightness_increases_with_the_value() {
        let luminance = |value: f64| viridis(value).dot(DVec3::new(0.2126, 0.7152, 0.0722));
        let all: Vec<f64> = (0..=100).map(|i| luminance(f64::from(i) / 100.0)).collect();
        assert!(all.windows(2).all(|pair| pair[0] < pair[1]), "{all:?}");
        assert_eq!([viridis(-1.0), viridis(f64::NAN), viridis(2.0)], [viridis(0.0), viridis(0.0), viridis(1.0)]);
    }
}

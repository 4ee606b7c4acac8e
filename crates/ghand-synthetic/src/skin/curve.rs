//! Lines drawn on the skin.

use glam::DVec2;

/// A Bézier curve as a polyline.
pub(crate) fn cubic([a, b, c, d]: [DVec2; 4]) -> Vec<DVec2> {
    (0..=16)
        .map(|i| {
            let t = f64::from(i) / 16.0;
            let u = 1.0 - t;
            u * u * u * a + 3.0 * u * u * t * b + 3.0 * u * t * t * c + t * t * t * d
        })
        .collect()
}

pub(crate) fn distance(line: &[DVec2], p: DVec2) -> f64 {
    line.windows(2)
        .map(|w| {
            let way = w[1] - w[0];
            let t = ((p - w[0]).dot(way) / way.length_squared().max(1e-18)).clamp(0.0, 1.0);
            p.distance(w[0] + way * t)
        })
        .fold(f64::INFINITY, f64::min)
}

//! CPU twin of `wireframe.wgsl`, in f64.

use glam::DVec2;

use crate::mesh::Segment;

/// Camera z of the faces at k times the image's size; infinity where there is no face.
pub(super) struct FaceDepths<'a> {
    pub width: usize,
    pub height: usize,
    pub depth: &'a [f64],
}

/// Coverage of the samples, at k times the image's size, by visible lines `half_width` samples wide on each side.
pub(super) fn line_coverage(segments: &[Segment], half_width: f64, faces: &FaceDepths) -> Vec<f64> {
    let mut covered = vec![0.0f64; faces.width * faces.height];
    let reach = half_width + 0.5;
    for segment in segments {
        let [a, b] = segment.ends;
        let (low, high) = (a.min(b) - reach, a.max(b) + reach);
        let range = |low: f64, high: f64, size: usize| low.max(0.0) as usize..(high.max(0.0).ceil() as usize).min(size);
        for y in range(low.y, high.y, faces.height) {
            for x in range(low.x, high.x, faces.width) {
                let at = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
                let t = place_along(segment, at);
                let middle = a.lerp(b, t);
                let coverage = coverage(at.distance(middle), half_width);
                let inverse_depth = segment.inverse_depths[0] * (1.0 - t) + segment.inverse_depths[1] * t;
                if visible(middle, inverse_depth + segment.tolerance, faces) {
                    let sample = &mut covered[y * faces.width + x];
                    *sample = sample.max(coverage);
                }
            }
        }
    }
    covered
}

/// Position on a segment, 0 to 1, of the point nearest to a sample.
fn place_along(segment: &Segment, at: DVec2) -> f64 {
    let [a, b] = segment.ends;
    let squared = a.distance_squared(b);
    if squared > 1e-12 { ((at - a).dot(b - a) / squared).clamp(0.0, 1.0) } else { 0.0 }
}

/// Length of the part of [distance - 1/2, distance + 1/2] inside [-half_width, half_width].
fn coverage(distance: f64, half_width: f64) -> f64 {
    ((distance + 0.5).min(half_width) - (distance - 0.5).max(-half_width)).clamp(0.0, 1.0)
}

/// Whether at one of the four samples around `place` no face is nearer than `inverse_depth`.
fn visible(place: DVec2, inverse_depth: f64, faces: &FaceDepths) -> bool {
    let base = (place - 0.5).floor();
    [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)].iter().any(|(dx, dy)| {
        let x = (base.x + dx).clamp(0.0, faces.width as f64 - 1.0) as usize;
        let y = (base.y + dy).clamp(0.0, faces.height as f64 - 1.0) as usize;
        inverse_depth >= 1.0 / faces.depth[y * faces.width + x]
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_coverage_of_a_line_sums_to_its_width_at_any_position() {
        for half_width in [0.1, 0.25, 0.5, 1.0, 4.0, 16.0] {
            for shift in [0.0, 0.1, 0.37, 0.5, 0.9] {
                let ink: f64 = (-40..40).map(|x| coverage((f64::from(x) + shift).abs(), half_width)).sum();
                assert!((ink - 2.0 * half_width).abs() < 1e-12, "{half_width} {shift}: {ink}");
            }
        }
    }
}

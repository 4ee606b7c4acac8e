//! Directions spread evenly over the sphere.

use glam::DVec3;

/// Number `k` of `count` directions along a Fibonacci spiral from +z to -z, unit length. None is parallel to the z axis.
pub fn spiral_direction(k: usize, count: usize) -> DVec3 {
    let golden = std::f64::consts::PI * (1.0 + 5.0f64.sqrt());
    let at = k as f64 + 0.5;
    let z = 1.0 - 2.0 * at / count as f64;
    let radius = (1.0 - z * z).sqrt();
    let angle = golden * at;
    DVec3::new(radius * angle.cos(), radius * angle.sin(), z)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_are_about_equally_far_apart() {
        for count in [24, 64] {
            let all: Vec<DVec3> = (0..count).map(|k| spiral_direction(k, count)).collect();
            assert!(all.iter().all(|d| (d.length() - 1.0).abs() < 1e-12 && d.z.abs() < 0.99));
            // Each has 1 / count of the sphere's area; the angle across a disc of that area:
            let across = 2.0 * (1.0 - 2.0 / count as f64).acos();
            for (k, d) in all.iter().enumerate() {
                let others = all.iter().enumerate().filter(|(j, _)| *j != k);
                let nearest = others.map(|(_, other)| d.angle_between(*other)).fold(f64::INFINITY, f64::min);
                assert!((0.7..1.2).contains(&(nearest / across)), "{k} of {count}: {}", nearest / across);
            }
        }
    }
}

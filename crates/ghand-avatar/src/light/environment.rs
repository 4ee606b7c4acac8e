//! Lights other than that of the capture: a studio's, a panorama's, and any light turned.

use ghand_core::light::{DIRECTION_COUNT, directions};
use glam::{DQuat, DVec3};

use super::{Light, LightKind};

/// Up in the world: cameras follow OpenCV, whose y axis points down.
const UP: DVec3 = DVec3::NEG_Y;

/// Why a panorama cannot be a light.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PanoramaError {
    /// It is not twice as wide as high.
    #[error("is {width} x {height} pixels; a panorama of all directions is twice as wide as high")]
    Shape {
        /// Width, pixels.
        width: usize,
        /// Height, pixels.
        height: usize,
    },
    /// A pixel is not a radiance.
    #[error("pixel ({x}, {y}) has a radiance of {radiance}; it must be finite and not negative")]
    Radiance {
        /// Column.
        x: usize,
        /// Row.
        y: usize,
        /// The value.
        radiance: f32,
    },
    /// All of it is black.
    #[error("is black")]
    Black,
}

impl Light {
    /// Soft light of a studio: a large warm key light from above on one side, a weaker fill light from the other, and a
    /// rim light from behind, in a dim room.
    pub fn studio() -> Light {
        let lamps = [
            ([0.7, 0.6, -0.8], 4.5, [1.06, 1.0, 0.92]),
            ([-0.8, 0.2, -0.6], 1.4, [0.94, 1.0, 1.07]),
            ([-0.2, 0.7, 0.9], 2.2, [1.0, 1.0, 1.0]),
        ]
        .map(|([x, up, z], strength, color)| (DVec3::new(x, -up, z).normalize(), strength, color));
        let radiance = |d: DVec3| {
            let room = 0.12 + 0.08 * d.dot(UP);
            [0, 1, 2].map(|c| {
                let lamp = |(towards, strength, color): &(DVec3, f64, [f64; 3])| {
                    strength * color[c] * ((d.dot(*towards) - 1.0) * 6.0).exp()
                };
                room + lamps.iter().map(lamp).sum::<f64>()
            })
        };
        scaled(directions().map(radiance)).unwrap_or_else(Light::even)
    }

    /// The same light from everywhere.
    fn even() -> Light {
        Light {
            kind: LightKind::Transfer,
            turn: DQuat::IDENTITY,
            coefficients: vec![[1.0; 3]; DIRECTION_COUNT],
            lamps: None,
            trust: None,
        }
    }

    /// The light of a panorama of all directions (equirectangular, row-major, linear RGB, width = 2 height): the row is
    /// the angle from straight up, the column the angle around it, the middle straight ahead (z). Its mean radiance is
    /// set to 1, which is that of the capture's light.
    ///
    /// # Errors
    /// [`PanoramaError`] names its fault.
    pub fn of_panorama(width: usize, height: usize, pixels: &[[f32; 3]]) -> Result<Light, PanoramaError> {
        if height == 0 || width != 2 * height || pixels.len() != width * height {
            return Err(PanoramaError::Shape { width, height });
        }
        let all = directions();
        let mut sums = [[0.0f64; 4]; DIRECTION_COUNT];
        for (i, pixel) in pixels.iter().enumerate() {
            let (x, y) = (i % width, i / width);
            if let Some(radiance) = pixel.iter().find(|radiance| !(**radiance >= 0.0 && radiance.is_finite())) {
                return Err(PanoramaError::Radiance { x, y, radiance: *radiance });
            }
            let from_up = std::f64::consts::PI * (y as f64 + 0.5) / height as f64;
            let around = std::f64::consts::TAU * ((x as f64 + 0.5) / width as f64 - 0.5);
            let (sine, cosine) = from_up.sin_cos();
            let d = DVec3::new(sine * around.sin(), -cosine, sine * around.cos());
            let nearest = (0..DIRECTION_COUNT).max_by(|a, b| all[*a].dot(d).total_cmp(&all[*b].dot(d))).unwrap_or(0);
            // Rows near the poles cover less of the sphere.
            for c in 0..3 {
                sums[nearest][c] += sine * f64::from(pixel[c]);
            }
            sums[nearest][3] += sine;
        }
        // A panorama of few pixels has none for some directions.
        let radiances = std::array::from_fn(|k| {
            let from = (0..DIRECTION_COUNT)
                .filter(|j| sums[*j][3] > 0.0)
                .max_by(|a, b| all[*a].dot(all[k]).total_cmp(&all[*b].dot(all[k])));
            from.map_or([0.0; 3], |j| [0, 1, 2].map(|c| sums[j][c] / sums[j][3]))
        });
        scaled(radiances).ok_or(PanoramaError::Black)
    }

    /// The light turned about the vertical by an angle, radians.
    #[must_use]
    pub fn turned(&self, angle: f64) -> Light {
        Light { turn: DQuat::from_axis_angle(UP, angle) * self.turn, ..self.clone() }
    }
}

/// A light with these radiances, scaled to a mean over directions and channels of 1; `None` if all are 0.
fn scaled(radiances: [[f64; 3]; DIRECTION_COUNT]) -> Option<Light> {
    let mean = radiances.iter().flatten().sum::<f64>() / (3 * DIRECTION_COUNT) as f64;
    let coefficients = radiances.iter().map(|radiance| radiance.map(|r| (r / mean) as f32)).collect();
    (mean > 0.0 && mean.is_finite()).then_some(Light {
        kind: LightKind::Transfer,
        turn: DQuat::IDENTITY,
        coefficients,
        lamps: None,
        trust: None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The mean direction of a light, weighted by its radiance above the mean.
    fn towards(light: &Light) -> DVec3 {
        let weight = |c: &[f32; 3]| (f64::from(c[1]) - 1.0).max(0.0);
        light.coefficients.iter().zip(light.directions()).map(|(c, d)| d * weight(c)).sum::<DVec3>().normalize()
    }

    fn mean(light: &Light) -> f64 {
        light.coefficients.iter().flatten().map(|r| f64::from(*r)).sum::<f64>() / (3 * DIRECTION_COUNT) as f64
    }

    /// A panorama of 64 x 32 pixels with a lamp around one pixel.
    fn panorama(x: usize, y: usize) -> Vec<[f32; 3]> {
        let lamp = |i: usize| (i % 64).abs_diff(x) <= 2 && (i / 64).abs_diff(y) <= 2;
        (0..64 * 32).map(|i| if lamp(i) { [40.0, 40.0, 20.0] } else { [0.5; 3] }).collect()
    }

    #[test]
    fn a_panoramas_lamp_is_where_its_pixel_says() {
        for (x, y, expected) in [(32, 16, DVec3::Z), (48, 16, DVec3::X), (32, 1, DVec3::NEG_Y), (16, 16, DVec3::NEG_X)]
        {
            let light = Light::of_panorama(64, 32, &panorama(x, y)).unwrap();
            let angle = towards(&light).angle_between(expected).to_degrees();
            assert!(angle < 15.0, "({x}, {y}): {angle} degrees");
            assert!((mean(&light) - 1.0).abs() < 1e-6);
            let brightest = light.coefficients.iter().max_by(|a, b| a[0].total_cmp(&b[0])).unwrap();
            assert!(brightest[2] < 0.7 * brightest[0], "the lamp is yellow");
        }
    }

    #[test]
    fn a_small_panorama_lights_from_every_direction() {
        let light = Light::of_panorama(4, 2, &[[2.0; 3]; 8]).unwrap();
        assert!(light.coefficients.iter().flatten().all(|r| (*r - 1.0).abs() < 1e-6), "{light:?}");
    }

    #[test]
    fn what_is_no_panorama_is_named() {
        let text = |w, h, pixels: &[[f32; 3]]| Light::of_panorama(w, h, pixels).unwrap_err().to_string();
        assert!(text(3, 2, &[[1.0; 3]; 6]).contains("3 x 2 pixels; a panorama of all directions is twice as wide"));
        assert!(text(0, 0, &[]).contains("0 x 0"));
        for bad in [-1.0, f32::NAN, f32::INFINITY] {
            let mut pixels = [[1.0; 3]; 8];
            pixels[5][1] = bad;
            assert!(text(4, 2, &pixels).contains("pixel (1, 1) has a radiance of"), "{bad}");
        }
        assert_eq!(text(4, 2, &[[0.0; 3]; 8]), "is black");
    }

    #[test]
    fn turning_moves_the_light_and_keeps_its_amount() {
        let light = Light::of_panorama(64, 32, &panorama(32, 16)).unwrap();
        let turned = light.turned(std::f64::consts::FRAC_PI_2);
        assert!((mean(&turned) - mean(&light)).abs() < 1e-6);
        let to = DQuat::from_axis_angle(UP, std::f64::consts::FRAC_PI_2) * towards(&light);
        assert!(towards(&turned).distance(to) < 1e-9, "{} instead of {to}", towards(&turned));
        assert_eq!(light.turned(0.0), light);
        assert!((mean(&Light::studio()) - 1.0).abs() < 1e-6);
    }
}

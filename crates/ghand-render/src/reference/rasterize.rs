//! Twin of `rasterize.wgsl` and `rasterize_backward.wgsl`.

use ghand_core::Camera;
use glam::{DVec2, DVec3};

use super::bin::bin;
use super::project::{ALPHA_MIN, CameraGradient, Filter, Gaussian, Splat, SplatGradient, project, project_vjp};
use crate::splat::TILE_SIZE;

pub(super) const ALPHA_MAX: f64 = 0.99;
pub(super) const TRANSMITTANCE_MIN: f64 = 1e-4;

/// The thresholds of blending. Tests with finite differences set them so that the image is smooth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Thresholds {
    /// Contributions with a smaller alpha are skipped.
    pub alpha_min: f64,
    /// Upper bound of alpha.
    pub alpha_max: f64,
    /// Blending of a pixel stops before the splat that would reduce its transmittance to this or less.
    pub transmittance_min: f64,
    /// Whether splats are listed only in the tiles that their box touches.
    pub tiled: bool,
}

impl Default for Thresholds {
    fn default() -> Self {
        // As the device rounds it: two contributions of just this much leave 1e-4 of the light, less on the device.
        let alpha_max = f64::from(ALPHA_MAX as f32);
        Thresholds { alpha_min: ALPHA_MIN, alpha_max, transmittance_min: TRANSMITTANCE_MIN, tiled: true }
    }
}

/// A scene with its camera and settings.
#[derive(Debug, Clone, Copy)]
pub struct Scene<'a> {
    /// The Gaussians.
    pub gaussians: &'a [Gaussian],
    /// The camera.
    pub camera: &'a Camera,
    /// Background colour.
    pub background: DVec3,
    /// The screen-space blur.
    pub filter: Filter,
    /// The thresholds of blending.
    pub thresholds: Thresholds,
}

/// Gaussian weight and alpha (before its upper bound) of a splat at a pixel centre.
fn raw_alpha(s: &Splat, at: DVec2) -> f64 {
    let d = s.mean - at;
    s.opacity * (-0.5 * (s.conic.x * d.x * d.x + s.conic.z * d.y * d.y) - s.conic.y * d.x * d.y).exp()
}

struct Lists {
    splats: Vec<Option<Splat>>,
    tiles: Vec<Vec<u32>>,
}

impl Scene<'_> {
    fn lists(&self) -> Lists {
        let mut splats: Vec<_> = self.gaussians.iter().map(|g| project(g, self.camera, self.filter)).collect();
        if !self.thresholds.tiled {
            splats.iter_mut().flatten().for_each(|s| s.reach = DVec2::splat(1e9));
        }
        let tiles = bin(&splats, self.camera);
        Lists { splats, tiles }
    }

    /// The splats that contribute to a pixel, front to back, with their raw alpha and the transmittance before each,
    /// and the final transmittance.
    fn pixel<'l>(&self, lists: &'l Lists, x: u32, y: u32) -> (Vec<(u32, &'l Splat, f64, f64)>, f64) {
        let tile = (y / TILE_SIZE) * self.camera.width.div_ceil(TILE_SIZE) + x / TILE_SIZE;
        let at = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
        let mut taken = Vec::new();
        let mut transmittance = 1.0;
        for &index in &lists.tiles[tile as usize] {
            let Some(splat) = &lists.splats[index as usize] else { continue };
            let raw = raw_alpha(splat, at);
            let alpha = raw.min(self.thresholds.alpha_max);
            if alpha < self.thresholds.alpha_min {
                continue;
            }
            let next = transmittance * (1.0 - alpha);
            if next <= self.thresholds.transmittance_min {
                break;
            }
            taken.push((index, splat, raw, transmittance));
            transmittance = next;
        }
        (taken, transmittance)
    }

    /// The image, row-major: colour over the background, and coverage.
    pub fn rasterize(&self) -> Vec<[f64; 4]> {
        let lists = self.lists();
        let mut image = Vec::with_capacity((self.camera.width * self.camera.height) as usize);
        for y in 0..self.camera.height {
            for x in 0..self.camera.width {
                let (taken, transmittance) = self.pixel(&lists, x, y);
                let mut color = self.background * transmittance;
                for (_, splat, raw, before) in taken {
                    color += splat.color * raw.min(self.thresholds.alpha_max) * before;
                }
                image.push([color.x, color.y, color.z, 1.0 - transmittance]);
            }
        }
        image
    }

    /// The largest weight with which a pixel takes each Gaussian.
    pub fn largest_weights(&self) -> Vec<f64> {
        let lists = self.lists();
        let mut largest = vec![0.0f64; self.gaussians.len()];
        for (y, x) in (0..self.camera.height).flat_map(|y| (0..self.camera.width).map(move |x| (y, x))) {
            for (index, _, raw, before) in self.pixel(&lists, x, y).0 {
                let slot = &mut largest[index as usize];
                *slot = slot.max(raw.min(self.thresholds.alpha_max) * before);
            }
        }
        largest
    }

    /// Expected depth: the camera z of each pixel's splats, with the same weights as their colours, divided by the
    /// coverage; 0 in empty pixels.
    pub fn depth(&self) -> Vec<f64> {
        let lists = self.lists();
        let pixels = (0..self.camera.height).flat_map(|y| (0..self.camera.width).map(move |x| (x, y)));
        let depth = |(x, y)| {
            let (taken, transmittance) = self.pixel(&lists, x, y);
            let sum: f64 = taken
                .iter()
                .map(|(_, splat, raw, before)| splat.depth * raw.min(self.thresholds.alpha_max) * before)
                .sum();
            if taken.is_empty() { 0.0 } else { sum / (1.0 - transmittance) }
        };
        pixels.map(depth).collect()
    }

    /// dL/d(Gaussians) and dL/d(camera) from dL/d(image).
    pub fn rasterize_vjp(&self, d_image: &[[f64; 4]]) -> (Vec<Gaussian>, CameraGradient) {
        let lists = self.lists();
        let mut d_splats = vec![SplatGradient::default(); self.gaussians.len()];
        for y in 0..self.camera.height {
            for x in 0..self.camera.width {
                let d = d_image[(y * self.camera.width + x) as usize];
                let d_color = DVec3::new(d[0], d[1], d[2]);
                let at = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
                let (taken, transmittance) = self.pixel(&lists, x, y);
                let mut behind = transmittance * (self.background.dot(d_color) - d[3]);
                for (index, splat, raw, before) in taken.into_iter().rev() {
                    let alpha = raw.min(self.thresholds.alpha_max);
                    let value = splat.color.dot(d_color);
                    let d_alpha = before * value - behind / (1.0 - alpha);
                    behind += alpha * before * value;
                    let d_splat = &mut d_splats[index as usize];
                    d_splat.color += d_color * alpha * before;
                    if raw <= self.thresholds.alpha_max {
                        let d_power = d_alpha * raw;
                        let o = splat.mean - at;
                        d_splat.mean -= d_power
                            * DVec2::new(
                                splat.conic.x * o.x + splat.conic.y * o.y,
                                splat.conic.y * o.x + splat.conic.z * o.y,
                            );
                        d_splat.conic -= d_power * DVec3::new(0.5 * o.x * o.x, o.x * o.y, 0.5 * o.y * o.y);
                        d_splat.opacity += d_power / splat.opacity;
                    }
                }
            }
        }
        let mut d_camera = CameraGradient::ZERO;
        // Culled splats have no gradient, and the gradient of a broken one must not be computed.
        let d_gaussians = self.gaussians.iter().zip(&lists.splats).zip(&d_splats).map(|((g, splat), d)| match splat {
            Some(_) => project_vjp(g, self.camera, self.filter, d, &mut d_camera),
            None => g.zero_like(),
        });
        (d_gaussians.collect(), d_camera)
    }
}

#[cfg(test)]
mod tests {
    use ghand_core::rotation::rotation_from_axis_angle;
    use glam::{DMat3, DVec4};
    use rand::{RngExt, SeedableRng};

    use super::*;
    use crate::reference::project::{BLUR, Color, NARROW_BLUR};

    /// Every number of a Gaussian, one after the other.
    fn numbers(g: &Gaussian) -> Vec<f64> {
        let mut all = [g.mean.to_array(), g.scales.to_array()].concat();
        all.extend(g.rotation.to_array());
        all.push(g.opacity);
        all.extend(g.coefficients().iter().flat_map(|c| c.to_array()));
        all
    }

    fn with_number(g: &Gaussian, field: usize, add: f64) -> Gaussian {
        let mut g = g.clone();
        match field {
            0..3 => g.mean[field] += add,
            3..6 => g.scales[field - 3] += add,
            6..10 => g.rotation[field - 6] += add,
            10 => g.opacity += add,
            _ => match &mut g.color {
                Color::Rgb(color) => color[field - 11] += add,
                Color::SphericalHarmonics(c) => c[(field - 11) / 3][(field - 11) % 3] += add,
            },
        }
        g
    }

    fn random_scene(rng: &mut rand_chacha::ChaCha8Rng, bases: usize) -> Vec<Gaussian> {
        let mut v = || DVec3::from_array(std::array::from_fn(|_| rng.random_range(-1.0..1.0)));
        // Some are far outside the view, where the Jacobian is clamped; some colours are clamped at 0.
        (0..12)
            .map(|i| Gaussian {
                mean: v() * if i < 9 { 0.2 } else { 0.7 },
                scales: (v() * 0.04 + 0.06) * if i % 2 == 0 { 1.0 } else { 0.2 },
                rotation: DVec4::new(v().x, v().x, v().x, v().x) * (1.0 + 3.0 * i as f64),
                opacity: 0.5 + 0.4 * v().x,
                color: match bases {
                    0 => Color::Rgb(v() * 0.5 + 0.5),
                    _ => Color::SphericalHarmonics((0..bases).map(|_| v()).collect()),
                },
            })
            .collect()
    }

    #[test]
    fn the_gradients_agree_with_central_differences_where_the_image_is_smooth() {
        for (seed, bases, antialias) in
            [(5, 0, false), (6, 0, true), (7, 1, false), (8, 4, true), (9, 9, false), (10, 16, true)]
        {
            let filter = Filter { antialias, blur: if antialias { NARROW_BLUR } else { BLUR } };
            let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
            let camera = Camera {
                focal: DVec2::new(30.0, 26.0),
                principal: DVec2::new(7.2, 9.1),
                ..Camera::look_at(DVec3::new(0.1, 0.2, -1.0), DVec3::ZERO, DVec3::Y, 0.6, 17, 15)
            };
            let gaussians = random_scene(&mut rng, bases);
            let weights: Vec<[f64; 4]> =
                (0..17 * 15).map(|_| std::array::from_fn(|_| rng.random_range(-1.0..1.0))).collect();
            let thresholds = Thresholds { alpha_min: 0.0, alpha_max: 2.0, transmittance_min: 0.0, tiled: false };
            let background = DVec3::new(0.3, 0.1, 0.7);
            let loss = |gaussians: &[Gaussian], camera: &Camera| -> f64 {
                let scene = Scene { gaussians, camera, background, filter, thresholds };
                scene.rasterize().iter().zip(&weights).map(|(p, w)| (0..4).map(|c| p[c] * w[c]).sum::<f64>()).sum()
            };
            let scene = Scene { gaussians: &gaussians, camera: &camera, background, filter, thresholds };
            let (gradient, d_camera) = scene.rasterize_vjp(&weights);
            let check = |analytic: f64, numeric: f64, what: String| {
                let error = (analytic - numeric).abs() / (1.0 + numeric.abs());
                assert!(error <= 1e-6, "{bases} bases, {what}: {analytic} against {numeric}");
            };
            for (i, d) in gradient.iter().enumerate() {
                for (field, analytic) in numbers(d).into_iter().enumerate() {
                    let shifted = |h: f64| {
                        let mut other = gaussians.clone();
                        other[i] = with_number(&gaussians[i], field, h);
                        loss(&other, &camera)
                    };
                    check(analytic, (shifted(1e-6) - shifted(-1e-6)) / 2e-6, format!("gaussian {i} field {field}"));
                }
            }
            for axis in 0..3 {
                let step = |h: f64| DVec3::from_array(std::array::from_fn(|k| if k == axis { h } else { 0.0 }));
                let moved =
                    |h| loss(&gaussians, &Camera { translation: camera.translation + step(h), ..camera.clone() });
                check(d_camera.translation[axis], (moved(1e-6) - moved(-1e-6)) / 2e-6, format!("translation {axis}"));
                // The derivative along a rotation: dR = [w]x R.
                let turned = |h| {
                    let rotation = rotation_from_axis_angle(step(h)) * camera.rotation;
                    loss(&gaussians, &Camera { rotation, ..camera.clone() })
                };
                let turn = DMat3::from_cols(
                    step(1.0).cross(camera.rotation.x_axis),
                    step(1.0).cross(camera.rotation.y_axis),
                    step(1.0).cross(camera.rotation.z_axis),
                );
                let inner =
                    |a: &DMat3, b: &DMat3| a.to_cols_array().iter().zip(b.to_cols_array()).map(|(x, y)| x * y).sum();
                let numeric = (turned(1e-6) - turned(-1e-6)) / 2e-6;
                check(inner(&d_camera.rotation, &turn), numeric, format!("rotation {axis}"));
            }
        }
    }
}
